"""Drive limits as linear inequality constraints on a plan's coefficients, and the quadratic programme under them.

Rows are normalised by their limits. The remainder of the last plan is always feasible: it kept the limits when it was
made. Where ``x_d`` itself exceeds a limit, the bound is relaxed to the remainder's value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from ..base.settings import Limits
from ..base.signals import Array
from .interior import EXACT, Ending, Minimum, Tolerance, minimise
from .splines import N_DECIDED, PlanCost, SplineBasis

__all__ = ["Bounds", "DriveBounds", "solve", "solve_again"]

_ROUNDING = 1e-9
"""Tolerance for rounding, as a share of a limit: bounds are tightened by it; rows that change by less do not bind."""

_INTERIOR = 1e-10
"""Width of the feasible interval, as a share of a limit, where the last plan lies on a bound: an interior-point method
needs an interior."""

_MOVES = 1e-12
"""Smallest step of the commanded position that counts as motion, m per sample: above its rounding."""


@dataclass(frozen=True)
class Bounds:
    """Linear inequality constraints ``low ≤ rows @ c ≤ high`` on the coefficients, normalised by the limits.

    Attributes
    ----------
    rows : (m, n) array, 1/m
    low, high : (m,) arrays
        Hard bounds.
    """

    rows: Array
    low: Array
    high: Array

    def allow(self, c: Array) -> bool:
        """Return whether the coefficients are feasible."""
        values = self.rows @ c
        return bool(np.all(values >= self.low) and np.all(values <= self.high))

    def step(self, start: Array, c: Array) -> float:
        """Return the largest feasible step length, 0 … 1, from feasible coefficients ``start`` towards ``c``."""
        here, step = self.rows @ start, self.rows @ (c - start)
        margin = np.where(step > 0, self.high - here, here - self.low)
        beyond = np.abs(step) > np.maximum(margin, _ROUNDING)
        return float(np.min(margin[beyond] / np.abs(step[beyond]), initial=1.0))


class DriveBounds:
    """Limits on velocity, acceleration and jerk of ``x_dm``, taken as differences, and on ``|δ|``.

    Parameters
    ----------
    basis : SplineBasis
    T_s : float
        Sampling interval, s.
    limits : Limits or None
        The drive's velocity, acceleration and jerk.
    change_max : float or None
        Bound on ``|δ|``, m.
    no_reversal : bool
        Whether the velocity of ``x_dm``, if it is limited, keeps the sign of the velocity of ``x_d`` where ``x_d``
        moves.
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
        self._no_reversal = no_reversal
        self._scales: list[tuple[int, float]] = []
        if limits is not None:
            bounds = limits.velocity * T_s, limits.acceleration * T_s**2, limits.jerk * T_s**3
            self._scales += list(enumerate(bounds, start=1))
        if change_max is not None:
            self._scales.append((0, change_max))
        extended = np.concatenate((np.zeros((3, basis.values.shape[1])), basis.values))
        parts = [np.diff(extended, order, axis=0)[3 - order :] / bound for order, bound in self._scales]
        self._all = np.concatenate(parts) if parts else np.zeros((0, basis.values.shape[1]))
        self._free = np.ascontiguousarray(self._all[:, N_DECIDED:])

    def bounds(
        self, x_d: Array, x_d_before: Array, delta_before: Array, rest: Array, *, may_turn: bool = False
    ) -> Bounds:
        """Return the bounds on the free coefficients of a plan.

        Parameters
        ----------
        x_d : (preview,) array, m
            Commanded positions.
        x_d_before, delta_before : (3,) arrays, m
            Last three commanded positions before the plan, and last three changes of them.
        rest : (3 + n_free,) array, m
            Coefficients of the remainder of the last plan, the decided ones first.
        may_turn : bool
            Whether the command may turn where ``no_reversal`` forbids it: the plan's model follows the friction.
        """
        past = np.concatenate((delta_before, np.zeros(len(x_d))))
        command = np.concatenate((x_d_before, x_d)) + past
        offsets = [
            np.diff(past if order == 0 else command, order)[3 - order :] / bound for order, bound in self._scales
        ]
        offset = np.concatenate(offsets) if offsets else np.zeros(0)
        offset = offset + self._all[:, :N_DECIDED] @ rest[:N_DECIDED]
        at_rest = self._free @ rest[N_DECIDED:]
        most = np.full(len(offset), 1.0 - _ROUNDING)
        least = -most
        if self._no_reversal and not may_turn:
            steps, n = np.diff(x_d, prepend=x_d_before[-1]), len(x_d)
            for i, (order, _) in enumerate(self._scales):
                if order == 1:
                    least[i * n : (i + 1) * n][steps > _MOVES] = 0.0
                    most[i * n : (i + 1) * n][steps < -_MOVES] = 0.0
        low, high = np.minimum(least - offset, at_rest - _INTERIOR), np.maximum(most - offset, at_rest + _INTERIOR)
        return Bounds(rows=self._free, low=low, high=high)


