"""Columns of clock timestamps as seconds since the first one: dates, times of day, AM and PM, zones, midnight."""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ..base.errors import LogError, brief
from ..base.signals import Array

__all__ = ["CELL", "Cells", "Clock", "cell", "stamp_kind"]

Cells = NDArray[np.bytes_]
Integers = NDArray[np.int64]

CELL = np.dtype("S64")
"""Type of a cell with a timestamp; a longer cell is none, blanks and quotation marks around it included."""

_SECOND = 1_000_000_000
_DAY = 86_400 * _SECOND
"""Durations in nanoseconds, the resolution of all that is computed here before it becomes seconds."""

_DAYS_MAX = 100_000
"""Most days between a timestamp and the first one, so that their nanoseconds fit into 64 bits."""

_MONTHS = "janfebmaraprmayjunjulaugsepoctnovdec"

_ONE_DATE = r"""
    \d{4}(?P<ymd>[-/.])\d{1,2}(?P=ymd)\d{1,2}                       # 2026-03-05
    | \d{8}                                                         # 20260305, before a time of day
    | \d{1,2}(?P<other>[-/.])\d{1,2}(?P=other)(?:\d{4}|\d{2})       # 05.03.2026, 3/5/26
    | \d{1,2}[-\ ][A-Za-z]{3}[-\ ]\d{4}                             # 05-Mar-2026
"""

_DATE = re.compile(rf"[\s'\"]* (?P<date>{_ONE_DATE}) [\s'\"]*", re.VERBOSE)

_STAMP = re.compile(
    rf"""[\s'"]*
    (?: (?P<date>{_ONE_DATE}) (?: [Tt_-] | [.,]?\s+ ) )?
    (?P<hour>\d{{1,2}}) : (?P<minute>\d\d) : (?P<second>\d\d) (?: [.,] (?P<fraction>\d{{1,9}}) )?
    (?: \s* (?P<half>[AaPp]) \.? [Mm] \.? )?
    (?: \s* (?P<zone>
        [Zz] | UTC | GMT | (?:UTC|GMT)? (?P<sign>[+-]) (?P<zone_hour>\d\d) (?: :? (?P<zone_minute>\d\d) )?
    ) )?
    [\s'"]*""",
    re.VERBOSE,
)
"""A time of day, with a date before it and a zone behind it or without."""


def stamp_kind(text: str) -> str:
    """Return whether a text is a ``"date"``, a ``"time"`` of day or a ``"date and time"``; empty if it is neither."""
    match = _STAMP.fullmatch(text)
    if match:
        return "date and time" if match["date"] else "time"
    return "date" if _DATE.fullmatch(text) else ""


def cell(text: str) -> bytes:
    """Return a field of a text as a cell; blanks of every kind become plain ones."""
    return " ".join(text.split()).encode("ascii", "replace")


