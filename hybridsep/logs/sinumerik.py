"""Traces of SINUMERIK Operate as XML ("SINUMERIK Solution Line Trace").

How signals and their sample rates are chosen is described in Siemens' "SINUMERIK Operate Commissioning Manual", section
"Trace". A file declares each signal with an ``interval`` and a ``datapointCount``, and has a ``rec`` for each time. A
value that is as before is left out there, and a ``rec`` with none as well, so that a signal's samples are one in each
interval from its first value on, each the last one written.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from ..base.errors import LogError, brief, listed
from ..base.signals import Array
from .sinumerik_xml import Record, Signal, TraceXml
from .source import Block, Channel, Source, sample_number

__all__ = ["SinumerikSource"]

_ROOT = b"<traceSession"

_COMMANDED = re.compile(r"cmdpos|despos", re.IGNORECASE)
_MEASURED = (re.compile(r"actpos", re.IGNORECASE), re.compile(r"measpos", re.IGNORECASE))
"""Names of the signals of positions, the measured ones by precedence."""


class SinumerikSource(Source):
    """The signals of a trace, by the last part of their address and the axis: ``nckServoDataCmdPos2ndEnc64|7``.

    Without a choice, the first axis with a commanded and a measured position is read. Positions are in millimetres
    unless a unit is given: the file does not tell linear axes from rotary ones.
    """

    format = "SINUMERIK trace XML"
    endings = (".xml",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        trace, starts = TraceXml(path), dict[str, float]()
        for records in trace.records():
            for record in records:
                for key in record.values:
                    starts.setdefault(key, record.t)
            if trace.signals and len(starts) >= len(trace.signals):
                break
        if not trace.signals:
            raise LogError(f"{path}: no signals (traceData, dataFrame, dataSignal) were found")
        self._signals: dict[str, Signal] = {}
        for signal in trace.signals:
            name = f"{signal.name}|{signal.axis}" if signal.axis else signal.name
            while name in self._signals:
                name += "'"
            self._signals[name] = signal
        self._clocks: dict[str, tuple[float, float]] = {}
        self.times = {
            name: self._clock_of(starts[signal.id], signal.interval)
            for name, signal in self._signals.items()
            if signal.id in starts
        }
        self.names = [*self._signals, *self._clocks]
        self.units = dict.fromkeys(self._clocks, "s")
        self.assumed_units = {name: "mm" for name, signal in self._signals.items() if signal.kind == "posn"}
        self._axes = self._positions()
        self.axes = list(self._axes)
        if self._axes:
            first = next(iter(self._axes))
            self.choose_axis(first)
            if len(self._axes) > 1:
                self.remarks = [f"axis {first} of {', '.join(self._axes)} is read; axis='…' (--axis) chooses another"]

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is XML with a trace session near its beginning."""
        return head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<") and _ROOT in head

    def channels(self) -> list[Channel]:
        """Return the columns with what the file says of them."""
        known = self._signals
        return [
            replace(one, n_samples=known[one.name].n, interval=known[one.name].interval) if one.name in known else one
            for one in super().channels()
        ]

    def choose_axis(self, axis: str) -> None:
        """Choose an axis by its number in the signals' addresses."""
        if axis not in self._axes:
            raise LogError(
                f"{self.path}: axis {brief(axis)} is missing; a commanded and a measured position are there for "
                f"{listed(list(self._axes), str)}"
            )
        x_d, x = self._axes[axis]
        self.roles = {"x_d": x_d, "x": x}
        self.remarks = []

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        clocks = {self.times.get(name, name) for name in names}
        if len(clocks) > 1 or not clocks <= set(self._clocks):
            raise LogError(
                f"{self.path}: columns {listed(list(names))} are sampled at different times, or have no values"
            )
        (clock,) = clocks
        start, interval = self._clocks[clock]
        most = min(self._signals[name].n for name, own in self.times.items() if own == clock)
        held = {name: _Held(self._signals[name].id) for name in names if name != clock}
        done, last = 0, start
        for records in chain(TraceXml(self.path).records(), [None]):
            if records:
                last = records[-1].t
                for one in held.values():
                    one.extend(records, start, interval)
            # The sample of the last time may have further values only in the end
            end = min(most, math.floor((last - start) / interval + 0.5) + (records is None))
            for i in range(done, end, n):
                k = np.arange(i, min(i + n, end), dtype=np.float64)
                columns = [start + interval * k if name == clock else held[name].at(k) for name in names]
                yield Block(columns, sample_number(i))
            done = max(done, end)

    def _clock_of(self, start: float, interval: float) -> str:
        """Return the column of times with this first one and interval, a new one if there is none."""
        for name, clock in self._clocks.items():
            if clock == (start, interval):
                return name
        name = "time" if not self._clocks else f"time#{len(self._clocks) + 1}"
        self._clocks[name] = (start, interval)
        return name

    def _positions(self) -> dict[str, tuple[str, str]]:
        """Return commanded and measured position by axis."""
        found: dict[str, tuple[str, str]] = {}
        for x_d, signal in self._signals.items():
            if not _COMMANDED.search(signal.name) or signal.axis in found:
                continue
            there = [
                name
                for pattern in _MEASURED
                for name, other in self._signals.items()
                if other.axis == signal.axis and pattern.search(other.name)
            ]
            if there:
                found[signal.axis] = (x_d, there[0])
        return found


class _Held:
    """Values of a signal that are held until the next one, as far as they have been read."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._k, self._values = np.empty(0), np.empty(0)

    def extend(self, records: Sequence[Record], start: float, interval: float) -> None:
        """Take the values of further records."""
        own = [(record.t, record.values[self._key]) for record in records if self._key in record.values]
        if own:
            t, values = np.array(own).T
            self._k = np.concatenate([self._k, np.rint((t - start) / interval)])
            self._values = np.concatenate([self._values, values])

    def at(self, k: Array) -> Array:
        """Return the samples of increasing numbers; earlier samples are forgotten."""
        found: Array = self._values[np.searchsorted(self._k, k, side="right") - 1]
        keep = max(int(np.searchsorted(self._k, k[-1], side="right")) - 1, 0)
        self._k, self._values = self._k[keep:], self._values[keep:]
        return found
