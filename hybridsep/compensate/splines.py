"""Cubic B-spline basis of the change of the command, and the quadratic cost of a plan.

``δ(k) = Σ_j c_j B(k/spacing − j)`` on a uniform knot grid that continues from window to window. ``B`` is non-zero over
four knot intervals, so three splines that began before a plan overlap it, with coefficients that are already decided.
The last spline ends four samples before the plan does: after the plan the command is ``x_d`` itself, in position and
in its first three differences.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import BSpline
from scipy.signal import lfilter

from ..base.settings import PLAN_END
from ..base.signals import Array

N_DECIDED = 3  # cubic splines that began before a plan and overlap it
_END = PLAN_END  # the settings', which C has among the constants of splines

_LEAST = 0.1
"""Weight of the last error of a plan of the averaged model: from the middle of the plan on the weights fall to it. A
plan returns to the command at its end, which takes long within the limits of a fast motion, and its end is never
carried out. Errors that count in full there leave a slow servo four times the error; with errors that do not count,
plans on a model with zeros in the right half plane grow where the preview is short."""

_RIDGE = 1e-12
"""Added to the diagonal of a plan's cost, relative to its largest entry: rounding cannot leave it indefinite."""


def solved_splines(n: int, window: int) -> Array:
    """Return the splines that a plan of the averaged model is solved for, ``(n, m)``, as sums of ``n`` free ones.

    The splines of the first two windows, in which the plan acts or is pinned next, are free ones; after them knots are
    twice, and after four windows four times as far apart. What is planned there is planned again, with closer knots,
    before it acts, and goes on as it is until then: a plan changes the last one by these splines.

    ``n``: splines that a plan may change, from the first one that is not pinned on; ``window``: splines that begin in a
    window, which count as 4 at least.
    """
    two_scale = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 8.0  # a cubic spline by those with half its knot interval
    columns, begin, sums, window = [], 0, np.ones(1), max(window, 4)
    for apart, end in ((1, 2 * window), (2, 4 * window), (4, n)):
        while begin < end and begin + len(sums) <= n:
            columns.append(np.pad(sums, (begin, n - begin - len(sums))))
            begin += apart
        begin -= 4 * apart  # the next ones overlap
        sums = np.convolve(np.kron(sums, (1.0, 0.0))[: 2 * len(sums) - 1], two_scale)
    return np.column_stack(columns)


@dataclass(frozen=True)
class PlanCost:
    """Quadratic cost ``½ cᵀ P c − vᵀ c`` of a change of the last plan: half its sum of squares up to a constant."""

    P: Array  # (n, n)
    v: Array  # (n,), m

    def regular(self) -> "PlanCost":
        """Return the cost with ``P``, which is changed, made positive definite."""
        self.P[np.diag_indices_from(self.P)] += _RIDGE * np.max(np.diag(self.P))
        return self

    def by(self, splines: Array) -> "PlanCost":
        """Return the cost of a change by sums of splines, ``(n, m)``."""
        return PlanCost(splines.T @ self.P @ splines, splines.T @ self.v)


class SplineBasis:
    """B-spline basis of one plan.

    ``horizon``: samples of the plan; ``spacing``: samples between knots; ``Np``: samples of the window that begins
    the plan: all of them count alike.
    """

    def __init__(self, horizon: int, spacing: int, Np: int) -> None:
        width = 4 * spacing
        self.horizon, self.spacing = horizon, spacing
        begin = max(Np, horizon // 2)
        falling = np.arange(horizon - begin, 0, -1) / (horizon - begin + 1)
        self.weight: Array = np.concatenate((np.ones(begin), np.maximum(_LEAST, falling)))
        self.n_free = (horizon - width - _END) // spacing + 1
        spline = np.asarray(BSpline.basis_element(np.arange(5))(np.arange(width) / spacing))
        self._spline: Array = np.pad(spline, (0, horizon - width))
        self.values = self.acting(horizon, self.n_free)
        # Differences over the plan; the three samples before it enter by `before`
        self.third: Array = np.diff(np.pad(self.values, ((3, 0), (0, 0))), 3, axis=0)

    def acting(self, samples: int, n: int) -> Array:
        """Return the tails of the splines at −3, −2, −1 spacings and ``n`` that begin in it, ``(samples, 3 + n)``."""
        spacing, spline = self.spacing, np.pad(self._spline[: 4 * self.spacing], (0, samples))
        tails = [spline[i * spacing : samples + i * spacing] for i in (3, 2, 1)]
        return np.column_stack((*tails, _shifts(spline[:samples], n, spacing)))

    def filtered(self, g: Array) -> Array:
        """Return the free splines filtered by the impulse response ``g``, ``(horizon, n_free)``."""
        # Time-invariance: one spline is filtered, the others are its shifts
        return _shifts(np.asarray(lfilter(g, [1.0], self._spline)), self.n_free, self.spacing)

    def cost(
        self,
        g: Array,
        free: Array,
        x_d: Array,
        plan: Array,
        before: Array,
        jerk_weight: float,
        weight: Array | None = None,
    ) -> PlanCost:
        """Return ``‖weight (x_d − G (x_d + δ) − free)‖² + jerk_weight·‖D³ δ‖²`` as a function of a change of a plan.

        ``g``, ``free``: (horizon,): first column of ``G``, and the free response, m; eq. (3); ``x_d``: (horizon,), m:
        commanded positions; ``plan``: (3 + n_free,), m: its coefficients, of which the decided ones do not change, as
        the remainder of the last plan has them; ``before``: (3,), m: last three values of δ;
        ``jerk_weight``: weight of the third differences; ``weight``: (horizon,): of the errors; all count alike
        without it.
        """
        delta = self.values @ plan
        # Eq. (3): x_d − G (x_d + δ) − free
        target = x_d - free - np.asarray(lfilter(g, [1.0], x_d + delta))
        third = np.diff(np.concatenate((before, delta)), 3)
        W, D = self.filtered(g), self.third[:, N_DECIDED:]
        if weight is not None:
            W, target = weight[:, None] * W, weight * target
        P = W.T @ W + jerk_weight * (D.T @ D)
        return PlanCost(P, W.T @ target - jerk_weight * (D.T @ third))


def _shifts(samples: Array, n: int, spacing: int) -> Array:
    """Return ``samples`` delayed by 0, spacing, 2·spacing … as ``n`` columns of the same length."""
    windows = sliding_window_view(np.concatenate((np.zeros(n * spacing), samples)), len(samples))
    return np.ascontiguousarray(windows[n * spacing - spacing * np.arange(n)].T)
