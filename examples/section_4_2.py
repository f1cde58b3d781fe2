"""Section 4.2 of the paper on the simulated stage: errors along the spiral, and paths where the hybrid is worse.

Run it with ``python examples/section_4_2.py``. Table 1's modes, the paper's ``Np``, ``p``, ``q`` and eq. (14), the
library, noise seed 0, RMS against the measured position. The second table moves the same stage between two points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybridsep import PAPER_LIMITS, Encoder, Machine, backtest, paper_machine, rest_to_rest, simulate, spiral
from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import Backtest

NEAR = 100
"""Samples after a reversal of the command that count as near it."""

SLOWING = 18
"""Samples in which eq. (14) lets the stage come to rest from 80 mm/s: ``v/a + a/j``."""


def replay(machine: Machine, x_d: Array) -> tuple[Array, Backtest, list[float]]:
    """Return the measured positions, ``(n,)``, m, the predictions, and the largest pole of each window's recursion."""
    assert machine.plant is not None
    encoder = Encoder(machine.plant.noise_std, machine.plant.seed)
    x = encoder.measure_all(simulate(machine.new_plant(), x_d, machine.T_s))
    predictor, poles = machine.new_predictor(), [0.0]

    def learned(_: float) -> None:
        recursion = np.concatenate(([1.0], -predictor.residual.lag_weights))
        poles.append(float(np.max(np.abs(np.roots(recursion)))))

    return x, backtest(predictor, x_d, x, progress=learned), poles


def near_reversals(x_d: Array) -> NDArray[np.bool_]:
    """Return which samples follow a reversal of the command within ``NEAR`` samples, ``(n,)`` of bool."""
    near = np.zeros(len(x_d), dtype=np.bool_)
    for k in np.flatnonzero(np.diff(np.sign(np.diff(x_d)))):
        near[k : k + NEAR] = True
    return near


def parts_of_the_spiral() -> None:
    """Print both models' errors on parts of the spiral."""
    print("Spiral, RMS in µm                     samples  physics   hybrid  share of the hybrid's mean square")
    for axis, x_d in zip("xy", spiral(), strict=True):
        x, result, _ = replay(paper_machine(f"als25010_{axis}"), x_d)
        k, near = np.arange(len(x)), near_reversals(x_d)
        learned = result.active
        for name, part in (
            ("whole", k >= 0),
            ("warm-up", ~learned),
            ("within 0.1 s of a reversal", learned & near),
            ("elsewhere", learned & ~near),
            ("slowing down at the end", k >= len(k) - SLOWING),
        ):
            physics, hybrid = (x - predicted for predicted in (result.x_pb, result.x_h))
            share = float(np.sum(hybrid[part] ** 2) / np.sum(hybrid**2))
            print(
                f"  {axis.upper()}  {name:<32}{np.count_nonzero(part):9d}{1e6 * rms(physics[part]):9.1f}"
                f"{1e6 * rms(hybrid[part]):9.1f}{share:9.0%}"
            )


def other_paths() -> None:
    """Print both models' errors where the stage moves between two points, with and without rests."""
    print("\nThere and back, RMS in µm              physics   hybrid   ratio  batch at which the hybrid is worst")
    for axis in "xy":
        machine = paper_machine(f"als25010_{axis}")
        for length, dwell in ((0.030, 0.3), (0.030, 0.0), (0.013, 0.3), (0.013, 0.0)):
            x_d = rest_to_rest(np.resize([0.0, length], 8), PAPER_LIMITS, machine.T_s, dwell=dwell)
            x, result, poles = replay(machine, x_d)
            physics, hybrid = 1e6 * rms(x - result.x_pb), 1e6 * rms(x - result.x_h)
            worst = int(np.argmax(result.batch_rms_h))
            print(
                f"  {axis.upper()}  {1e3 * length:.0f} mm, {dwell:g} s of rest".ljust(38)
                + f"{physics:9.1f}{hybrid:9.1f}{hybrid / physics:8.2f}  "
                f"{1e6 * result.batch_rms_h[worst]:.0f} instead of {1e6 * result.batch_rms_pb[worst]:.0f} "
                f"from {worst * 100 * machine.T_s:.1f} s on, largest pole {poles[worst]:.2f}"
            )


if __name__ == "__main__":
    parts_of_the_spiral()
    other_paths()
