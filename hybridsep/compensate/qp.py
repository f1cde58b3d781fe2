"""Quadratic programme of a plan within the drive's limits, and its primal-dual interior-point solver.

``min ½ xᵀPx − vᵀx`` subject to ``low ≤ A x ≤ high`` is solved in a bounded number of steps by Mehrotra's
predictor-corrector method (S. Mehrotra, SIAM J. Optim. 2 (1992); J. Nocedal and S. J. Wright, *Numerical Optimization*,
2nd ed., section 16.6) with a proximal regularisation of the multipliers (M. P. Friedlander and D. Orban, Math. Prog.
Comp. 4 (2012)). The number of steps hardly grows with the number of active bounds. The C core has the same method,
spread over samples.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..base.signals import Array
from .limits import Bounds
from .splines import N_DECIDED, PlanCost

_FIRST_SLACK = 0.3  # smallest initial slack, in the bounds' unit: 0.01 takes half as many steps again

_REGULARISATION = 1e-14
"""Proximal term of the multipliers, relative to rows and P: with less a factor may fail, more takes more steps."""

_TAU = 0.995  # fraction τ of the step to the nearest bound that is taken


class Tolerance(NamedTuple):
    """Where the solver ends."""

    mu: float  # complementarity μ, as a share of the cost per bound
    dual_residual: float  # as a share of its largest term; rounding leaves up to 1e-9 of it
    # largest primal residual, in the bounds' unit: a bound is exceeded by no more, unless the steps end before. Callers
    # tighten bounds by it
    margin: float
    steps: int  # largest number of steps
    first_mu: float  # initial complementarity μ, as a share of the cost per bound


_STEPS = 24  # largest number of steps of any tolerance

EXACT = Tolerance(1e-15, 1e-9, 1e-11, _STEPS, 10.0)
"""A plan is the start of the next one, and the minimum is much better conditioned than an intermediate iterate:
differences in rounding between two implementations stay small. 12 steps on average, all in 34 of 1 399 plans."""


class Minimum(NamedTuple):
    """Minimiser of a quadratic programme."""

    x: Array  # (n,): not finite if the problem's data are not
    steps: int  # of the solver
    # (n,): iterate that was farthest inside the bounds without their margin; None if none was inside
    inner: Array | None = None


def minimise(
    P: Array, v: Array, rows: Array, low: Array, high: Array, cost: float, tolerance: Tolerance = EXACT
) -> Minimum:
    """Return the minimiser of ``½ xᵀPx − vᵀx`` subject to ``low ≤ rows @ x ≤ high``, from 0.

    ``P``: (n, n): symmetric, positive definite; ``v``: (n,); ``rows``: (m, n): in units in which a bound is about 1;
    ``low``, ``high``: (m,): ``low < high``; ``cost``: scale of the cost, > 0, for the tolerance.
    """
    # As B x ≥ b, with slacks s = B x − b > 0 and multipliers z > 0, s z → 0
    B, b = np.concatenate((rows, -rows)), np.concatenate((low, -high))
    x, m = np.zeros(len(v)), len(rows)
    s, share = np.maximum(-b, _FIRST_SLACK), cost / len(b)
    z, inner, beyond = tolerance.first_mu * share / s, None, tolerance.margin
    # Where active bounds hardly differ, rounding in rowsᵀ W rows would outgrow P. The first spline is never a wide one
    rho = _REGULARISATION * float(rows[:, 0] @ rows[:, 0] / np.max(np.diag(P)))
    steps = 0
    while True:
        mu = float(s @ z) / len(s)
        distance = B @ x - b
        if -np.min(distance) < beyond:
            inner, beyond = x, -float(np.min(distance))
        r_p = distance - s
        gradient, force = P @ x, B.T @ z
        r_d = v - gradient + force
        largest = max(float(np.max(np.abs(term))) for term in (v, gradient, force))
        feasible = np.max(np.abs(r_p)) < tolerance.margin and np.max(np.abs(r_d)) < tolerance.dual_residual * largest
        if steps == tolerance.steps or (mu < tolerance.mu * share and feasible) or mu == 0.0:  # it underflows
            break
        steps += 1
        inverse = 1.0 / (s + rho * z)
        weight = z * inverse
        try:
            factor = cho_factor(P + rows.T @ ((weight[:m] + weight[m:])[:, None] * rows))
        except (LinAlgError, ValueError):
            break
        newton = _Newton(factor, B, z, inverse, r_p, r_d, rho)
        _, ds, dz = newton.direction(-s * z)  # predictor (affine scaling): σ = 0
        mu_aff = float((s + _step_length(s, ds) * ds) @ (z + _step_length(z, dz) * dz)) / len(s)
        sigma = (mu_aff / mu) ** 3
        sigma_mu = max(sigma * mu, 0.1 * tolerance.mu * share)
        dx, ds, dz = newton.direction(sigma_mu - s * z - ds * dz)  # corrector
        lengths = _step_length(s, ds), _step_length(z, dz)
        alpha_p, alpha_d = (1.0 if alpha >= 1.0 else _TAU * alpha for alpha in lengths)
        x, s, z = x + alpha_p * dx, s + alpha_p * ds, z + alpha_d * dz
    return Minimum(x, steps, inner)


@dataclass(frozen=True)
class _Newton:
    """Newton's equations of a step: ``P dx − Bᵀ dz = r_d``, ``ds = B dx + r_p + ρ dz``, ``z ds + s dz = r_c``."""

    factor: tuple[Array, bool]  # of ``P + Bᵀ diag(z · inverse) B``, from :func:`scipy.linalg.cho_factor`
    B: Array  # (2m, n): the bounds' rows, low and high
    z: Array  # (2m,): multipliers
    inverse: Array  # (2m,): ``1 / (s + ρ z)``
    # (2m,), (n,): primal residual ``B x − b − s`` and dual residual ``v − P x + Bᵀ z``
    r_p: Array
    r_d: Array
    rho: float

    def direction(self, r_c: Array) -> tuple[Array, Array, Array]:
        """Return ``dx, ds, dz``."""
        right = self.r_d + self.B.T @ ((r_c - self.z * self.r_p) * self.inverse)
        dx = np.asarray(cho_solve(self.factor, right, check_finite=False))  # the caller looks at the result
        off = self.B @ dx + self.r_p
        dz = (r_c - self.z * off) * self.inverse
        return dx, off + self.rho * dz, dz


