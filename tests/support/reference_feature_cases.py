"""The formula of the features of the reference, and paths for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hybridsep.base.signals import Array

TS, V_S = 1e-3, 2e-3


SHIFTS = (-40, -30, -20, -15, -10, -5, 0, 5, 10, 15, 20, 30, 40)


SCALE = 1e-3  # m


def formula(path: Sequence[float], start: float, first: int, n: int, known: int, v_friction: float = V_S) -> Array:
    """Return the features of samples ``first … first + n − 1`` where ``path`` is known before ``known``, ``(n, 13)``.

    ``ψ(k) = tanh((r(k) − r(k−1)) / (v_friction T_s))``, at rest before sample 0 and held from ``known`` on; each
    feature is ψ shifted, in metres.
    """

    def sign(k: int) -> float:
        if not 0 <= k < known:
            return 0.0
        return math.tanh((path[k] - (path[k - 1] if k else start)) / (v_friction * TS))

    return SCALE * np.array([[sign(k + shift) for shift in SHIFTS] for k in range(first, first + n)])


def reversing(n: int, start: float = 0.0) -> Array:
    """Return a path that turns, rests and moves at speeds around ``v_friction``, ``(n,)``, m."""
    t = TS * np.arange(n)
    slow = 2e-4 * np.sin(23 * t) + 1e-3 * (1 - np.cos(9 * t))
    slow[n // 3 : n // 2] = slow[n // 3]
    return np.asarray(start + slow, dtype=np.float64)
