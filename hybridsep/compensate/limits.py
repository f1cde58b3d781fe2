"""Limits of the drive, as linear inequality constraints on a plan's coefficients.

Rows are normalised by their limits. The remainder of the last plan is always feasible: it kept the limits when it was
made. Near where ``x_d`` itself exceeds a limit, as a command does that is held or rounded, the limit widens by that.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from ..base.settings import Limits
from ..base.signals import Array, first_differences
from .splines import N_DECIDED, SplineBasis

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
    """Linear inequality constraints ``low ≤ rows @ c ≤ high`` on a change ``c`` of a plan, normalised by the limits."""

    rows: Array  # (m, n), 1/m
    # (m,): hard bounds
    low: Array
    high: Array

    def by(self, splines: Array) -> "Bounds":
        """Return the constraints on a change by sums of splines, ``(n, m)``."""
        return Bounds(self.rows @ splines, self.low, self.high)

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
        self._no_reversal, self._near = no_reversal and limits is not None, 4 * basis.spacing
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

    def shares(self, spacing: int) -> list[float]:
        """Return what differences of coefficients, of orders 1 to 3, take of the limits, 1/m; 1 without limits."""
        bounds = dict(self._scales)
        return [1.0 / (float(spacing) ** order * bounds[order]) if 1 in bounds else 1.0 for order in (1, 2, 3)]

    def bounds(
        self,
        x_d: Array,
        x_d_before: Array,
        delta_before: Array,
        previous_plan: Array,
        *,
        turns: int = 0,
        change: float = 1.0,
    ) -> Bounds:
        """Return the bounds on a change of the remainder of the last plan by free coefficients.

        ``x_d``: (horizon,), m: commanded positions. Within the length of a spline of where they exceed a limit, it is
        widened by what they take of it; ``x_d_before``, ``delta_before``: (3,), m: the last three before them, and of
        their changes; ``previous_plan``: (3 + n_free,), m: coefficients of the last plan's remainder, decided ones
        first; ``turns``: first samples in which it may turn in spite of ``no_reversal``; ``change``: of ``change_max``.
        """
        low, high = self.hard(x_d, x_d_before, delta_before, turns=turns, change=change)
        taken = self._all @ previous_plan
        return Bounds(self._free, np.minimum(low - taken, -_INTERIOR), np.maximum(high - taken, _INTERIOR))

    def hard(
        self, x_d: Array, x_d_before: Array, delta_before: Array, *, turns: int = 0, change: float = 1.0
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
        if self._no_reversal:  # the velocity's rows are the first
            steps = first_differences(x_d, x_d_before[-1])[turns:]
            least[turns : len(x_d)][steps > _MOVES] = 0.0
            most[turns : len(x_d)][steps < -_MOVES] = 0.0
        return least - offset, most - offset

    def _own(self, x_d: Array, before: Array, order: int, bound: float) -> Array:
        """Return differences of ``x_d``, of an order ≥ 1, in limits, near those that exceed it; 0 elsewhere."""
        if order == 0:
            return np.zeros(len(x_d))
        own = np.diff(np.concatenate((before, x_d)), order)[3 - order :] / bound
        width = 2 * self._near + 1
        return np.where(maximum_filter1d(np.abs(own), width, mode="constant") > _EXCEEDED, own, 0.0)