class Clock:
    """Clock whose timestamps arrive in blocks; the first one, the last one and the dates are remembered.

    All rows of a block that have digits in the same places are converted at once. Dates in which day and month may be
    exchanged are read in the order that makes the first change of date the smallest step. Times of day without a
    date pass midnight where they fall by more than half a day.

    Parameters
    ----------
    path : Path
        The file, for messages.
    name : str
        The column, for messages.
    date_name : str
        The column of dates, where they have one of their own.
    """

    def __init__(self, path: Path, name: str, date_name: str = "") -> None:
        self._path, self._name, self._date_name = path, name, date_name
        self._example = "2026-03-05 10:20:30.001"
        self._parts: tuple[bool, bool] | None = None  # whether there are dates and zones
        self._first: int | None = None
        self._last, self._passed = 0, 0
        self._first_date: dict[str, int] = {}
        self._order = ""
        self._days: dict[str, int] = {}

    def seconds(self, cells: Cells, where: Callable[[int], str], dates: Cells | None = None) -> Array:
        """Return the next timestamps as seconds since the first one of all.

        Parameters
        ----------
        cells : (m,) array of :data:`CELL`
        where : callable
            Location of sample ``i`` of the block, for messages.
        dates : (m,) array of :data:`CELL`, optional
            Cells of the column of dates.

        Raises
        ------
        LogError
            If a cell is no timestamp, or one of it and the first has a date or a zone and the other has none.
        """
        times, days = self._read(np.ascontiguousarray(cells), where)
        if dates is not None:
            days = self._read_dates(np.ascontiguousarray(dates), where)
        elif not (self._parts and self._parts[0]):
            days = self._midnights(times)
        times += days * _DAY
        if self._first is None:
            self._first = int(times[0])
        # Integers up to here, so that an interval is as exact at the end of a day as at its beginning
        return (times - self._first) / _SECOND

    def _read(self, cells: Cells, where: Callable[[int], str]) -> tuple[Integers, Integers]:
        """Return times of day, ns, in UTC where they have zones, and days since the first date, 0 without dates."""
        characters = cells.view(np.uint8).reshape(len(cells), -1)
        digits = characters - np.uint8(ord("0"))  # other characters become 10 and more
        shapes = (characters - digits * (digits < 10)).view(cells.dtype).ravel()  # each digit becomes 0
        times, days = np.zeros(len(cells), dtype=np.int64), np.zeros(len(cells), dtype=np.int64)
        left = np.arange(len(cells))
        while len(left):
            alike = shapes[left] == shapes[left[0]]
            rows, left = left[alike], left[~alike]
            place = _Places(where, rows)
            match = self._matched(cells[rows[0]], place)
            wrong, times[rows] = _time_of_day(match, digits[rows])
            if wrong.any():
                i = int(np.argmax(wrong))
                self._refuse(cells[rows[i]], place(i), "; there is no such time of day")
            if match["date"]:
                start, end = match.span("date")
                texts = np.ascontiguousarray(characters[rows, start:end]).view(f"S{end - start}").ravel()
                days[rows] = self._read_dates(texts, place)
        return times, days

    def _matched(self, text: bytes, where: Callable[[int], str]) -> re.Match[str]:
        """Return the parts of a timestamp, sample 0; every later one must have the same parts as the first."""
        match = _STAMP.fullmatch(text.decode("latin-1"))
        if match is None or len(text) == CELL.itemsize:
            many = re.search(rb":\d\d[.,]\d{10}", text)
            self._refuse(text, where(0), "; at most 9 decimals are read" if many else "")
        parts = (match["date"] is not None, match["zone"] is not None)
        if self._parts is None:
            self._parts, self._example = parts, match[0].strip(" '\"")
        for what, has, first_has in zip(("date", "zone"), parts, self._parts, strict=True):
            if has != first_has:
                hint = f"; it has {'a' if has else 'no'} {what}, the first one has {'one' if first_has else 'none'}"
                self._refuse(text, where(0), hint)
        return match

    def _read_dates(self, texts: Cells, where: Callable[[int], str]) -> Integers:
        """Return days since the first date."""
        if (texts == texts[0]).all():
            return np.full(len(texts), self._day(texts[0], where, 0), dtype=np.int64)
        found, first, which = np.unique(texts, return_index=True, return_inverse=True)
        days = np.zeros(len(found), dtype=np.int64)
        for k in np.argsort(first):  # as they come, because the first change of date decides on the order of its parts
            days[k] = self._day(found[k], where, int(first[k]))
        return days[which.ravel()]

    def _day(self, text: bytes, where: Callable[[int], str], i: int) -> int:
        """Return days from the first date to another, sample ``i`` of a block."""
        match = _DATE.fullmatch(text.decode("latin-1"))
        date = match["date"] if match else ""
        if date not in self._days:
            days = _readings(date) if date else {}
            self._first_date = self._first_date or days
            orders = [order for order in days if order in self._first_date and self._order in ("", order)]
            steps = {order: days[order] - self._first_date[order] for order in orders}
            order = min(orders, key=lambda order: abs(steps[order]), default="")
            if not order:
                self._refuse_date(text, where(i), "; there is no such date" if date else "")
            if abs(steps[order]) > _DAYS_MAX:
                self._refuse_date(text, where(i), f"; it is {abs(steps[order])} days away from the first date")
            if self._days:
                self._order = order
            self._days[date] = steps[order]
        return self._days[date]

    def _midnights(self, times: Integers) -> Integers:
        """Return how often midnight has passed, as a time of day tells it."""
        falls = np.diff(times, prepend=times[0] if self._first is None else self._last) < -_DAY // 2
        passed = self._passed + np.cumsum(falls)
        self._last, self._passed = int(times[-1]), int(passed[-1])
        return passed

    def _refuse(self, text: bytes, place: str, hint: str) -> NoReturn:
        raise LogError(
            f"{self._path}, {place}: column {brief(self._name)} must be a timestamp such as {brief(self._example)}, "
            f"got {_came(text)}{hint}"
        )

    def _refuse_date(self, text: bytes, place: str, hint: str) -> NoReturn:
        if not self._date_name:
            self._refuse(text, place, hint)
        example = next(iter(self._days), "2026-03-05")
        raise LogError(
            f"{self._path}, {place}: column {brief(self._date_name)} must be a date such as {brief(example)}, got "
            f"{_came(text)}{hint}"
        )


