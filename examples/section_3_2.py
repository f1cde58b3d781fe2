"""Section 3.2 of the paper: readings of its equations (12) and (13), and the effect of λ, which is not printed.

Run it with ``python examples/section_3_2.py``. The printed figures are 33.7 µm for the physics model and 14.7 µm for
the hybrid one, RMS on the staircase.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mechanism import Drive, simulate

from hybridsep import Encoder, backtest, paper_machine, staircase
from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array

FINER = 10
"""Steps of the simulation in a sampling interval."""

Force = Callable[[float, float], float]
"""Force against the motion, N, of position, m, and velocity, m/s."""


def in_mm(force: Force) -> Force:
    """Return a force law of mm and mm/s in kg·mm/s², in SI units."""
    return lambda x, v: 1e-3 * force(1e3 * x, 1e3 * v)


def eq_12(x: float, v: float) -> float:
    """Eq. (12): ``H_NL = 0.1 sgn(v) v² + 1 sgn(x) x²``."""
    return 0.1 * v * abs(v) + x * abs(x)


def eq_13(x: float, v: float) -> float:
    """Eq. (13) as printed, beyond eq. (11): ``0.1 |v| v + (|x| x) x``."""
    return 0.1 * abs(v) * v + abs(x) * x * x


def residual(force: Force, x_d: Array) -> Array:
    """Return ``x − x_pb``, ``(n,)``, m, of the paper's drive; the command is held for 1 ms, the force for 0.1 ms."""
    drive = Drive.spring_mass_damper(T_s=1e-3 / FINER)

    def pushed(_: int, z: Array, command: float) -> float:
        return -force(float(drive.C @ z), float(drive.V @ z) + drive.V_d * command)

    return simulate(drive, np.repeat(x_d, FINER), pushed).e_pb[::FINER]


def main() -> None:
    """Print the physics-only error under each reading of (12) and (13), then the hybrid's over λ."""
    x_d = staircase()
    noise = Encoder(5e-6, 0).measure_all(np.zeros(len(x_d)))
    print("Physics-only RMS on the staircase, µm: against the measured position (printed 33.7), against the true one")
    for name, force in (
        ("(12) in metres and newtons", eq_12),
        ("(12) in mm and kg·mm/s²", in_mm(eq_12)),
        ("(13) as printed, (k + |x| x) x, in mm and kg·mm/s²", in_mm(eq_13)),
    ):
        e_pb = residual(force, x_d)
        measured, true = (1e6 * rms(e) for e in (e_pb + noise, e_pb))
        print(f"  {name:<52}{measured:9.2f}{true:10.3f}")
    machine = paper_machine("spring_mass_damper")
    discrete = machine.model.discretise(machine.T_s)
    x = discrete.forced_response(discrete.rest(), x_d)[0] + residual(in_mm(eq_12), x_d) + noise
    print("Hybrid RMS, µm, over λ, m² (printed 14.7)")
    for exponent in range(-16, -5):
        found = backtest(machine.new_predictor(replace(machine.predictor_settings, lam=10.0**exponent)), x_d, x)
        print(f"  1e{exponent:<5}{1e6 * found.overall.h.rms:9.2f}")


if __name__ == "__main__":
    main()
