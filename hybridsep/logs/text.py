"""Delimited text, plain or gzip-compressed.

The first lines tell the table: what delimits its fields, where its numbers begin, and which line above them has the
names. Below, a line without any number (an ``overrun``, names that are written again) is left out and counted; what is
left must have the table's columns. Of clock timestamps the time of day counts; dates and zones are ignored.
"""

import codecs
import csv
import gzip
import math
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise, repeat, zip_longest
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np

from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from .names import n_known
from .source import Block, Source, past_midnights
from .units import COUNTS, POSITION_UNITS, plain_name, position_unit, time_unit

_BLOCK = 10_000  # lines that are converted at once

_COMMENTS = ("#", "%", "//", "!")  # beginnings of a comment line

_DELIMITERS = (";", "\t", ",", "|", None)  # delimiters by precedence; None is blanks
_UNIT_ROW = re.compile("units?|einheit(en)?|y_unit_label|trace_unit", re.IGNORECASE)  # first cell of a row of units
_HEAD = 4  # rows above the numbers of which one has the names: units and descriptions may be below it
_FACTOR = re.compile(r"[x*×/]\s*[.,\d]")  # begins a cell of a row of factors, which no reader may pass over
_WITH_UNIT = re.compile(r"^([+-]?[\d.,]+(?:e[+-]?\d+)?)\s+([a-zµ]+)$", re.IGNORECASE)  # 0.001 sec, as of MATLAB
_NO_UNITS = ("", "-", "1", "[-]")  # entries of a row of units where a column has none
_POSITIONS = {*POSITION_UNITS, *COUNTS, "grad"} - {"m", "in"}  # two of these, or of another, make a row of units
_BLANK = -math.inf  # stands for a blank cell of the command until it is filled
_APART = 0.9  # share of rows with one of the two positions from which on channels have times of their own

_MISSING = re.compile(r"(?i)[+-]?(nan(\(\w*\))?|1\.#(q|s)?nan\w*|1\.#ind\w*)|#?na|#?n/a|<na>|null|none|-{1,3}")
"""Spellings of a missing number: of C libraries, R, databases, Excel and pandas; and dashes."""

_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?")
_BELOW_1000 = re.compile(r"[+-]?\d{1,3}")
_NOT_THOUSANDS = re.compile(r",(?:(?!\d{3}(?!\d))|(?<=\d{4},)|(?<=(?<!\d)0,))")

_TELLS = re.compile(rf"{_NOT_THOUSANDS.pattern}|,(?=\d{{3}},)")
_QUOTED, _POINT = map(re.compile, (r'"[^",]+,', r"(?<![\w.:])(\d+\.|\.\d)\d*(?![\d.:])"))
"""What tells what a comma stands for, or may where commas delimit, and a number with a point."""

_SECOND = 1_000_000_000  # in nanoseconds, which doubles count exactly over a day

_ONE_DATE = r"""
    \d{4} [-/.] \d{1,2} [-/.] \d{1,2}                       # 2026-03-05
    | \d{8}                                                 # 20260305, before a time of day
    | \d{1,2} [-/.] \d{1,2} [-/.] (?: \d{4} | \d{2} )       # 05.03.2026, 3/5/26
    | \d{1,2} [-\ ] [A-Za-z]{3} [-\ ] \d{4}                 # 05-Mar-2026
    | \d+\ days?                                           # 0 days 00:00:00.001, of pandas
"""

_DATE = re.compile(rf"[\s'\"]* (?: {_ONE_DATE} ) [\s'\"]*", re.VERBOSE)

_STAMP = re.compile(
    rf"""[\s'"]*
    (?P<date> (?: {_ONE_DATE} ) (?: [Tt_-] | [.,]?\s+ ) )?
    (?P<hour>[01]?\d|2[0-3]) : (?P<minute>[0-5]\d) : (?P<second>[0-5]\d)
    (?: (?: [.,] | :(?=\d{{3}}\b) ) (?P<fraction>\d{{1,9}}) )?
    (?: \s* (?P<half>[AaPp]) \.? [Mm] \.? )?
    (?: \s* (?: [Zz] | UTC | GMT | (?:UTC|GMT)? [+-] \d\d (?: :? \d\d )? ) )?
    [\s'"]*""",
    re.VERBOSE,
)
"""A time of day, with a date before it and a zone after it or without."""

