"""What the page's process knows of the run."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.signals import Array
from ..logs.units import Shown
from .history import History, drawn
from .view import COLUMNS, signals, source_data

__all__ = ["State"]

_PIXELS, _PAUSED_PIXELS = 400, 2000
"""Columns of pixels that lines are drawn for, two values each: while they move, with few, as a browser without a
graphics processor must draw them ten times a second; while they rest, with as many as a screen has."""


@dataclass
class State:
    """State of a run as it is shown.

    Attributes
    ----------
    title : str
    shown : Shown
        Units.
    experts : tuple of str
    T_s : float
        Sampling interval, s; 0 before the first sample.
    delay : float
        Time by which rows are late, s.
    status : dict
        As of :meth:`~hybridsep.live.run.LiveRun`.
    phase : {"waiting", "running", "ended", "failed"}
    message : str
        Why it has failed.
    """

    title: str
    shown: Shown
    experts: tuple[str, ...] = ()
    T_s: float = 0.0
    delay: float = 0.0
    status: dict[str, Any] = field(default_factory=dict)
    phase: str = "waiting"
    message: str = ""
    _history: History | None = None

    @property
    def n(self) -> int:
        """Rows that came."""
        return 0 if self._history is None else self._history.n

    @property
    def is_over(self) -> bool:
        """Whether the run has ended."""
        return self.phase in ("ended", "failed")

    def begin(self, experts: tuple[str, ...], T_s: float, delay: int) -> None:
        """Take in what the first sample told."""
        self.experts, self.T_s, self.delay, self.phase = experts, T_s, delay * T_s, "running"
        self._history = History(len(COLUMNS) + len(experts))

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
            return self._drawn(np.zeros((1, len(COLUMNS) + len(self.experts))), 0), 0.0, span
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
        found = {"phase": self.phase, "message": self.message, "experts": self.experts, "delay": self.delay}
        return json.dumps({**found, **self.status, **now, "factor": factor, "unit": unit, "rows": self.n})

    def _drawn(self, rows: Array, first: int, columns: int = _PIXELS) -> dict[str, Any]:
        return source_data(drawn(signals(rows, self.shown), first, columns), len(self.experts))