def _step_length(s: Array, ds: Array) -> float:
    """Return the largest step length α ≤ 1 with ``s + α ds ≥ 0``."""
    shrinking = ds < 0
    return float(min(1.0, np.min(-s[shrinking] / ds[shrinking], initial=1.0)))


def solve(cost: PlanCost, bounds: Bounds, n_pinned: int = 0, *, tolerance: Tolerance = EXACT) -> Minimum | None:
    """Return the change of least cost within the bounds, as far as it is feasible from none, and its steps.

    The unconstrained minimiser if it is feasible. Otherwise the first ``n_pinned`` coefficients, < n, do not change: a
    real-time implementation solves for the others while the pinned ones act.

    ``tolerance``: of the interior-point solver, where the bounds are active. Returns Minimum or None: ``(n,)``, m; None
    if there is no finite minimiser.
    """
    try:
        c = np.asarray(cho_solve(cho_factor(cost.P), cost.v))
    except (LinAlgError, ValueError):
        return None
    if not np.isfinite(c).all():
        return None
    rows, pinned, nothing = bounds.rows[:, n_pinned:], np.zeros(n_pinned), np.zeros_like(c)
    if bounds.step(nothing, c) == 1.0:
        return Minimum(c, 0)
    touched = rows.any(axis=1)
    found = minimise(
        cost.P[n_pinned:, n_pinned:],
        cost.v[n_pinned:],
        rows[touched],
        bounds.low[touched] + tolerance.margin,
        bounds.high[touched] - tolerance.margin,
        float(cost.v @ c),  # between no change and the minimiser
        tolerance,
    )
    start = nothing if found.inner is None else np.concatenate((pinned, found.inner))
    best = np.concatenate((pinned, found.x))
    if not np.isfinite(best).all():
        return found._replace(x=nothing)
    # Bounds that are exceeded, as steps are limited, are so by little
    return found._replace(x=start + bounds.step(start, best) * (best - start))


def solve_change(
    cost: PlanCost, bounds: Bounds, previous_plan: Array, splines: Array, n_pinned: int, tolerance: Tolerance
) -> Array | None:
    """Return the plan of least cost within the bounds that changes ``previous_plan`` by sums of splines, ``(n, m)``.

    ``cost``: of the change; ``previous_plan``: (3 + n,), m: the decided coefficients first; other parameters as of
    :func:`solve`. Returns the coefficients, ``(3 + n,)``, m; None if there is no finite minimiser.
    """
    decided, last = np.split(previous_plan, [N_DECIDED])
    found = solve(cost, bounds.by(splines), n_pinned, tolerance=tolerance)
    return None if found is None else np.concatenate((decided, last + splines @ found.x))
