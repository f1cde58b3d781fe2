"""Quadratic programme of a plan within the drive's limits, and its primal-dual interior-point solver.

The limits are linear inequality constraints on the plan's coefficients. Rows are normalised by their limits. The
remainder of the last plan is always feasible: it kept the limits when it was made. Where ``x_d`` itself exceeds a
limit, as a command does that is held or rounded, what it takes is added to the limit.

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
from scipy.ndimage import maximum_filter1d

from ..base.settings import Limits
from ..base.signals import Array, first_differences
from .splines import N_DECIDED, PlanCost, SplineBasis

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
differences in rounding between two implementations stay small. 12 steps on average; 34 of 1 399 bounded plans with
random parameters took all of them; from a μ of 1 the longest plans take 4 to 8 more."""


class Minimum(NamedTuple):
    """Minimiser of a quadratic programme."""

    x: Array  # (n,): not finite if the problem's data are not
    steps: int  # of the solver
    # (n,): iterate that was farthest inside the bounds without their margin; None if none was inside
    inner: Array | None = None


def minimise(
    P: Array, v: Array, rows: Array, low: Array, high: Array, start: Array, cost: float, tolerance: Tolerance = EXACT
) -> Minimum:
    """Return the minimiser of ``½ xᵀPx − vᵀx`` subject to ``low ≤ rows @ x ≤ high``.

    ``P``: (n, n): symmetric, positive definite; ``v``: (n,); ``rows``: (m, n): in units in which a bound is about 1;
    ``low``, ``high``: (m,): ``low < high``; ``start``: (n,): initial iterate; ``cost``: scale of the cost, > 0, for
    the tolerance.
    """
    # As B x ≥ b, with slacks s = B x − b > 0 and multipliers z > 0, s z → 0
    B, b = np.concatenate((rows, -rows)), np.concatenate((low, -high))
    x, m = start.copy(), len(rows)
    s, share = np.maximum(B @ x - b, _FIRST_SLACK), cost / len(b)
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
    B: Array
    z: Array
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


ROUNDING = 1e-9
"""Tolerance for rounding, as a share of a limit: bounds are tightened by it; rows that change by less do not bind."""

_INTERIOR = 1e-10
"""Width of the feasible interval, as a share of a limit, where the last plan lies on a bound: an interior-point method
needs an interior."""

_EXCEEDED = 1.0 + 1e-6
"""Difference of the commanded position, in limits, that exceeds one: what is less may be rounding."""

_MOVES = 1e-12  # smallest step of the commanded position that counts as motion, m per sample: above its rounding


@dataclass(frozen=True)
class Bounds:
    """Linear inequality constraints ``low ≤ rows @ c ≤ high`` on the coefficients, normalised by the limits."""

    rows: Array  # (m, n), 1/m
    # (m,): hard bounds
    low: Array
    high: Array

    def allow(self, c: Array) -> bool:
        """Return whether the coefficients are feasible."""
        values = self.rows @ c
        return bool(np.all(values >= self.low) and np.all(values <= self.high))

    def of_change(self, plan: Array, splines: Array) -> "Bounds":
        """Return the constraints on a change of a feasible ``plan``, ``(n,)``, m, by sums of splines, ``(n, m)``."""
        here = self.rows @ plan
        return Bounds(self.rows @ splines, self.low - here, self.high - here)

    def step(self, start: Array, c: Array) -> float:
        """Return the largest feasible step length, 0 … 1, from feasible coefficients ``start`` towards ``c``."""
        here, step = self.rows @ start, self.rows @ (c - start)
        margin = np.where(step > 0, self.high - here, here - self.low)
        beyond = np.abs(step) > np.maximum(margin, ROUNDING)
        return float(np.min(margin[beyond] / np.abs(step[beyond]), initial=1.0))


