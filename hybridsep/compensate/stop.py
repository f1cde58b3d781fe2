"""Plans beyond what is known of the command, and the stops that keep the drive's limits whatever comes.

A plan may need more of the command than a controller knows ahead: an axis that lags gets the change that it needs only
where the plan need not be back at ``x_d`` soon. So behind the known preview a plan takes the command to go on at its
last velocity, up to its ``horizon``. What comes may be another command. Beside each plan there is therefore a *stop*:
it shares with the plan the coefficients that are carried out before the next one, and then brings the change of the
command to a constant within the known preview. A constant change takes nothing of the limits of any command that
follows. A plan is carried out as far as it has a stop within the limits; otherwise the last stop goes on.
"""

import math

import numpy as np

from ..base.settings import PLAN_END
from ..base.signals import Array
from .qp import ROUNDING, DriveBounds
from .splines import N_DECIDED, SplineBasis

_TRIES, _SHORTER = 8, 0.8
"""Lengths of the way from the last stop to a plan that are tried, and their ratio."""

_FADE = 10.0
"""Time constants, in a horizon, with which the change fades behind a plan that has no stop."""

_STILL = 1e-12
"""Row of the last stop's own part, in limits, below which that part does not matter."""


class Stop:
    """Stop of the last plan, and what takes plans to theirs.

    ``basis``, ``bounds``: of the plans; ``preview``: samples of the command that are known; ``Np``: of a window;
    ``n_pinned``: coefficients that the next plan leaves as they are.
    """

    def __init__(self, basis: SplineBasis, bounds: DriveBounds, preview: int, Np: int, n_pinned: int) -> None:
        self.preview, self.spacing, self._horizon = preview, basis.spacing, basis.preview
        self.n_shared = Np // basis.spacing + n_pinned
        self._n_free = (preview - PLAN_END) // basis.spacing - 2  # from there on all coefficients are alike
        self.rows = bounds.rows_of(basis.shifted(preview))
        self._gains = self._optimal(bounds.shares(basis.spacing))
        self.n = self.rows.shape[1]  # coefficients, the decided ones first

    def _optimal(self, weights: tuple[float, float, float]) -> list[tuple[float, float]]:
        """Return the gains with which the first two differences of coefficients make the next one.

        They minimise the sum of squares of the differences of orders 1 to 3, in limits, by a backward Riccati
        recursion (R. E. Kalman, Bol. Soc. Mat. Mex. 5 (1960)) from a change that is constant.
        """
        one, two, three = weights
        p11, p12, p22 = two + 2.0 * three, three, three  # of the first difference behind the last spline: it is 0
        gains = []
        for _ in range(self._n_free - self.n_shared):
            both = p12 + p22
            total = one + two + three + p11 + p12 + both
            g1, g2 = (two + three + both) / total, three / total
            gains.append((g1, g2))
            # The cost of differences x, y before: u = g1 x + g2 y, then u − x, then u − x − y
            h1 = g1 - 1.0
            p11, p12, p22 = (
                one * g1 * g1 + (two + three) * h1 * h1 + p11 * g1 * g1 + 2.0 * p12 * g1 * h1 + p22 * h1 * h1,
                one * g1 * g2
                + two * h1 * g2
                + three * h1 * (g2 - 1.0)
                + p11 * g1 * g2
                + p12 * (g1 * g2 + h1 * g2)
                + p22 * h1 * g2,
                one * g2 * g2 + two * g2 * g2 + three * (g2 - 1.0) ** 2 + (p11 + 2.0 * p12 + p22) * g2 * g2,
            )
        return gains[::-1]

    def _stopping(self, shared: Array) -> Array:
        """Return the coefficients of a stop behind decided and shared ones, m."""
        c = [*shared.tolist()]
        first = c[-1] - c[-2]
        second = first - (c[-2] - c[-3])
        for g1, g2 in self._gains:
            first, before = g1 * first + g2 * second, first
            second = first - before
            c.append(c[-1] + first)
        return np.array(c + [c[-1]] * (self.n - len(c)))

    def carried_out(self, plan: Array, old: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Return what of a plan may be carried out, and its stop: coefficients, m, the decided ones first.

        ``plan``: (3 + n_free,), m; ``old``: (n,), m: last stop; ``low``, ``high``: (m,): of :meth:`DriveBounds.hard`
        over the known preview.
        """
        n = N_DECIDED + self.n_shared
        now = self._stopping(plan[:n])
        of_old, own = self.rows @ old, self.rows @ (old - self._stopping(old[:n]))
        low, high = np.minimum(low, of_old) - ROUNDING, np.maximum(high, of_old) + ROUNDING
        start, way = of_old - own, self.rows @ now - (of_old - own)
        length = 1.0
        for _ in range(_TRIES):
            share = _share(start + length * way, own, low, high)
            if share is not None:
                break
            length *= _SHORTER
        else:
            length, share = 0.0, 1.0
        shared = old[:n] + length * (plan[:n] - old[:n])
        stop = self._stopping(shared) + share * (old - self._stopping(old[:n]))
        return (plan if length == 1.0 else self._fading(shared, len(plan))), stop

    def _fading(self, shared: Array, n: int) -> Array:
        """Return a plan that goes on behind shared coefficients by letting the change fade."""
        pole = math.exp(-_FADE * self.spacing / self._horizon)
        c = [*shared.tolist()]
        while len(c) < n:
            c.append(3.0 * pole * c[-1] - 3.0 * pole * pole * c[-2] + pole * pole * pole * c[-3])
        return np.array(c)


def _share(rows: Array, own: Array, low: Array, high: Array) -> float | None:
    """Return the share of the last stop's own part, nearest 0, with which all rows keep their bounds; None: none."""
    matters = np.abs(own) > _STILL
    if not np.all(matters | ((rows >= low) & (rows <= high))):
        return None
    to_low, to_high = (low - rows)[matters] / own[matters], (high - rows)[matters] / own[matters]
    least = float(np.max(np.minimum(to_low, to_high), initial=-np.inf))
    most = float(np.min(np.maximum(to_low, to_high), initial=np.inf))
    return min(max(0.0, least), most) if least <= most else None
