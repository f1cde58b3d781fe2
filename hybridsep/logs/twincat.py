"""TwinCAT Scope's CSV export.

Its parts are described in Beckhoff's "TwinCAT 3 Scope View: Export to csv" (infosys.beckhoff.com, TE13xx): a head, rows
of what is known of each channel, each with its key before it, then a column of times before one channel (timelines
"All") or before those that are sampled alike ("For each sampletime").
"""

from collections import Counter
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np

from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from .source import ArraysSource
from .text import is_number

_BOM = b"\xef\xbb\xbf"
_NAME, _UNIT, _SAMPLE_TIME, _START = "Name", "Unit", "SampleTime[ms]", "Starttime of export"

_HEAD_LINES = 400  # lines in which the numbers must begin
_FILETIME, _COUNT, _MS = 1e12, 1e-7, 1e-3  # times above the first are Windows', in the second, s; others in ms


class TwinCatSource(ArraysSource):
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
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            lines = [line.rstrip("\r\n") for line in file]
        rows = [(number, line.split(self._mark)) for number, line in enumerate(lines[:_HEAD_LINES], 1)]
        block = next((i for i, (_, row) in enumerate(rows) if i and row[0] == _NAME), None)
        if block is None:
            raise LogError(f"{path}: a row of the channels' names was expected below the head, got none")
        first = next((i for i in range(block, len(rows)) if is_number(rows[i][1][0].replace(",", "."))), None)
        if first is None:
            raise LogError(f"{path}: numbers were expected below the channels' names, got none")
        self._first = rows[first][0]
        table = takewhile(lambda line: line and not line.startswith("EOF"), lines[first:])
        self._lines = [line if self._mark == "," else line.replace(",", ".") for line in table]
        self._known = {row[0]: row for _, row in rows[block:first] if row[0]}
        self._places = self._channels(rows[first])
        # What times are counted in, and from when
        time = rows[first][1][0].replace(",", ".")
        self._counted = float(time) > _FILETIME
        start = next((row[1] for _, row in rows[:block] if row[0] == _START and len(row) > 1 and row[1].isdigit()), "")
        whole = start if len(start) < 19 and start else time.partition(".")[0]
        self._origin = int(whole) if self._counted and whole.isdigit() and len(whole) < 19 else 0

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with the name of the scope, and has a row with the names of channels below."""
        first, _, rest = head.removeprefix(_BOM).partition(b"\n")
        mark = first[len(_NAME) : len(_NAME) + 1]
        begin = _NAME.encode() + mark
        return first.startswith(begin) and mark in (b"\t", b";", b",") and b"\n" + begin in b"\n" + rest

    def _channels(self, first: tuple[int, list[str]]) -> dict[str, tuple[int, int]]:
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
        places: dict[str, tuple[int, int]] = {}  # its field in a line, and the field of its times
        clocks: dict[int, str] = {}
        for i, cell in enumerate(row):
            if i in times:
                clocks[i] = "time" if not clocks else f"time#{len(clocks) + 1}"
                places[clocks[i]] = i, i
                continue
            name = cell if counts[cell] == 1 or i >= len(symbols) else symbols[i]
            while name in places:
                name += "'"
            places[name] = i, max(time for time in times if time < i)
        self.names = list(places)
        self.times = {name: clocks[time] for name, (field, time) in places.items() if field != time}
        row_of_units, intervals = (self._known.get(key, []) for key in (_UNIT, _SAMPLE_TIME))
        units = {name: _cell(row_of_units, places[name][0]).partition("(")[0].strip() for name in self.times}
        stated = {name: unit for name, unit in units.items() if unit}  # of ``mm (Length)``; ``(None)`` states none
        self.units = {**stated, **dict.fromkeys(clocks.values(), "s")}
        texts = {name: _cell(intervals, places[name][0]).replace(",", ".") for name in self.times}
        known = {name: float(text) for name, text in texts.items() if is_number(text)}
        self._slow = {self.times[name] for name, interval in known.items() if interval > min(known.values())}
        return places

    def column(self, name: str) -> Array:
        """Return a channel down to its last sample, or times in s."""
        field, time = self._places[name]
        values = self._field(field, name)
        clock = self.times.get(name, name)
        if clock in self._slow:
            values = values[np.diff(self._field(time, clock), prepend=np.nan) != 0.0]
        return values

    def _field(self, field: int, name: str) -> Array:
        """Return a field of all lines down to the last one that has it."""
        is_time = field in {time for _, time in self._places.values()}
        kind = np.int64 if is_time and self._counted else np.float64
        rows = ((i, line.split(self._mark)) for i, line in reversed(list(enumerate(self._lines, start=1))))
        end = next((i for i, row in rows if _cell(row, field)), 0)
        try:
            values = np.loadtxt(self._lines[:end], kind, delimiter=self._mark, usecols=field, comments=None, ndmin=1)
        except (ValueError, OverflowError) as error:
            raise LogError(
                f"{self.path}, below line {self._first - 1}: column {brief(name)} must be numbers: {first_line(error)}"
            ) from error
        if kind is np.int64:
            return np.asarray((values - self._origin) * _COUNT, dtype=np.float64)
        return np.asarray(values * _MS if is_time else values, dtype=np.float64)


def _cell(row: Sequence[str], field: int) -> str:
    return row[field].strip() if field < len(row) else ""
