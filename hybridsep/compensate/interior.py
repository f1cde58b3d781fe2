"""Interior-point solver for a bounded quadratic programme, with a bounded number of steps.

``min ½ xᵀPx − vᵀx`` subject to ``low ≤ A x ≤ high``, by Mehrotra's predictor-corrector method (S. Mehrotra, SIAM J.
Optim. 2 (1992); J. Nocedal and S. J. Wright, *Numerical Optimization*, 2nd ed., section 16.6) with a proximal
regularisation of the multipliers (M. P. Friedlander and D. Orban, Math. Prog. Comp. 4 (2012)). The number of steps
hardly grows with the number of active bounds. The C core has the same method, spread over samples.

A plan is the start of the next one, so the minimum is found to nearly all its digits: it depends on the problem far
less steeply than an iterate on the way to it, and so two implementations' roundings stay small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..base.signals import Array

__all__ = ["PRIMAL_RESIDUAL", "STEPS_MAX", "minimise"]

STEPS_MAX = 24
"""Steps at most; 12 on average, and 34 of 1 399 bounded plans with random parameters ended here."""

_GAP = 1e-15
"""Complementarity μ at the end, as a share of the cost for each bound."""

PRIMAL_RESIDUAL = 1e-11
"""Primal residual at the end, in the bounds' unit: a bound is exceeded by no more."""

_DUAL = 1e-9
"""Dual residual at the end, as a share of the largest of its terms; rounding leaves up to 1e-9 of it."""

_FIRST_SLACK = 0.3
"""Least distance from a bound to begin with, in the bounds' unit: with 0.01 there are half as many steps more."""

_FIRST_GAP = 10.0
"""Complementarity μ to begin with, likewise as a share: with 1 the longest plans take 4 to 8 steps more."""

_REGULARISATION = 1e-14
"""Proximal term of the multipliers, relative to rows and P: with less a factor may fail, more takes more steps."""

_STEP = 0.995
"""Share τ of the way to the nearest bound that a step goes."""


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
    share = cost / len(s)
    z = _FIRST_GAP * share / s
    # Where active bounds hardly differ, rounding in rowsᵀ W rows would outgrow P
    rho = _REGULARISATION * float(np.max(np.sum(rows**2, axis=0)) / np.max(np.diag(P)))
    for _ in range(STEPS_MAX):
        mu = float(s @ z) / len(s)
        primal = B @ x - b - s
        curvature, force = P @ x, B.T @ z
        dual = v - curvature + force
        largest = max(float(np.max(np.abs(term))) for term in (v, curvature, force))
        if mu < _GAP * share and np.max(np.abs(primal)) < PRIMAL_RESIDUAL and np.max(np.abs(dual)) < _DUAL * largest:
            break
        inverse = 1.0 / (s + rho * z)
        weight = z * inverse
        try:
            factor = cho_factor(P + rows.T @ ((weight[:m] + weight[m:])[:, None] * rows))
        except (LinAlgError, ValueError):
            break
        newton = _Newton(factor, B, z, inverse, primal, dual, rho)
        _, ds, dz = newton.direction(-s * z)  # predictor: as if s z = 0 could be reached at once
        reached = float((s + _room(s, ds) * ds) @ (z + _room(z, dz) * dz)) / len(s)
        centre = max(mu * (reached / mu) ** 3, 0.1 * _GAP * share)  # σ μ
        dx, ds, dz = newton.direction(centre - s * z - ds * dz)  # corrector, with the predictor's curvature
        along_s, along_z = (1.0 if room >= 1.0 else _STEP * room for room in (_room(s, ds), _room(z, dz)))
        x, s, z = x + along_s * dx, s + along_s * ds, z + along_z * dz
    return np.asarray(x)


@dataclass(frozen=True)
class _Newton:
    """Newton's equations of a step: ``P dx − Bᵀ dz = dual``, ``ds = B dx + primal + ρ dz``, ``z ds + s dz = wanted``.

    Attributes
    ----------
    factor : tuple
        Of ``P + Bᵀ diag(z · inverse) B``, from :func:`scipy.linalg.cho_factor`.
    inverse : (2m,) array
        ``1 / (s + ρ z)``.
    """

    factor: tuple[Array, bool]
    B: Array
    z: Array
    inverse: Array
    primal: Array
    dual: Array
    rho: float

    def direction(self, wanted: Array) -> tuple[Array, Array, Array]:
        """Return ``dx, ds, dz``."""
        right = self.dual + self.B.T @ ((wanted - self.z * self.primal) * self.inverse)
        dx = np.asarray(cho_solve(self.factor, right, check_finite=False))  # the caller looks at the result
        off = self.B @ dx + self.primal
        dz = (wanted - self.z * off) * self.inverse
        return dx, off + self.rho * dz, dz


def _room(s: Array, ds: Array) -> float:
    """Return the largest step, at most 1, with which ``s`` stays ≥ 0."""
    shrinking = ds < 0
    return float(min(1.0, np.min(-s[shrinking] / ds[shrinking], initial=1.0)))