class DriveBounds:
    """Limits on velocity, acceleration and jerk of ``x_dm``, taken as differences, and on ``|δ|``.

    ``T_s``: sampling interval, s; ``limits``: Limits or None: the drive's velocity, acceleration and jerk;
    ``change_max``: bound on ``|δ|``, m; ``no_reversal``: whether the velocity of ``x_dm``, if it is limited, keeps
    the sign of the velocity of ``x_d`` where ``x_d`` moves.
    """

    def __init__(
        self,
        basis: SplineBasis,
        T_s: float,
        limits: Limits | None,
        change_max: float | None,
        *,
        no_reversal: bool = False,
    ) -> None:
        self._no_reversal, self._near = no_reversal, 4 * basis.spacing
        self._scales: list[tuple[int, float]] = []
        if limits is not None:
            bounds = limits.velocity * T_s, limits.acceleration * T_s**2, limits.jerk * T_s**3
            self._scales += list(enumerate(bounds, start=1))
        if change_max is not None:
            self._scales.append((0, change_max))
        self._all = self.rows_of(basis.values)
        self._free = np.ascontiguousarray(self._all[:, N_DECIDED:])

    def rows_of(self, values: Array) -> Array:
        """Return the rows of splines with such values, ``(n, m)``, in limits: ``(number of limits · n, m)``."""
        extended = np.concatenate((np.zeros((3, values.shape[1])), values))
        parts = [np.diff(extended, order, axis=0)[3 - order :] / bound for order, bound in self._scales]
        return np.concatenate(parts) if parts else np.zeros((0, values.shape[1]))

    def shares(self, spacing: int) -> tuple[float, float, float]:
        """Return what differences of coefficients, of orders 1 to 3, take of the limits, 1/m."""
        bounds = dict(self._scales)
        if 1 not in bounds:
            return 1.0, 1.0, 1.0
        one, two, three = (1.0 / (float(spacing) ** order * bounds[order]) for order in (1, 2, 3))
        return one, two, three

    def bounds(
        self,
        x_d: Array,
        x_d_before: Array,
        delta_before: Array,
        previous_plan: Array,
        *,
        may_turn: bool = False,
        change: float = 1.0,
    ) -> Bounds:
        """Return the bounds on the free coefficients of a plan.

        ``x_d``: (preview,), m: commanded positions. Within the length of a spline of where they exceed a limit, it is
        widened by what they take of it; ``x_d_before``, ``delta_before``: (3,), m: last three commanded positions
        before the plan, and last three changes of them; ``previous_plan``: (3 + n_free,), m: coefficients of the
        remainder of the last plan, the decided ones first; ``may_turn``: whether the command may turn where
        ``no_reversal`` forbids it; ``change``: share of ``change_max`` that bounds ``|δ|``.
        """
        low, high = self.hard(x_d, x_d_before, delta_before, may_turn=may_turn, change=change)
        taken = self._all[:, :N_DECIDED] @ previous_plan[:N_DECIDED]
        at_rest = self._free @ previous_plan[N_DECIDED:]
        low, high = np.minimum(low - taken, at_rest - _INTERIOR), np.maximum(high - taken, at_rest + _INTERIOR)
        return Bounds(rows=self._free, low=low, high=high)

    def hard(
        self, x_d: Array, x_d_before: Array, delta_before: Array, *, may_turn: bool = True, change: float = 1.0
    ) -> tuple[Array, Array]:
        """Return the least and the largest rows of a change within the limits, the decided coefficients' included."""
        past = np.concatenate((delta_before, np.zeros(len(x_d))))
        command = np.concatenate((x_d_before, x_d))
        # Their sum would be rounded to what a position is, which is much coarser than a third difference of a change
        offsets = [
            (np.diff(past, order) + (np.diff(command, order) if order else 0.0))[3 - order :] / bound
            for order, bound in self._scales
        ]
        offset = np.concatenate(offsets) if offsets else np.zeros(0)
        most = np.repeat([(1.0 - ROUNDING) * (1.0 if order else change) for order, _ in self._scales], len(x_d))
        own = np.concatenate((np.zeros(0), *(self._own(x_d, x_d_before, *scale) for scale in self._scales)))
        least, most = np.minimum(own, 0.0) - most, np.maximum(own, 0.0) + most
        if self._no_reversal and not may_turn:
            steps, n = first_differences(x_d, x_d_before[-1]), len(x_d)
            for i, (order, _) in enumerate(self._scales):
                if order == 1:
                    least[i * n : (i + 1) * n][steps > _MOVES] = 0.0
                    most[i * n : (i + 1) * n][steps < -_MOVES] = 0.0
        return least - offset, most - offset

    def _own(self, x_d: Array, before: Array, order: int, bound: float) -> Array:
        """Return differences of ``x_d``, of an order ≥ 1, in limits, near those that exceed it; 0 elsewhere."""
        if order == 0:
            return np.zeros(len(x_d))
        own = np.diff(np.concatenate((before, x_d)), order)[3 - order :] / bound
        width = 2 * self._near + 1
        return np.where(maximum_filter1d(np.abs(own), width, mode="constant") > _EXCEEDED, own, 0.0)