def solve(
    cost: PlanCost,
    bounds: Bounds,
    rest: Array,
    n_pinned: int,
    *,
    always: bool = False,
    tolerance: Tolerance = EXACT,
) -> Minimum | None:
    """Return the minimiser of the cost within the bounds.

    The unconstrained minimiser if it is feasible. Otherwise the first ``n_pinned`` coefficients stay as they are in
    ``rest``: a real-time implementation solves for the others while the pinned ones act.

    Parameters
    ----------
    cost : PlanCost
    bounds : Bounds
    rest : (n,) array, m
        Feasible coefficients.
    n_pinned : int
        Coefficients that a bounded plan does not change, < n.
    always : bool
        Whether no plan changes them.
    tolerance : Tolerance
        Of the interior-point solver, where the bounds are active.

    Returns
    -------
    Minimum or None
        ``(n,)``, m; None if there is no finite minimiser.
    """
    n_kept = n_pinned if always else 0
    c = _unbounded(cost, rest, n_kept)
    if c is None:
        return None
    if bounds.allow(c):
        return Minimum(c, 0)
    return _bounded(cost, bounds, rest, n_pinned, rest, _cost_scale(cost, c, rest, n_kept), tolerance)


def solve_again(
    cost: PlanCost,
    bounds: Bounds,
    rest: Array,
    n_pinned: int,
    start: Array,
    last: Ending,
    tolerance: Tolerance,
) -> Minimum:
    """Return the minimiser of a cost near that of the last plan, which the same bounds bound.

    Parameters
    ----------
    cost, bounds, rest, n_pinned, tolerance
        As in :func:`solve`, with ``always``.
    start : (n,) array, m
        Where the last plan ended.
    last : Ending
        Of the last plan.
    """
    return _bounded(cost, bounds, rest, n_pinned, start, last, tolerance)


def _unbounded(cost: PlanCost, rest: Array, n_pinned: int) -> Array | None:
    """Return the minimiser of the cost, ``(n,)``, m, with the first ``n_pinned`` coefficients as in ``rest``."""
    left = cost.without(rest[:n_pinned])
    try:
        c = np.asarray(cho_solve(cho_factor(left.P), left.v))
    except (LinAlgError, ValueError):
        return None
    return np.concatenate((rest[:n_pinned], c)) if np.isfinite(c).all() else None


def _cost_scale(cost: PlanCost, c: Array, rest: Array, n_pinned: int) -> float:
    """Return the scale of the cost, m², between ``rest`` and its minimiser of :func:`_unbounded`."""
    left, at_rest = cost.without(rest[:n_pinned]), rest[n_pinned:]
    return float(left.v @ c[n_pinned:] + at_rest @ left.P @ at_rest)


def _bounded(
    cost: PlanCost,
    bounds: Bounds,
    rest: Array,
    n_pinned: int,
    start: Array,
    scale: float | Ending,
    tolerance: Tolerance,
) -> Minimum:
    """Return the minimiser of the cost within the bounds, as far as it is feasible from ``rest``, and solver steps.

    Parameters
    ----------
    cost, bounds, rest, n_pinned, tolerance
        As in :func:`solve`.
    start : (n,) array, m
        Initial iterate.
    scale : float or Ending
        :func:`_cost_scale`, m², or the end of a programme that is nearly the same.
    """
    pinned, problem = rest[:n_pinned], cost.without(rest[:n_pinned])
    rows, taken = bounds.rows[:, n_pinned:], bounds.rows[:, :n_pinned] @ pinned
    touched = rows.any(axis=1)
    found = minimise(
        problem.P,
        problem.v,
        rows[touched],
        (bounds.low - taken)[touched] + tolerance.margin,
        (bounds.high - taken)[touched] - tolerance.margin,
        start[n_pinned:],
        scale,
        tolerance,
    )
    assert found.ending is not None
    inner = found.ending.inner
    start = rest if inner is None else np.concatenate((pinned, inner))
    best = np.concatenate((pinned, found.x))
    if not np.isfinite(best).all():
        return found._replace(x=rest)
    # Bounds that are exceeded, as steps are limited, are so by little
    return found._replace(x=start + bounds.step(start, best) * (best - start))
