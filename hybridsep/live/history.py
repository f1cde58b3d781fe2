"""Last rows of a run, and the part of them that a line has pixels for."""

from __future__ import annotations

import numpy as np

from ..base.signals import Array

__all__ = ["History", "drawn"]

CAPACITY = 200_000
"""Rows that are kept: three minutes at 1 kHz, in some 30 MB."""


class History:
    """Last rows, contiguous.

    Parameters
    ----------
    n_columns : int
        The first one is the time, which increases.
    capacity : int
        Rows that are kept at least, once there are as many.

    Attributes
    ----------
    n : int
        Rows that ever came.
    """

    def __init__(self, n_columns: int, capacity: int = CAPACITY) -> None:
        self._rows: Array = np.empty((2 * capacity, n_columns))
        self._capacity, self._end, self.n = capacity, 0, 0

    def append(self, rows: Array) -> None:
        """Append ``(m, n_columns)`` rows."""
        self.n += len(rows)
        rows = rows[-self._capacity :]
        if self._end + len(rows) > len(self._rows):
            kept = self._rows[self._end - self._capacity + len(rows) : self._end].copy()
            self._rows[: len(kept)] = kept
            self._end = len(kept)
        self._rows[self._end : self._end + len(rows)] = rows
        self._end += len(rows)

    def last(self, n: int) -> tuple[Array, int]:
        """Return the last ``n`` rows, or as many as there are, and the number of the first of them."""
        n = min(n, self._end)
        return self._rows[self._end - n : self._end], self.n - n

    def between(self, start: float, end: float) -> tuple[Array, int]:
        """Return the rows with times from ``start`` to ``end``, and one more on either side."""
        t = self._rows[: self._end, 0]
        first = max(int(np.searchsorted(t, start)) - 1, 0)
        beyond = int(np.searchsorted(t, end, side="right")) + 1
        return self._rows[first : min(beyond, self._end)], self.n - self._end + first


def drawn(rows: Array, first: int, columns: int) -> Array:
    """Return rows of which each column keeps its extremes, in their order, for a line of so many pixels.

    Stretches are of equal length and begin at multiples of it, so that a line that moves does not flicker.

    Parameters
    ----------
    rows : (n, m) array
        The first column is the time.
    first : int
        Number of the first row.
    columns : int
        Columns of pixels.

    Returns
    -------
    (k, m) array
        Two rows a stretch, or all where there are at most two rows for each pixel.
    """
    if len(rows) <= 2 * columns:
        return rows
    length = -(-len(rows) // columns)
    begin = -first % length
    count = (len(rows) - begin) // length
    stretches = rows[begin : begin + count * length].reshape(count, length, -1)
    missing = np.isnan(stretches)
    lowest = np.where(missing, np.inf, stretches).argmin(axis=1)
    highest = np.where(missing, -np.inf, stretches).argmax(axis=1)
    places = np.stack((np.minimum(lowest, highest), np.maximum(lowest, highest)), axis=1)
    places[:, 0, 0], places[:, 1, 0] = 0, length // 2  # the time
    found: Array = np.take_along_axis(stretches, places, axis=1).reshape(2 * count, -1)
    return found
