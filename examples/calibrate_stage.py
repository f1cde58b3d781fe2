"""Calibration of the stage's friction ``f`` to the physics-only error that the paper prints.

The modes are Table 1's and the ratio ``κ/f = 1.5e-3 mm⁻²`` is fixed; only ``f`` is found, so that the
physics-only RMS on the spiral, against the measured position, is 22.0 µm on X and 130.2 µm on Y. The results stand in
``models/als25010_*.toml``. With ``--assumptions`` (some minutes) the same is done for other spirals and ratios, which
the paper does not print, to see how far the hybrid's gain depends on them.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from scipy.optimize import brentq

from hybridsep import Encoder, Machine, backtest, paper_machine, simulate, spiral
from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.demo.cases import PRINTED
from hybridsep.machines.sections import StageSection

KAPPA_OVER_F = 1.5e3  # 1/m²
ASSUMPTIONS = {
    "as in the machine files": (0.030, 5.0, KAPPA_OVER_F),
    "20 mm": (0.020, 5.0, KAPPA_OVER_F),
    "40 mm": (0.040, 5.0, KAPPA_OVER_F),
    "3 turns": (0.030, 3.0, KAPPA_OVER_F),
    "8 turns": (0.030, 8.0, KAPPA_OVER_F),
    "friction alone": (0.030, 5.0, 0.0),
    "κ/f twice as large": (0.030, 5.0, 2 * KAPPA_OVER_F),
}
"""Radius of the spiral, m, its turns and κ/f, 1/m²."""


def printed(axis: str) -> float:
    """Return the paper's physics-only RMS of an axis, m."""
    return 1e-6 * PRINTED[f"spiral_{axis}"]["rms_pb_um"]


def measured(machine: Machine, command: Array, f: float, ratio: float) -> Array:
    """Return the measured positions, ``(n,)``, m, with ``f``, m, and ``κ/f``, 1/m²."""
    assert isinstance(machine.plant, StageSection)
    encoder = Encoder(machine.plant.noise_std, machine.plant.seed)
    return encoder.measure_all(simulate(machine.new_plant(f=f, kappa=ratio * f), command, machine.T_s))


def calibrate(axis: str, command: Array, ratio: float = KAPPA_OVER_F) -> float:
    """Return ``f`` in metres for one axis; ``command`` is ``(n,)``, m, and ``ratio`` is ``κ/f``, 1/m²."""
    machine, aim = paper_machine(f"als25010_{axis}"), printed(axis)
    discrete = machine.model.discretise(machine.T_s)
    x_pb, _ = discrete.forced_response(discrete.rest(), command)

    def miss(f: float) -> float:
        return rms(measured(machine, command, f, ratio) - x_pb) - aim

    return float(brentq(miss, 0.2 * aim, 1.5 * aim, rtol=1e-4))


def compare_assumptions() -> None:
    """Print the hybrid's error under each of the assumptions, ``f`` being calibrated anew."""
    for name, (radius, turns, ratio) in ASSUMPTIONS.items():
        for axis, command in zip("xy", spiral(radius=radius, turns=turns), strict=True):
            machine, f = paper_machine(f"als25010_{axis}"), calibrate(axis, command, ratio)
            # The warm-up is 5 % of the trajectory, as in the paper
            predictor = machine.new_predictor(
                replace(machine.predictor_settings, t_init=0.05 * machine.T_s * len(command))
            )
            found = backtest(predictor, command, measured(machine, command, f, ratio)).summary()
            printed = PRINTED[f"spiral_{axis}"]["reduction_percent"]
            print(
                f"{axis.upper()}  {name:<26}f = {f:.4e} m: {found['rms_pb_um']:6.1f} → {found['rms_h_um']:5.1f} µm, "
                f"−{found['reduction_percent']:.0f} % (printed: −{printed:g} %), "
                f"{found['ratio_to_hold']:.2f} × hold",
                flush=True,
            )


def main() -> None:
    """Print ``f`` and ``κ`` of both axes, or what other assumptions come to."""
    parser = argparse.ArgumentParser(description="Calibrate the friction of the simulated stage.")
    parser.add_argument("--assumptions", action="store_true", help="other spirals and ratios κ/f (some minutes)")
    if parser.parse_args().assumptions:
        compare_assumptions()
        return
    for axis, command in zip("xy", spiral(), strict=True):
        f = calibrate(axis, command)
        print(f"{axis.upper()}: f = {f:.4e} m, kappa = {KAPPA_OVER_F * f:.4e} 1/m, for {1e6 * printed(axis):g} µm")


if __name__ == "__main__":
    main()
