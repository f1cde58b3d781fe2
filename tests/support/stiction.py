"""Servo with stiction: position loop, mass and friction, which stands still until its command is far enough away."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from stream import Array

_STEPS = 20
"""Steps of integration in a sample."""


def servo(
    x_d: Array, T_s: float, *, f_n: float, zeta: float, static: float, coulomb: float, resolution: float
) -> Array:
    """Return the measured position under held commands, (n,), m.

    ``static`` and ``coulomb`` are the friction of rest and motion, N, over the stiffness of the loop, N/m; ``f_n``, Hz.
    """
    omega, h = 2.0 * math.pi * f_n, T_s / _STEPS
    x, v, found = float(x_d[0]), 0.0, []
    for command in x_d.tolist():
        found.append(x)
        for _ in range(_STEPS):
            e = command - x
            if v == 0.0 and abs(e) <= static:
                break  # for the rest of the sample
            friction = math.copysign(coulomb, v if v != 0.0 else e)
            after = v + h * (omega**2 * (e - friction) - 2.0 * zeta * omega * v)
            v = 0.0 if after * v < 0.0 else after
            x += h * v
    return resolution * np.rint(np.array(found) / resolution)


@cache
def slow_servo(name: str) -> tuple[Array, Array]:
    """Return commands and measured positions, (4000,), m, of a servo that stands for hundreds of samples, at 1 ms."""
    t = 1e-3 * np.arange(4000)
    lead = 0.05 * np.sin(2.0 * np.pi * 2.5 * t)
    x_d = {
        "to and fro": 0.03 * np.sin(2.0 * np.pi * 0.25 * t),
        "creep": 0.015 * t,
        "creep after motion": np.where(t < 1.6, lead, 0.015 * (t - 1.6)),
    }[name]
    coulomb = 0.015 if name == "to and fro" else 0.01
    return x_d, servo(x_d, 1e-3, f_n=25.0, zeta=0.7, static=0.02, coulomb=coulomb, resolution=1.5e-4)
