"""Streaming reader of delimited text, plain or gzip-compressed."""

from __future__ import annotations

import codecs
import gzip
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence, Set
from functools import partial
from itertools import islice
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..base.errors import LogError, brief, first_line
from .source import NEEDS_TRUST, Block, Source
from .text_layout import COMMENTS, Layout, decimal_points, find_layout, is_number, split
from .timestamps import CELL, Clock, cell, stamp_kind

__all__ = ["TextSource", "bounded_lines", "with_own_names"]

_HEAD_LINES = 400
"""Lines, blank ones aside, in which names and numbers must begin."""

_LINE_MAX = 1_000_000
"""Largest length of a line, in characters: a thousand columns; a file without line ends must not fill the memory."""

_NUMBER_BEGINS = frozenset("0123456789+-.")
"""First characters that most lines have, and no comment."""

_GZIP = b"\x1f\x8b"
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DAMAGE = (gzip.BadGzipFile, EOFError, zlib.error)


def _as_latin_1(error: UnicodeError) -> tuple[str, int]:
    """Read bytes that are no UTF-8 as Latin-1, in which every byte is a character."""
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("latin-1"), error.end


_FALLBACK = "hybridsep-latin-1"
codecs.register_error(_FALLBACK, _as_latin_1)


class TextSource(Source):
    """Text with a line of column names, then numbers, delimited by comma, semicolon, tab or blanks.

    Preamble, comments and a row of units are skipped, decimal commas are read; columns of timestamps become seconds.
    UTF-8, UTF-16 with a byte-order mark or Latin-1, plain or in gzip.
    """

    format = "text"
    endings: ClassVar[tuple[str, ...]] = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            start = file.read(4)
        self._compressed = start.startswith(_GZIP)
        self._encoding = "utf-8-sig"
        try:
            if self._compressed:
                with gzip.open(path) as packed:
                    start = packed.read(4)
            self._encoding = "utf-16" if start.startswith(_UTF_16) else "utf-8-sig"
            with self._open() as file:
                numbered = ((i, line) for i, line in enumerate(bounded_lines(self.path, file), 1) if not line.isspace())
                layout = find_layout(list(islice(numbered, _HEAD_LINES)))
        except _DAMAGE as error:
            raise LogError(f"{path}: is truncated or damaged: {first_line(error)}") from error
        if layout is None:
            raise LogError(f"{path}: the file is empty, a line of column names was expected")
        self._layout: Layout = layout
        self.names, self.twins = with_own_names(layout.names)
        self.units = layout.units | {
            twin: layout.units[name] for name, twins in self.twins.items() if name in layout.units for twin in twins
        }
        self.stamps = frozenset(self.names[i] for i in layout.clocks)
        self._dates = {i: date for i, date in layout.clocks.items() if date is not None}

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether there is no byte 0, or a mark of gzip or UTF-16."""
        return head.startswith((_GZIP, *_UTF_16)) or b"\0" not in head

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        use = [self.names.index(name) for name in names]
        clocks = {
            i: Clock(self.path, self.names[i], self.names[self._dates[i]] if i in self._dates else "")
            for i in use
            if i in self._layout.clocks
        }
        line = self._layout.first - 1
        try:
            with self._open() as file:
                rest = islice(bounded_lines(self.path, file), line, None)
                while lines := list(islice(rest, n)):
                    numbers = [line + 1 + i for i, text in enumerate(lines) if not _is_skipped(text)]
                    line += len(lines)
                    if len(numbers) < len(lines):
                        lines = [text for text in lines if not _is_skipped(text)]
                    if lines:
                        yield self._block(lines, numbers, use, clocks)
        except _DAMAGE as error:
            raise LogError(f"{self.path}: is truncated or damaged after line {line}: {first_line(error)}") from error

    def _open(self) -> IO[str]:
        if self._compressed:
            return gzip.open(self.path, "rt", encoding=self._encoding, errors=self._errors)
        return self.path.open(encoding=self._encoding, errors=self._errors)

    @property
    def _errors(self) -> str:
        return _FALLBACK if self._encoding == "utf-8-sig" else "replace"

    def _block(self, lines: list[str], numbers: list[int], use: list[int], clocks: Mapping[int, Clock]) -> Block:
        """Return a block of the columns ``use``, timestamps as seconds."""
        dates = {i: self._dates[i] for i in clocks if i in self._dates}
        read = [*use, *dates.values()]
        found = dict(zip(read, self._columns(lines, numbers, read, {*clocks, *dates.values()}), strict=True))

        def where(i: int) -> str:
            return f"line {numbers[i]}"

        for i, clock in clocks.items():
            found[i] = clock.seconds(found[i], where, found[dates[i]] if i in dates else None)
        return Block([found[i] for i in use], where)

    def _columns(self, lines: list[str], numbers: list[int], use: list[int], stamps: Set[int]) -> list[NDArray[Any]]:
        """Return the columns ``use``, ``stamps`` among them as text."""
        mark, expected = self._layout.delimiter, len(self._layout.names)
        if self._layout.decimal_comma:
            lines = [decimal_points(text) for text in lines]
        widths = [text.count(mark) + 1 for text in lines] if mark else [len(text.split()) for text in lines]
        if min(widths) != expected or max(widths) != expected:
            widths = [len(split(text, mark)) for text in lines]  # without delimiters between quotation marks
        if min(widths) != expected or max(widths) != expected:
            i = next(i for i, width in enumerate(widths) if width != expected)
            self._convert(lines[i], numbers[i], use, stamps)  # a decimal comma is the likelier fault
            raise LogError(
                f"{self.path}, line {numbers[i]}: {expected} columns were expected as in line {self._layout.header}, "
                f"got {widths[i]}"
            )
        types = np.dtype([(str(k), CELL.str if i in stamps else "f8") for k, i in enumerate(use)])
        try:
            rows = np.loadtxt(lines, types, delimiter=mark, usecols=use, comments=None, quotechar='"', ndmin=1)
        except ValueError:
            # Line by line, for the message, or for a notation that only Python's float() accepts.
            converted = [self._convert(text, number, use, stamps) for text, number in zip(lines, numbers, strict=True)]
            rows = np.array(converted, types)
        return [np.ascontiguousarray(rows[name]) for name in types.names or ()]

    def _convert(self, text: str, number: int, use: list[int], stamps: Set[int]) -> tuple[float | bytes, ...]:
        """Return the numbers, and texts of ``stamps``, of one line in the columns ``use``, as far as it has them."""
        fields = split(text.strip(" \r\n"), self._layout.delimiter)
        row: list[float | bytes] = []
        for i in use:
            if i >= len(fields):
                continue
            if i in stamps:
                row.append(cell(fields[i]))
                continue
            missing = not fields[i] and self.names[i] in (self.measured, *self.twins.get(self.measured, ()))
            if missing and self.may_miss:
                row.append(math.nan)
                continue
            number_there = decimal_points(fields[i])
            if not is_number(number_there):
                came = brief(fields[i]) if fields[i] else "nothing"
                raise LogError(
                    f"{self.path}, line {number}: column {brief(self.names[i])} must be a number, got {came}"
                    f"{NEEDS_TRUST if missing else _hint(fields[i], divided=len(fields) > len(self._layout.names))}"
                )
            row.append(float(number_there))
        return tuple(row)


def bounded_lines(path: Path, file: IO[str]) -> Iterator[str]:
    """Iterate over the lines of an open file; LogError for one that is too long."""
    for i, line in enumerate(iter(partial(file.readline, _LINE_MAX), ""), 1):
        if len(line) == _LINE_MAX:
            raise LogError(f"{path}, line {i}: has {_LINE_MAX} characters or more; is the file a log?")
        yield line


def with_own_names(names: Sequence[str]) -> tuple[list[str], dict[str, list[str]]]:
    """Return names that occur once, ``Time#2`` for the second ``Time``; and these, by the name that they had."""
    own: list[str] = []
    twins: dict[str, list[str]] = {}
    for i, name in enumerate(names):
        if name and name in names[:i]:
            twins.setdefault(name, []).append(f"{name}#{names[: i + 1].count(name)}")
            own.append(twins[name][-1])
        else:
            own.append(name)
    return own, twins


def _hint(field: str, *, divided: bool) -> str:
    if is_number(field.replace(".", "").replace(",", ".")) or is_number(field.replace(",", "")):
        return "; write numbers without separators of thousands"
    if stamp_kind(field) and divided:
        return "; the line has more fields than names: put timestamps with blanks or commas between quotation marks"
    if stamp_kind(field):
        return "; a column of times has timestamps with the time of day in all lines, or in none; --t names another"
    if ":" in field and is_number(decimal_points(field.rsplit(":", 1)[1])):
        return (
            "; write times of day as hh:mm:ss with up to 9 decimals or as seconds, or remove the column and give T_s "
            "(--T_s)"
        )
    return ""


def _is_skipped(text: str) -> bool:
    return text[0] not in _NUMBER_BEGINS and (text.isspace() or text.lstrip().startswith(COMMENTS))
