"""What the page's process knows of a run: its last rows, and the part of them that lines have pixels for."""

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridsep.base.signals import Array
from hybridsep.logs.units import DisplayUnits

from .core import Row

COLUMNS = ("t", "x_d", "x_meas", "x_pb", "x_h", "x_h_std", "active", "step", "k")
"""Columns of a row as the page gets it."""

_BAND = 2.0  # half width of the band in standard deviations: 95 % of the samples, if they are distributed normally

DRAWN = ("t", "x_d", "x_meas", "e_meas", "e_pb", "e_h", "e_low", "e_high", "r_pb", "r_h", "r_low", "r_high", "step")
"""Columns of :func:`signals`."""

CAPACITY = 200_000  # rows that are kept: three minutes at 1 kHz, in some 30 MB

_PIXELS, _PAUSED_PIXELS = 400, 2000
"""Columns of pixels that lines are drawn for, two values each: while they move, with few, as a browser without a
graphics processor must draw them ten times a second; while they rest, with as many as a screen has."""


class History:
    """Last rows, contiguous.

    ``n_columns``: the first one is the time, which increases; ``capacity``: rows that are kept at least, once there
    are as many. ``n``: rows that ever came.
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
    """Return rows of which each column keeps its extremes, in their order, for a line of that many pixels.

    Stretches are of equal length and begin at multiples of it, so that a line that moves does not flicker.

    ``rows``, (n, m): the first column is the time; ``first``: number of the first row; ``columns``: columns of
    pixels. Returns (k, m): two rows a stretch, or all where there are at most two rows for each pixel.
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


def table(rows: list[Row]) -> Array:
    """Return rows as an array, ``(n, len(COLUMNS))``."""
    return np.array(
        [(row.t, row.x_d, row.x_meas, row.x_pb, row.x_h, row.x_h_std, row.active, row.step, row.k) for row in rows]
    )


def signals(rows: Array, shown: DisplayUnits) -> Array:
    """Return what is drawn, ``(n, len(DRAWN))``.

    ``rows``: (n, len(COLUMNS)): as of :func:`table`; ``shown``: units.
    """
    t, x_d, x_meas, x_pb, x_h, std, _, step, _ = rows.T
    position, error = shown.position[0], shown.small[0]
    half = np.where(std > 0.0, _BAND * error * std, np.nan)
    hybrid, miss = error * (x_h - x_d), error * (x_meas - x_h)
    return np.column_stack(
        (
            *(t, position * x_d, position * x_meas),
            *(error * (x_meas - x_d), error * (x_pb - x_d), hybrid, hybrid - half, hybrid + half),
            *(error * (x_meas - x_pb), miss, -half, half),
            1e6 * step,
        )
    )


@dataclass
class State:
    """State of a run as it is shown."""

    title: str
    shown: DisplayUnits  # units
    T_s: float = 0.0  # sampling interval, s; 0 before the first sample
    delay: float = 0.0  # time by which rows are late, s
    status: dict[str, Any] = field(default_factory=dict)  # as of :class:`~hybridsep_live.run.LiveRun`
    phase: str = "waiting"  # {"waiting", "running", "ended", "failed"}
    message: str = ""  # why it has failed
    _history: History | None = None

    @property
    def n(self) -> int:
        """Rows that came."""
        return 0 if self._history is None else self._history.n

    @property
    def is_over(self) -> bool:
        """Whether the run has ended."""
        return self.phase in ("ended", "failed")

    def begin(self, T_s: float, delay: int) -> None:
        """Take in what the first sample told."""
        self.T_s, self.delay, self.phase = T_s, delay * T_s, "running"
        self._history = History(len(COLUMNS))

    def take(self, rows: Array, status: dict[str, Any]) -> None:
        """Take in rows, and how the run is."""
        if self._history is not None:
            self._history.append(rows)
        self.status = status

    def end(self, message: str) -> None:
        """Take in that the run is over."""
        self.phase, self.message = "failed" if message else "ended", message

    def latest(self, span: float) -> tuple[dict[str, Any], float, float]:
        """Return what is drawn of the last ``span`` s, and from when to when it is."""
        if self._history is None or self.n == 0:
            # One row of zeros: of none the browser's console says that there is nothing to scale by
            return self._drawn(np.zeros((1, len(COLUMNS))), 0), 0.0, span
        found = self._history.last(round(span / self.T_s) + 1)
        end = float(found[0][-1, 0])
        return self._drawn(*found), end - span, end

    def between(self, start: float, end: float) -> dict[str, Any]:
        """Return what is drawn at rest from ``start`` to ``end``, s."""
        if self._history is None:
            return self.latest(0.0)[0]
        return self._drawn(*self._history.between(start, end), _PAUSED_PIXELS)

    def words(self) -> str:
        """Return the status as JSON."""
        now: dict[str, Any] = {}
        if self._history is not None and self.n:
            last = self._history.last(1)[0][0]
            now = {"t": float(last[0]), "active": bool(last[COLUMNS.index("active")])}
        factor, unit = self.shown.small
        found = {"phase": self.phase, "message": self.message, "delay": self.delay}
        return json.dumps({**found, **self.status, **now, "factor": factor, "unit": unit, "rows": self.n})

    def _drawn(self, rows: Array, first: int, columns: int = _PIXELS) -> dict[str, Any]:
        """Return columns as the page's source takes them: single precision but for the time."""
        found = dict(zip(DRAWN, drawn(signals(rows, self.shown), first, columns).T, strict=True))
        return {name: column.copy() if name == "t" else column.astype(np.float32) for name, column in found.items()}
