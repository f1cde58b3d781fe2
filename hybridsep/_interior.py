"""A bounded quadratic programme by an interior-point method with a bounded number of steps.

``min ½ xᵀPx − vᵀx`` subject to ``low ≤ A x ≤ high``, by Mehrotra's predictor-corrector method (S. Mehrotra, SIAM J.
Optim. 2 (1992); J. Nocedal and S. J. Wright, *Numerical Optimization*, 2nd ed., section 16.6): every iterate stays
inside the bounds it has reached once, so that what is found after any number of steps keeps them, and the number of
steps hardly grows with the number of active bounds. The C core has the same method, spread over samples.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from .signals import Array

__all__ = ["STEPS_MAX", "minimise"]

STEPS_MAX = 24
"""Steps at most; 4 to 10 are usual, 23 were the most in any run where the limits are those of the trajectory."""

_TOLERANCE = 1e-5
"""Complementarity at the end, as a share of the cost at the beginning."""

_OUTSIDE = 1e-9
"""Distance from the bounds, in their unit, that is taken for none."""

_FIRST_SLACK = 1e-2
"""Least distance from a bound to begin with, in the bounds' unit."""

_STEP = 0.995
"""Share of the way to the nearest bound that a step goes."""


def minimise(P: Array, v: Array, rows: Array, low: Array, high: Array, start: Array, cost: float) -> Array:
    """Return the minimum of ``½ xᵀPx − vᵀx`` with ``low ≤ rows @ x ≤ high``.

    Parameters
    ----------
    P : (n, n) array
        Symmetric, positive definite.
    v : (n,) array
    rows : (m, n) array
        In units in which a bound is about 1.
    low, high : (m,) arrays
        ``low < high``.
    start : (n,) array
        Where to begin.
    cost : float
        Size of the cost, > 0, by which the end is recognised.

    Returns
    -------
    x : (n,) array
        Not finite if the problem is not.
    """
    # As B x ≥ b, with slacks s = B x − b > 0 and multipliers z > 0, s z → 0
    B, b = np.concatenate((rows, -rows)), np.concatenate((low, -high))
    x, m = start.copy(), len(rows)
    s = np.maximum(B @ x - b, _FIRST_SLACK)
    first = cost / len(s)
    z = first / s
    for _ in range(STEPS_MAX):
        outside = B @ x - b - s
        mean = float(s @ z) / len(s)
        if mean < _TOLERANCE * first and np.max(np.abs(outside)) < _OUTSIDE:
            break
        weight = z / s
        try:
            factor = cho_factor(P + rows.T @ ((weight[:m] + weight[m:])[:, None] * rows))
        except (LinAlgError, ValueError):
            break
        # Newton: P dx − Bᵀ dz = v − P x + Bᵀ z,  ds = B dx + outside,  z ds + s dz = wanted
        force = v - P @ x + B.T @ (z - weight * outside)
        wanted = -s * z  # predictor: as if s z = 0 could be reached at once
        dx = cho_solve(factor, force + B.T @ (wanted / s))
        ds = B @ dx + outside
        dz = (wanted - z * ds) / s
        reached = float((s + _room(s, ds) * ds) @ (z + _room(z, dz) * dz)) / len(s)
        centre = max(mean * (reached / mean) ** 3, 0.1 * _TOLERANCE * first)
        wanted = centre - s * z - ds * dz  # corrector: towards the centre, with the predictor's curvature
        dx = cho_solve(factor, force + B.T @ (wanted / s))
        ds = B @ dx + outside
        dz = (wanted - z * ds) / s
        primal, dual = (1.0 if room >= 1.0 else _STEP * room for room in (_room(s, ds), _room(z, dz)))
        x, s, z = x + primal * dx, s + primal * ds, z + dual * dz
    return np.asarray(x)


def _room(s: Array, ds: Array) -> float:
    """Return the largest step, at most 1, with which ``s`` stays ≥ 0."""
    shrinking = ds < 0
    return float(min(1.0, np.min(-s[shrinking] / ds[shrinking], initial=1.0)))