_GZIP = b"\x1f\x8b"
_DAMAGE = (gzip.BadGzipFile, EOFError, zlib.error)


@dataclass(frozen=True)
class _Table:
    names: list[str]  # column names, one empty where rows have names of their own
    units: dict[str, str]  # name → unit, from a row of units below the names
    delimiter: str | None  # between columns; None is blanks
    comma: str | None  # what a comma in a number stands for: ".", nothing between thousands; None where it is an error
    settled: bool  # whether the first lines tell that
    header: int  # line number of the names, from 1
    first: int  # line number from which numbers are read
    clocks: set[int]  # indices of columns of timestamps with a time of day
    in_cells: dict[int, str]  # index of a column → unit behind each of its numbers


class TextSource(Source):
    """Text with a line of column names, then numbers, delimited by comma, semicolon, tab, bar or blanks.

    Preamble, comments and a row of units are skipped, decimal commas are read; columns of timestamps become seconds.
    UTF-8, UTF-16 or Latin-1, plain or in gzip. A blank cell of the command is as before, as in controllers' traces.
    """

    format = "text"
    endings: ClassVar[tuple[str, ...]] = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            self._compressed = file.read(2) == _GZIP
        try:
            with gzip.open(path) if self._compressed else path.open("rb") as file:
                self._encoding = _encoding(file.read(1 << 16))
            with self._open() as text:
                numbered = ((i, line) for i, line in enumerate(text, 1) if not line.isspace())
                table = _find_table(list(islice(numbered, 1000)))  # in which names and numbers must begin
        except _DAMAGE as error:
            raise LogError(f"{path}: is truncated or damaged: {first_line(error)}") from error
        if table is None:
            raise LogError(f"{path}: the file is empty, a line of column names was expected")
        self._table: _Table = table
        self.names, self.twins = with_own_names(table.names)
        self.units = table.units | {
            twin: table.units[name] for name, twins in self.twins.items() if name in table.units for twin in twins
        }
        self.roles = {"t": "X_Value"} if self.names[0] == "X_Value" else {}
        self.stamps = frozenset(self.names[i] for i in table.clocks)
        self._left_out: list[tuple[int, str]] = []
        self._held = 0

    @cached_property
    def _comma(self) -> str | None:
        """What a comma in a number stands for, by the first rows that tell; a point far below commas does not."""
        table, lines = self._table, list[str]()
        tells, points = (_QUOTED if table.delimiter == "," else _TELLS).search, table.comma is None
        with self._open() as file:
            rest = islice(file, table.first - 1, None)
            while not table.settled and (block := list(islice(rest, _BLOCK))):
                text, lines = "".join(block), lines[-1:] + block
                if len({*map(str.count, lines, repeat(","))}) > 1 or tells(text) or (points and _POINT.search(text)):
                    rows = [split(line.strip(" \r\n"), table.delimiter) for line in lines]
                    columns = [list(filter(None, column)) for column in zip_longest(*rows)]
                    comma, told = _comma_of([[a for a in one if points or "." not in a or "," in a] for one in columns])
                    if told:
                        return comma
        return table.comma if table.settled else "."

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether there is no byte 0, or it is gzip or UTF-16."""
        return head.startswith(_GZIP) or b"\0" not in head or _encoding(head).startswith("utf-16")

    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``."""
        use = [self.names.index(name) for name in names]
        line = self._table.first - 1
        self._left_out, self._held = [], 0
        parts, numbers = [], []
        try:
            with self._open() as file:
                rest = islice(file, line, None)
                while lines := list(islice(rest, _BLOCK)):
                    numbered = [one for one in enumerate(lines, line + 1) if not self._is_skipped(*one)]
                    line += len(lines)
                    if numbered:
                        parts.append(self._rows(numbered, use))
                        numbers += [number for number, _ in numbered]
        except _DAMAGE as error:
            raise LogError(f"{self.path}: is truncated or damaged after line {line}: {first_line(error)}") from error
        columns = dict(zip(names, np.concatenate(parts).T if parts else np.empty((len(names), 0)), strict=True))
        for name in self.stamps & columns.keys():
            since = past_midnights(columns[name], 86_400.0 * _SECOND)
            columns[name] = (since - since[:1]) / _SECOND
        if self.commanded in columns:
            columns[self.commanded] = self._filled(columns[self.commanded], columns.get(self.measured), numbers)
        return Block([np.ascontiguousarray(columns[name]) for name in names], lambda i: f"line {numbers[i]}")

    def _filled(self, column: Array, measured: Array | None, numbers: Sequence[int]) -> Array:
        """Return the command with what is blank as before, which is noted; LogError if it is where x is measured."""
        blank, name = column == _BLANK, brief(self.commanded)
        missing = np.isnan(measured) if measured is not None else np.zeros_like(blank)
        if blank.any() and (blank != missing).mean() > _APART and missing[~blank].sum() > _APART * (~blank).sum():
            raise LogError(
                f"{self.path}: rows have either {name} or {brief(self.measured)}: channels with times of their own; "
                "export them with a common time, or fill the gaps, as interpolate() of pandas does"
            )
        if blank[:1].any():
            raise LogError(f"{self.path}, line {numbers[0]}: column {name} must be a number, got nothing")
        last = np.maximum.accumulate(np.where(blank, 0, np.arange(len(column))))
        self._held = int(blank.sum())
        return column[last]

    def notes(self) -> list[str]:
        """Return what the last pass over the file left out or filled."""
        notes = []
        if self._left_out:
            number, text = self._left_out[0]
            n, first = len(self._left_out), f"line {number} first: {brief(text.strip())}"
            notes.append(f"{n} line{'s' if n > 1 else ''} without numbers among the rows left out, {first}")
        if self._held:
            notes.append(f"column {brief(self.commanded)} is blank in {self._held} rows: read as before, as in a trace")
        return notes

    def _open(self) -> IO[str]:
        if self._compressed:
            return gzip.open(self.path, "rt", encoding=self._encoding, errors="replace")
        return self.path.open(encoding=self._encoding, errors="replace")

    def _is_skipped(self, number: int, text: str) -> bool:
        """Return whether a line is blank, a comment or has no number, which is noted."""
        if text[0].isdigit() or text.isspace() or text.lstrip().startswith(_COMMENTS):
            return not text[0].isdigit()
        fields = split(text.strip(" \r\n"), self._table.delimiter)
        if any(is_number(field.replace(",", ".")) or stamp_kind(field) for field in fields):
            return False
        self._left_out.append((number, text))
        return True

    def _rows(self, numbered: list[tuple[int, str]], use: list[int]) -> Array:
        """Return the columns ``use`` of some lines, ``(n_lines, n_use)``, timestamps as times of day, ns."""
        mark, expected = self._table.delimiter, len(self._table.names)
        comma = self._comma if mark != "," else None
        for number, text in numbered:
            if self._comma == "." and "." in text and _POINT.search(text):
                self._row(text, number, use)  # which refuses it in a column that is read
        whole = comma is not None and not (comma == "" and any(_NOT_THOUSANDS.search(text) for _, text in numbered))
        lines = [text.replace(",", comma or "") if whole else text for _, text in numbered]
        widths = [text.count(mark) + 1 for text in lines] if mark else [len(text.split()) for text in lines]
        if min(widths) != expected or max(widths) != expected:
            for number, text in numbered:
                fields = split(text.strip(" \r\n"), self._table.delimiter)  # without delimiters between quotation marks
                if len(fields) < expected or any(fields[expected:]):
                    self._row(text, number, use)  # a decimal comma is the likelier fault
                    raise LogError(
                        f"{self.path}, line {number}: {expected} columns were expected as in line "
                        f"{self._table.header}, got {len(fields)}; correct the line, or take it out"
                    )
        stamps = dict.fromkeys(self._table.clocks.intersection(use), _nanoseconds)
        try:
            how: Any = {"converters": stamps, "comments": None, "quotechar": '"', "ndmin": 2, "encoding": None}
            return np.loadtxt(lines, np.float64, delimiter=mark, usecols=use, **how)
        except ValueError:  # what is no number, or one that only Python's float() accepts
            return np.array([self._row(text, number, use) for number, text in numbered])

    def _row(self, text: str, number: int, use: list[int]) -> list[float]:
        """Return the numbers of one line in the columns ``use``, as far as it has them."""
        fields = split(text.strip(" \r\n"), self._table.delimiter)
        row: list[float] = []
        for i in use:
            if i >= len(fields):
                continue
            name, field = self.names[i], fields[i].removesuffix(self._table.in_cells.get(i, "")).rstrip()
            may_miss = name in (self.measured, *self.twins.get(self.measured, ()))
            try:
                if i in self._table.clocks:
                    row.append(_nanoseconds(field))
                elif may_miss and (not field or _MISSING.fullmatch(field)):
                    row.append(math.nan)
                elif not field and name == self.commanded:
                    row.append(_BLANK)
                else:
                    row.append(self._number(field))
            except ValueError:
                stamp = i in self._table.clocks
                what = "a time of day such as 10:20:30.001 (up to 9 decimals)" if stamp else "a number"
                raise LogError(
                    f"{self.path}, line {number}: column {brief(name)} must be {what}, got "
                    f"{brief(field) if field else 'nothing'}{'' if stamp else _hint(field, self._comma)}"
                ) from None
        return row

    def _number(self, field: str) -> float:
        """Return a number; ValueError if it is none, or a comma in it has no meaning in this file."""
        comma = self._comma
        wrong = "." in field if comma == "." else "," in field and (comma is None or not _THOUSANDS.fullmatch(field))
        if wrong or "_" in field:
            raise ValueError(field)
        return float(field.replace(",", comma or ""))


