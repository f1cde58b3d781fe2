"""Calibrate the stage's friction: the ``f`` with which the physics model errs as the paper prints.

The ratio ``κ/f = 1.5e-3 mm⁻²`` is fixed; ``f`` alone is found, so that the physics-only RMS on the spiral, against the
measured position, is 22.0 µm on X and 130.2 µm on Y. The results stand in ``models/als25010_*.toml``.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from hybridsep import Encoder, load_machine, simulate, spiral
from hybridsep.machine import StageSection

PRINTED = {"x": 22.0e-6, "y": 130.2e-6}  # m
KAPPA_OVER_F = 1.5e3  # 1/m²


def calibrate(axis: str, command: np.ndarray) -> float:
    """Return ``f`` in metres for one axis; ``command`` is ``(n,)``, m."""
    machine = load_machine(f"als25010_{axis}")
    assert isinstance(machine.plant, StageSection)
    discrete = machine.model.discretise(machine.T_s)
    x_pb, _ = discrete.respond(discrete.rest(), command)
    noise = Encoder(machine.plant.noise_std, machine.plant.seed).measure_all(np.zeros(len(command)))

    def miss(f: float) -> float:
        x = simulate(machine.new_plant(f=f, kappa=KAPPA_OVER_F * f), command, machine.T_s) + noise
        return float(np.sqrt(np.mean((x - x_pb) ** 2))) - PRINTED[axis]

    return float(brentq(miss, 0.3 * PRINTED[axis], 1.2 * PRINTED[axis], rtol=1e-4))


if __name__ == "__main__":
    for axis, command in zip("xy", spiral(), strict=True):
        f = calibrate(axis, command)
        print(f"{axis.upper()}: f = {f:.4e} m, kappa = {KAPPA_OVER_F * f:.4e} 1/m, for {1e6 * PRINTED[axis]:g} µm")