def _came(text: bytes) -> str:
    return brief(text.decode("latin-1").strip(" '\"")) if text.strip() else "nothing"


@dataclass(frozen=True)
class _Places:
    """Location, for messages, of some rows of a block."""

    where: Callable[[int], str]
    rows: NDArray[np.intp]

    def __call__(self, i: int) -> str:
        return self.where(int(self.rows[i]))


def _time_of_day(match: re.Match[str], digits: NDArray[np.uint8]) -> tuple[NDArray[np.bool_], Integers]:
    """Return which times of day there are not, and all of them, ns; one row of digits a timestamp."""

    def number(part: str) -> Integers:
        if match[part] is None:
            return np.zeros(len(digits), dtype=np.int64)
        start, end = match.span(part)
        return digits[:, start:end].astype(np.int64) @ 10 ** np.arange(end - start, dtype=np.int64)[::-1]

    hour, minute, second = number("hour"), number("minute"), number("second")
    wrong = (hour > 23) | (minute > 59) | (second > 59)
    if match["half"]:
        wrong |= (hour < 1) | (hour > 12)
        hour = hour % 12 + (12 if match["half"] in "Pp" else 0)
    times = (3600 * hour + 60 * minute + second) * _SECOND
    if match["fraction"]:
        times += number("fraction") * 10 ** (9 - len(match["fraction"]))
    if match["sign"]:
        east, more = number("zone_hour"), number("zone_minute")
        wrong |= (east > 23) | (more > 59)
        offset = (3600 * east + 60 * more) * _SECOND
        times += offset if match["sign"] == "-" else -offset
    return wrong, times


def _readings(date: str) -> dict[str, int]:
    """Return the numbers of the days that a date may mean, by the order of year, month and day."""
    parts = [date[:4], date[4:6], date[6:]] if date.isdigit() else re.findall(r"\d+|[A-Za-z]+", date)
    named = parts[1].isalpha()
    if named:
        place = _MONTHS.find(parts[1].lower())
        parts[1] = str(place // 3 + 1) if place % 3 == 0 else "0"
    if len(parts[0]) == 4:
        orders = ["ymd"]
    elif named or "." in date:
        orders = ["dmy"]
    else:
        orders = ["mdy", "dmy", *(["ymd"] if len(parts[2]) == 2 else [])]
    days = {}
    for order in orders:
        year, month, day = (parts[order.index(part)] for part in "ymd")
        try:
            days[order] = datetime.date(int(year) + 2000 * (len(year) < 3), int(month), int(day)).toordinal()
        except ValueError:
            continue
    return days