def with_own_names(names: Sequence[str]) -> tuple[list[str], dict[str, list[str]]]:
    """Return names that occur once, ``Time#2`` for the second ``Time``; and these, by the name that they had."""
    own: list[str] = []
    twins: dict[str, list[str]] = {}
    for i, name in enumerate(names):
        again = name and name in names[:i]
        own.append(f"{name}#{names[: i + 1].count(name)}" if again else name)
        if again:
            twins.setdefault(name, []).append(own[-1])
    return own, twins


def is_number(text: str) -> bool:
    """Return whether a field is a number with a decimal point; an underscore is no digit of one."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def stamp_kind(text: str) -> str:
    """Return whether a text is a ``"date"``, a ``"time"`` of day or a ``"date and time"``; empty if it is neither."""
    if match := _STAMP.fullmatch(text):
        return "date and time" if match["date"] else "time"
    return "date" if _DATE.fullmatch(text) else ""


def _nanoseconds(text: str) -> float:
    """Return the time of day of a timestamp, ns; ValueError if it is none."""
    match = _STAMP.fullmatch(text)
    if match is None:
        raise ValueError(text)
    _, hour, minute, second, fraction, half = match.groups()
    hours = int(hour) if half is None else int(hour) % 12 + 12 * (half in "Pp")
    return float((3600 * hours + 60 * int(minute) + int(second)) * _SECOND + int((fraction or "").ljust(9, "0")))


def split(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line without blanks and quotation marks around them."""
    if delimiter is not None and '"' in line:
        with suppress(csv.Error):  # a field of more than 131 072 letters: no table
            fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
            return [field.strip().strip("'") for field in fields]
    return [field.strip().strip("\"'") for field in line.split(delimiter)]


