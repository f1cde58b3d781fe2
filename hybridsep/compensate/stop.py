"""Plans beyond what is known of the command, and the stops that keep the drive's limits whatever comes.

A plan may need more of the command than a controller knows ahead: an axis that lags gets the change that it needs only
where the plan need not be back at ``x_d`` soon. So after the known preview a plan takes the command to go on at its
last velocity, up to its ``horizon``. What comes may be another command. Beside each plan there is therefore a *stop*:
it shares with the plan the coefficients that are carried out before the next one, and then brings the change of the
command to a constant within the known preview. A constant change takes nothing of the limits of any command that
follows. A plan is carried out as far as it has a stop within the limits; otherwise the last stop goes on.
"""

import numpy as np

from ..base.settings import PLAN_END
from ..base.signals import Array
from .limits import ROUNDING, DriveBounds
from .splines import N_DECIDED, SplineBasis

_TRIES = 12
"""Lengths of the way from the last stop to a plan that are tried, all of it first, to a two-thousandth: with only a few
long ones, none of which had a stop, an axis stood off (``docs/experiments/2026-11-29-stops-by-bisection.md``)."""

_STILL, _MOST = 1e-12, 10.0
"""Row of the last stop's own part, in limits, below which that part does not matter there; and largest share of it:
that part is a difference of rounded numbers, and a hundred times it, window after window, amplify their rounding."""


class Stop:
    """Stops of plans, and how far plans have one.

    ``basis``, ``bounds``: of the plans; ``preview``: samples of the command that are known; ``Np``: of a window;
    ``n_pinned``: coefficients that the next plan leaves as they are.
    """

    def __init__(self, basis: SplineBasis, bounds: DriveBounds, preview: int, Np: int, n_pinned: int) -> None:
        self.n_shared = Np // basis.spacing + n_pinned
        self.rows = bounds.rows_of(basis.acting(preview, -(-preview // basis.spacing)))
        self.n = self.rows.shape[1]  # coefficients, the decided ones first
        shared, last = N_DECIDED + self.n_shared, N_DECIDED + (preview - PLAN_END) // basis.spacing - 2
        held = np.tri(self.n + 3, last)
        steps = np.diff(np.eye(shared), axis=0, prepend=0.0)  # of the coefficients: they are well conditioned
        # The least sum of squares of the differences of orders 1 to 3, in limits, after what is shared
        weights = enumerate(bounds.shares(basis.spacing), start=1)
        least = np.concatenate([share * np.diff(held, order, axis=0)[shared - order :] for order, share in weights])
        tail = -np.linalg.lstsq(least[:, shared:], least[:, :shared] @ steps, rcond=None)[0]
        self._stopping: Array = np.cumsum(np.vstack((steps, tail)), axis=0)[np.minimum(np.arange(self.n), last - 1)]

    def carried_out(self, plan: Array, old: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Return what of a plan may be carried out, and its stop: coefficients, m, the decided ones first.

        ``plan``: (3 + n_free,), m; ``old``: (n,), m: last stop; ``low``, ``high``: (m,): of :meth:`DriveBounds.hard`
        over the known preview.
        """
        n = N_DECIDED + self.n_shared
        own_part = old - self._stopping @ old[:n]
        start, own = self.rows @ (self._stopping @ old[:n]), self.rows @ own_part
        low, high = np.minimum(low, start + own) - ROUNDING, np.maximum(high, start + own) + ROUNDING
        way = self.rows @ (self._stopping @ plan[:n]) - start
        # Lengths and shares that keep all bounds are a convex set with the last stop in it: the longest by bisection
        length, share, too_long, tried = 0.0, 1.0, 1.0, 1.0
        for _ in range(_TRIES):
            found = _share(start + tried * way, own, low, high)
            if found is None:
                too_long = tried
            else:
                length, share = tried, found
            if length == 1.0:
                break
            tried = 0.5 * (length + too_long)
        shared = old[:n] + length * (plan[:n] - old[:n])
        stop = self._stopping @ shared + share * own_part
        if length == 1.0:
            return plan, stop
        # After what the next plan shares of it, too, the change fades, and ends with the plan
        begin, end = n + self.n_shared, len(plan)
        gone = np.maximum(np.arange(end) - begin, 0) / max(end - begin, 1)
        return (1.0 - gone**3) ** 3 * stop[np.minimum(np.arange(end), self.n - 1)], stop


def _share(rows: Array, own: Array, low: Array, high: Array) -> float | None:
    """Return the share of the last stop's own part, nearest 0, with which all rows keep their bounds; None: none."""
    matters = np.abs(own) > _STILL
    if not np.all(matters | ((rows >= low) & (rows <= high))):
        return None
    to_low, to_high = (low - rows)[matters] / own[matters], (high - rows)[matters] / own[matters]
    least = float(np.max(np.minimum(to_low, to_high), initial=-_MOST))
    most = float(np.min(np.maximum(to_low, to_high), initial=_MOST))
    return min(max(0.0, least), most) if least <= most else None
