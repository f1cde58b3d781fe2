"""Black-box ARX model of the servo error on the columns of a log: minimum-norm least squares, free run, bridged gaps.

``y(k) = Σ a_i y(k−i) + Σ b_j [x_d(k−j) − x_d(k−j−1)] + c`` with ``y = x − x_d``, ``i = 1 … n``, ``j = 0 … n``. A peer
that the hybrid model is judged by, it shares no code with it.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrcon
from scipy.signal import lfilter, lfiltic

from ..base.signals import Array

__all__ = ["ArxRun", "MinimumNorm"]

_BLOCK = 4096
"""Rows that are factorised at once."""


class MinimumNorm:
    """Minimum-norm least squares of rows that arrive in blocks; what is kept, a triangular factor, does not grow.

    Parameters
    ----------
    n_columns : int
        Regressors.
    """

    def __init__(self, n_columns: int) -> None:
        self._n_columns = n_columns
        self._R, self._n_rows = np.zeros((0, n_columns + 1)), 0

    def add(self, rows: Array) -> None:
        """Add rows of regressors, the target in the last column, ``(m, n_columns + 1)``."""
        for i in range(0, len(rows), _BLOCK):
            self._R = np.asarray(np.linalg.qr(np.concatenate((self._R, rows[i : i + _BLOCK])), mode="r"))
        self._n_rows += len(rows)

    def solution(self) -> Array:
        """Return the coefficients, ``(n_columns,)``, of :func:`numpy.linalg.lstsq` with its default cut-off."""
        n = self._n_columns
        R, z = self._R[:n, :n], self._R[:n, n]
        cutoff = np.finfo(np.float64).eps * max(self._n_rows, n)
        if len(R) == n and dtrcon(R)[0] > n * cutoff:  # nothing to cut off: κ₂ ≤ n κ₁
            return np.asarray(solve_triangular(R, z))
        return np.asarray(np.linalg.lstsq(R, z, rcond=cutoff)[0])


class ArxRun:
    """Columns of a log without a gap, as an ARX model of ``n`` lags sees them.

    Parameters
    ----------
    x_d, x : (n_samples,) array, m
        Commanded and measured positions, the latter NaN where missing.
    n : int
        Lags.
    delay : int
        Samples by which the measurements are late: ``x(k)`` is the position at ``k − delay``.
    """

    def __init__(self, x_d: Array, x: Array, n: int, delay: int = 0) -> None:
        self.n = n
        self._delay = delay
        late = np.concatenate((x[delay:], np.full(min(delay, len(x)), np.nan)))
        self._y = late - x_d
        self._steps = np.diff(x_d, prepend=x_d[0])
        self._filled = np.concatenate((np.zeros(n), self._y))  # at rest before the first sample
        self._n_filled = 0

    def rows(self, first: int, last: int) -> Array:
        """Return the rows of samples ``first`` to ``last``, the last one not included, all of whose lags are known.

        Returns
        -------
        (m, 2 n + 3) array
            ``y(k−1) … y(k−n)``, increments ``k … k−n`` of the command, 1, and the target ``y(k)``.
        """
        n, first, last = self.n, max(first, self.n + 1), min(last, len(self._y))
        if last <= first:
            return np.empty((0, 2 * n + 3))
        y, steps = (sliding_window_view(one, n + 1)[first - n : last - n, ::-1] for one in (self._y, self._steps))
        found = np.column_stack((y[:, 1:], steps, np.ones(last - first), y[:, 0]))
        return np.asarray(found[~np.isnan(found).any(axis=1)])

    def predict(self, w: Array, begin: int, end: int) -> Array:
        """Return the prediction of ``x − x_d`` at samples ``begin`` to ``end``, made when ``begin`` is commanded.

        It is one free run from the last sample that is measured then.

        Parameters
        ----------
        w : (2 n + 2,) array
            Coefficients.
        begin, end : int
            Samples; ``begin`` never falls from call to call.
        """
        known = max(begin - self._delay, 0)
        self._bridge(w, known)
        return self._free_run(w, known, end)[begin - known :]

    def _bridge(self, w: Array, end: int) -> None:
        """Fill what is missing before ``end`` by free runs from what was measured before."""
        missing = np.isnan(self._y[self._n_filled : end])
        edges = np.flatnonzero(np.diff(missing, prepend=False, append=False)) + self._n_filled
        for first, last in edges.reshape(-1, 2).tolist():
            self._filled[self.n + first : self.n + last] = self._free_run(w, first, last)
        self._n_filled = max(self._n_filled, end)

    def _free_run(self, w: Array, begin: int, end: int) -> Array:
        n = self.n
        a, b, c = w[:n], w[n:-1], w[-1]
        steps = self._steps[max(begin - n, 0) : end]
        forced = np.convolve(np.pad(steps, (end - begin + n - len(steps), 0)), b, "valid") + c
        with np.errstate(over="ignore", invalid="ignore"):  # a run that diverges is seen by its size
            denominator = np.concatenate(([1.0], -a))
            before = lfiltic([1.0], denominator, self._filled[begin : begin + n][::-1])
            return np.asarray(lfilter([1.0], denominator, forced, zi=before)[0])