def _encoding(head: bytes) -> str:
    """Return the encoding of a text that begins with these bytes."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for name, zeros, others in (("utf-16-le", head[1::2], head[::2]), ("utf-16-be", head[::2], head[1::2])):
        if b"\0" not in others and 2 * zeros.count(b"\0") > len(zeros):  # without its mark
            return name
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _hint(field: str, comma: str | None) -> str:
    if comma == "." and is_number(field):
        return "; other lines have decimal commas, or it divides thousands"
    if is_number(re.sub(r"[.\s'’]", "", field).replace(",", ".")) or is_number(field.replace(",", "")):
        return "; write numbers without separators of thousands"
    return "; write times of day as hh:mm:ss with up to 9 decimals, or as seconds" if ":" in field else ""


# Table


def _find_table(lines: Sequence[tuple[int, str]]) -> _Table | None:
    """Return the table of a file that begins with these lines, numbered from 1; None if they are all comments.

    Of the delimiters that with most rows of numbers in a row counts, then with most columns. Without any the first line
    that is no comment is taken for the names, so that the reader's message names what is wrong below it.
    """
    tables: list[tuple[tuple[int, int], _Table]] = []
    for delimiter in _DELIMITERS:
        rows = [(number, split(line.strip(" \r\n"), delimiter), line) for number, line in lines]
        widths = [0 if line.lstrip().startswith(_COMMENTS) else _width(fields) for _, fields, line in rows]
        edges = [i for i, (before, now) in enumerate(pairwise([0, *widths, 0])) if now != before]
        for width in {*widths} - {0}:
            runs = [run for run in pairwise(edges) if widths[run[0]] == width]
            runs.sort(key=lambda run: run[1] - run[0] < 3)  # fewer rows are a preamble's, where there are more
            found = (_with_names(rows, *run, delimiter) for run in runs)
            if (table := next(filter(None, found), None)) is not None:
                early = (_with_names(rows, *run, delimiter) for run in runs if rows[run[0]][0] < table.first)
                table = next((one for one in early if one and one.names == table.names), table)  # written again
                n = max(end - start for start, end in runs if rows[start][0] >= table.first)
                # That blanks divide a timestamp makes no column
                tables.append(((n, width - (delimiter is None and bool(table.clocks))), table))
    if tables:
        return max(tables, key=lambda one: one[0])[1]
    known = [(number, line) for number, line in lines if not line.lstrip().startswith(_COMMENTS)] or list(lines)
    if not known:
        return None
    number, line = known[0]
    mark = next((mark for mark in _DELIMITERS if mark and mark in line), None)
    return _Table(_names(line, mark), {}, mark, None, False, number, number + 1, set(), {})


def _width(fields: Sequence[str]) -> int:
    """Return the number of fields of a row of numbers, 0 if more than half of them are neither that nor missing."""
    n, others = sum(map(_is_written, fields)), [text for text in fields if text and not _is_written(text)]
    texts = [text for text in others if not (_MISSING.fullmatch(text) or stamp_kind(text))]
    # Numbers with units count as well, but not beside other text, as in a preamble: Rate,1000 Hz
    return len(fields) if (n and n >= len(texts)) or (texts and all(map(_WITH_UNIT.match, texts))) else 0


def _with_names(rows: Sequence[tuple[int, list[str], str]], start: int, end: int, mark: str | None) -> _Table | None:
    """Return the table of a run of rows below its names, perhaps of units too, hh:mm:ss of timestamps; None without."""
    fields = [row for _, row, _ in rows[start:end]]
    width = len(fields[0])
    blank = next(i for i in range(width) if any(row[width - 1 - i] for row in fields))  # at the ends of rows
    kinds = [_kind([row[i] for row in fields]) for i in range(width)]
    above: list[tuple[int, list[str]]] = []
    for number, _, line in reversed(rows[:start]):
        names = _names(line, mark)
        if mark is None and len(names) == width - 1 and ("date", "time") in pairwise(kinds):
            i = list(pairwise(kinds)).index(("date", "time"))  # one name for both
            names = [*names[:i], f"{names[i]} (date)", *names[i:]]
        while len(names) > width - blank and not names[-1]:
            names.pop()
        if len(names) == width - blank - 1 and (blank == 0) and _are_row_names([row[0] for row in fields]):
            names = ["", *names]
        fits = width - blank <= len(names) <= width
        if fits and not all(map(is_number, names)) and not any(map(stamp_kind, names)):
            above.append((number, names))
        elif not line.lstrip().startswith(_COMMENTS):
            break
    if not above:
        return None
    cells = [[a for a, b in zip(row, kinds, strict=False) if not b] for _, row in above]
    of_units = [_is_row_of_units(row) and n_known(row) < 2 for row in cells]
    factors = (i + 1 for i, (_, row) in enumerate(above) if any(map(_FACTOR.match, row)))  # nothing above is looked at
    near = [i for i, is_units in enumerate(of_units[: min(_HEAD, next(factors, _HEAD))]) if not is_units] or [0]
    at = max(near, key=lambda i: (n_known(above[i][1]), -i))  # the one with more known names counts, else the nearest
    header, names = above[at]
    over = [i for i, (_, row) in enumerate(above) if i == at + 1 and not re.search(r"\d", "".join(row))]  # the names
    beside = (above[i][1] for i in [*range(at), *over] if of_units[i] and not _UNIT_ROW.fullmatch(above[i][1][0]))
    keyed = (row for _, row in above[:9] if row is not names and _UNIT_ROW.fullmatch(row[0]))
    units = dict(zip(names, next(beside, ["", *next(keyed, [""])[1:]]), strict=False))
    behind = [[(_WITH_UNIT.match(row[i]) or ("",) * 3)[2] for row in fields[:9] if row[i]] for i in range(len(names))]
    in_cells = {i: one[0] for i, one in enumerate(behind) if len({*one}) == 1 and _is_row_of_units(one)}
    units |= {names[i]: unit for i, unit in in_cells.items()}
    bare = [[row[i].removesuffix(in_cells.get(i, "")).rstrip() for row in fields] for i in range(width)]
    comma, settled = _comma_of(bare)
    stated = {name: unit.strip("[]()") for name, unit in units.items() if unit not in _NO_UNITS}
    clocks = {i for i, kind in enumerate(kinds) if "time" in kind}
    return _Table(names, stated, mark, comma, settled, header, rows[start][0], clocks, in_cells)


def _is_written(text: str) -> bool:
    """Return whether a field is a number, with a decimal comma or commas between thousands too."""
    return is_number(text.replace(",", ".")) or bool(_THOUSANDS.fullmatch(text))


def _comma_of(columns: Sequence[Sequence[str]]) -> tuple[str | None, bool]:
    """Return what a comma in the numbers of columns of texts stands for, and whether they tell."""
    columns = [list(filter(_is_written, column)) for column in columns]
    numbers = [text for column in columns for text in column]
    commas = [text for text in numbers if "," in text]
    points = any("." in text for text in numbers)
    several = any(text.count(",") > 1 for text in commas)
    settled = not all(map(_THOUSANDS.fullmatch, commas))
    swapped = [[text.replace(".", ",") for text in column] for column in columns] if points and not commas else []
    grouped = all(_THOUSANDS.fullmatch(text) for column in swapped for text in column if "," in text)
    if grouped and any(map(_passes_1000, swapped)):
        return ".", True  # points are between thousands, and refused
    if not settled and (points or several or any(map(_passes_1000, columns))):
        return "", True
    return "." if commas and not points else None, settled


def _passes_1000(column: Sequence[str]) -> bool:
    """Return whether only whole numbers below 1000 lack a comma, and neighbours are closer if it is of thousands."""
    column = [text for text in column if not _MISSING.fullmatch(text)]
    plain = [text for text in column if "," not in text]
    grouped = all(_THOUSANDS.fullmatch(text) for text in column if "," in text)
    if not 0 < len(plain) < len(column) or not (grouped and all(map(_BELOW_1000.fullmatch, plain))):
        return False
    steps = ([float(text.replace(",", mark)) for text in column] for mark in ("", "."))
    whole, decimal = (max(abs(b - a) for a, b in pairwise(one)) for one in steps)
    return whole < decimal


def _are_row_names(cells: Sequence[str]) -> bool:
    """Return whether a column counts its rows or is text, as the names of rows in R's tables."""
    if len(cells) < 2 or any(map(stamp_kind, cells)):
        return False
    return not any(map(is_number, cells)) or all(
        is_number(one) and is_number(other) and float(other) == float(one) + 1.0 for one, other in pairwise(cells)
    )


def _kind(cells: Sequence[str]) -> str:
    """Return which timestamps most cells of a column are, empty if they are none."""
    ((kind, n),) = Counter(map(stamp_kind, cells)).most_common(1)
    return kind if 2 * n > len(cells) else ""


def _names(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line of names; a leading comment mark is how numpy.savetxt and MATLAB write theirs."""
    line = line.strip(" \r\n")
    for mark in _COMMENTS:
        line = line.removeprefix(mark)
    if line.startswith("X_Value"):  # of LabVIEW
        line = line.removesuffix("\tComment")
    return split(line.strip(" "), delimiter)


def _is_row_of_units(fields: Sequence[str]) -> bool:
    """Return whether fields are units, or two of them are units of positions, whatever is beside them."""
    plain = [plain_name(field.strip("[]()")) for field in fields]
    known = [bool(position_unit(one) or time_unit(one) or "/" in one) for one in plain]
    n = [plain.count("m"), plain.count("in"), sum(one in _POSITIONS or one.rstrip("s") in _POSITIONS for one in plain)]
    return max(n) > 1 or (any(known) and all(a or b in _NO_UNITS for a, b in zip(known, plain, strict=True)))