def solve(
    cost: PlanCost, bounds: Bounds, previous_plan: Array, n_pinned: int, *, tolerance: Tolerance = EXACT
) -> Minimum | None:
    """Return the minimiser of the cost within the bounds, as far as it is feasible from the last plan, and its steps.

    The unconstrained minimiser if it is feasible. Otherwise the first ``n_pinned`` coefficients stay as they are in
    ``previous_plan``: a real-time implementation solves for the others while the pinned ones act.

    ``previous_plan``: (n,), m: feasible coefficients; ``n_pinned``: coefficients that a bounded plan does not change,
    < n; ``tolerance``: of the interior-point solver, where the bounds are active. Returns Minimum or None: ``(n,)``, m;
    None if there is no finite minimiser.
    """
    try:
        c = np.asarray(cho_solve(cho_factor(cost.P), cost.v))
    except (LinAlgError, ValueError):
        return None
    if not np.isfinite(c).all():
        return None
    if bounds.allow(c):
        return Minimum(c, 0)
    pinned = previous_plan[:n_pinned]
    rows, taken = bounds.rows[:, n_pinned:], bounds.rows[:, :n_pinned] @ pinned
    touched = rows.any(axis=1)
    found = minimise(
        cost.P[n_pinned:, n_pinned:],
        cost.v[n_pinned:] - cost.P[n_pinned:, :n_pinned] @ pinned,
        rows[touched],
        (bounds.low - taken)[touched] + tolerance.margin,
        (bounds.high - taken)[touched] - tolerance.margin,
        previous_plan[n_pinned:],
        float(cost.v @ c + previous_plan @ cost.P @ previous_plan),  # between the last plan and its minimiser
        tolerance,
    )
    start = previous_plan if found.inner is None else np.concatenate((pinned, found.inner))
    best = np.concatenate((pinned, found.x))
    if not np.isfinite(best).all():
        return found._replace(x=previous_plan)
    # Bounds that are exceeded, as steps are limited, are so by little
    return found._replace(x=start + bounds.step(start, best) * (best - start))


def solve_change(
    cost: PlanCost, bounds: Bounds, previous_plan: Array, splines: Array, tolerance: Tolerance
) -> Array | None:
    """Return the plan of least cost within the bounds that changes ``previous_plan`` by sums of splines, ``(n, m)``.

    ``cost``: of the change; ``previous_plan``: (3 + n,), m: the decided coefficients first; other parameters as of
    :func:`solve`. Returns the coefficients, ``(3 + n,)``, m; None if there is no finite minimiser.
    """
    decided, last = np.split(previous_plan, [N_DECIDED])
    found = solve(cost, bounds.of_change(last, splines), np.zeros(splines.shape[1]), 0, tolerance=tolerance)
    return None if found is None else np.concatenate((decided, last + splines @ found.x))
