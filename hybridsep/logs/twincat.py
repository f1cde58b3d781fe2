"""TwinCAT Scope's CSV export.

Its parts are described in Beckhoff's "TwinCAT 3 Scope View: Export to csv" (infosys.beckhoff.com, TE13xx): a head, rows
of what is known of each channel, each with its key before it, then a column of times before one channel (timelines
"All") or before those that are sampled alike ("For each sampletime").
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import LogError, brief
from ..base.signals import Array
from .source import Block, Channel, Source, line_number
from .text import bounded_lines, decimal_points, is_number

__all__ = ["TwinCatSource"]

_BOM = b"\xef\xbb\xbf"
_MARKS = (b"\t", b";", b",")
_NAME, _UNIT, _SAMPLE_TIME, _START = "Name", "Unit", "SampleTime[ms]", "Starttime of export"

_HEAD_LINES = 400
"""Lines in which the numbers must begin."""

_FILETIME, _TICK, _MS = 1e12, 1e-7, 1e-3
"""Times above the first are Windows file times, counted in the second, s; others in milliseconds."""


@dataclass(frozen=True)
class _Place:
    """Column: its field in a line, and the field of its times."""

    field: int
    time: int


class TwinCatSource(Source):
    """The channels of an export of TwinCAT Scope; channels that are sampled more slowly end in an earlier line.

    Where slow channels are filled with their previous value, the lines in which their time repeats are left out. The
    rows of scale factors and offsets are not applied: whether the export has scaled the values, its settings decide.
    """

    format = "TwinCAT Scope CSV"
    endings = (".csv", ".txt")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            head = file.read(16).removeprefix(_BOM)
        self._mark = head[len(_NAME) : len(_NAME) + 1].decode("latin-1")
        with self._open() as file:
            lines = list(enumerate(islice(bounded_lines(path, file), _HEAD_LINES), 1))
        rows = [(number, line.rstrip("\r\n").split(self._mark)) for number, line in lines]
        block = next((i for i, (_, row) in enumerate(rows) if i and row[0] == _NAME), None)
        if block is None:
            raise LogError(f"{path}: a row of the channels' names was expected below the head, got none")
        first = next((i for i in range(block, len(rows)) if is_number(decimal_points(rows[i][1][0]))), None)
        if first is None:
            raise LogError(f"{path}: numbers were expected below the channels' names, got none")
        self._header, self._first = rows[block][0], rows[first][0]
        self._known = {row[0]: row for _, row in rows[block:first] if row[0]}
        self._places = self._channels(rows[first])
        self._scale_times(rows[:block], rows[first][1])

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with the name of the scope, and has a row with the names of channels below."""
        first, _, rest = head.removeprefix(_BOM).partition(b"\n")
        mark = first[len(_NAME) : len(_NAME) + 1]
        begin = _NAME.encode() + mark
        return first.startswith(begin) and mark in _MARKS and b"\n" + begin in b"\n" + rest

    def channels(self) -> list[Channel]:
        """Return the columns with what the file says of them."""
        return [replace(one, interval=self._intervals.get(one.name)) for one in super().channels()]

    def _channels(self, first: tuple[int, list[str]]) -> dict[str, _Place]:
        """Return the columns by name, times among them; set what is known of them."""
        row = self._known[_NAME]
        while row and not row[-1]:
            row = row[:-1]  # older versions end lines with a delimiter
        times = [i for i, cell in enumerate(row) if cell == _NAME]
        if sum(1 for cell in first[1] if cell) < len(row) or len(times) == len(row):
            raise LogError(
                f"{self.path}, line {first[0]}: a column of times before each channel, or before those that are "
                "sampled at one rate, was expected; export with timelines (All, or For each sampletime)"
            )
        counts = Counter(row)
        symbols = self._known.get("SymbolName", [])
        places: dict[str, _Place] = {}
        clocks: dict[int, str] = {}
        for i, cell in enumerate(row):
            if i in times:
                clocks[i] = "time" if not clocks else f"time#{len(clocks) + 1}"
                places[clocks[i]] = _Place(i, i)
                continue
            name = cell if counts[cell] == 1 or i >= len(symbols) else symbols[i]
            while name in places:
                name += "'"
            places[name] = _Place(i, max(time for time in times if time < i))
        self.names = list(places)
        self.times = {name: clocks[place.time] for name, place in places.items() if place.field != place.time}
        self.units = {
            **{name: unit for name in self.times if (unit := self._unit(places[name].field))},
            **dict.fromkeys(clocks.values(), "s"),
        }
        self._intervals = {
            name: 1e-3 * float(text)
            for name in self.times
            if is_number(text := decimal_points(self._cell(_SAMPLE_TIME, places[name].field)))
        }
        fastest = min(self._intervals.values(), default=0.0)
        self._slow = {self.times[name] for name, interval in self._intervals.items() if interval > fastest}
        return places

    def _cell(self, key: str, field: int) -> str:
        row = self._known.get(key, [])
        return row[field].strip() if field < len(row) else ""

    def _unit(self, field: int) -> str:
        """Return a channel's unit, of ``mm (Length)``; empty for ``(None)``."""
        return self._cell(_UNIT, field).partition("(")[0].strip()

    def _scale_times(self, head: Sequence[tuple[int, list[str]]], first: Sequence[str]) -> None:
        """Find out what times are counted in, and from when."""
        time = float(decimal_points(first[0]))
        self._ticks = time > _FILETIME
        start = next((row[1] for _, row in head if row[0] == _START and len(row) > 1 and row[1].isdigit()), "")
        whole = start if len(start) < 19 and start else decimal_points(first[0]).partition(".")[0]
        self._origin = int(whole) if self._ticks and whole.isdigit() and len(whole) < 19 else 0

    def _open(self) -> Any:
        return self.path.open(encoding="utf-8-sig", errors="replace")

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        places = [self._places[name] for name in names]
        clock = places[0].time
        repeats = any(self._places[name].field == clock for name in self._slow)
        fields = [place.field for place in places] + ([clock] if repeats else [])
        last, line, ended = np.nan, self._first - 1, False
        with self._open() as file:
            rest = islice(bounded_lines(self.path, file), line, None)
            while not ended and (lines := list(islice(rest, n))):
                numbers = range(line + 1, line + 1 + len(lines))
                line += len(lines)
                columns, ended = self._columns(lines, numbers, fields)
                keep = np.arange(len(columns[0]))
                if repeats and len(keep):
                    t = columns.pop()
                    keep = np.flatnonzero(np.diff(t, prepend=last) != 0.0)
                    last = float(t[-1])
                if len(keep):
                    yield Block([column[keep] for column in columns], line_number([numbers[i] for i in keep.tolist()]))

    def _columns(self, lines: Sequence[str], numbers: Sequence[int], fields: Sequence[int]) -> tuple[list[Array], bool]:
        """Return fields of the lines as numbers, times in s, and whether they end with these lines."""
        if self._mark != ",":
            lines = [decimal_points(line) for line in lines]
        counted = [self._ticks and self._is_time(field) for field in fields]
        types = np.dtype([(str(k), np.int64 if ticks else np.float64) for k, ticks in enumerate(counted)])
        try:
            rows = np.loadtxt(lines, types, delimiter=self._mark, usecols=fields, comments=None, ndmin=1)
            ended = False
        except (ValueError, OverflowError):
            found = self._line_by_line(lines, numbers, fields, counted)
            rows, ended = np.array(found, types), len(found) < len(lines)
        return [
            self._scaled(np.ascontiguousarray(rows[name]), field, ticks)
            for name, field, ticks in zip(types.names or (), fields, counted, strict=True)
        ], ended

    def _line_by_line(
        self, lines: Sequence[str], numbers: Sequence[int], fields: Sequence[int], counted: Sequence[bool]
    ) -> list[tuple[float, ...]]:
        """Return the fields of the lines down to that in which all of them are empty."""
        found: list[tuple[float, ...]] = []
        for line, number in zip(lines, numbers, strict=True):
            row = line.rstrip("\r\n").split(self._mark)
            cells = [row[field].strip() if field < len(row) else "" for field in fields]
            if not any(cells) or row[0].strip() == "EOF":
                return found
            for field, cell, ticks in zip(fields, cells, counted, strict=True):
                if not (cell.isdigit() and len(cell) < 19 if ticks else is_number(cell)):
                    what = "a whole number" if ticks else "a number"
                    name = next(name for name, place in self._places.items() if place.field == field)
                    raise LogError(
                        f"{self.path}, line {number}: column {brief(name)} must be {what}, got "
                        f"{brief(cell) if cell else 'nothing'}"
                    )
            found.append(tuple(int(c) if ticks else float(c) for c, ticks in zip(cells, counted, strict=True)))
        return found

    def _is_time(self, field: int) -> bool:
        return any(place.field == place.time == field for place in self._places.values())

    def _scaled(self, values: NDArray[Any], field: int, ticks: bool) -> Array:
        """Return times in s, other columns as they are."""
        if ticks:
            return (values - self._origin) * _TICK
        return values * _MS if self._is_time(field) else values
