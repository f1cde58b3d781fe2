"""Excel workbooks (``.xlsx``), read by openpyxl."""

from __future__ import annotations

import datetime
import math
import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import LogError, brief, first_line, listed
from ..base.zip_files import ZIP_DAMAGE
from .extras import library, reading
from .source import NEEDS_TRUST, Block, Source
from .text_layout import find_layout

__all__ = ["XlsxSource"]

_FORMAT = "an Excel workbook"

_HEAD_ROWS = 400
"""Rows in which names and numbers must begin, as in text."""

_STRINGS_MAX = 1 << 28
"""Largest size of the workbook's table of texts, bytes, which is read whole."""

_MARKS = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/")
"""Names of members with which a workbook begins."""

_EMPTY = (None, "")


_CLOCK = (datetime.datetime, datetime.time)
_DAY = datetime.date(1900, 1, 1)


@dataclass(frozen=True)
class _Place:
    """Column of a sheet: the first row with numbers, the column, and whether it has clock times."""

    sheet: str
    first: int
    column: int
    clock: bool


class XlsxSource(Source):
    """The columns of a workbook below a row of names; columns of further sheets are ``Sheet.name``.

    A row of units below the names is read; dates with a time of day become seconds since the first one. Cells with
    formulas have the value that Excel saved with them.
    """

    format = "Excel workbook"
    endings = (".xlsx", ".xlsm")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._module = library(path, "openpyxl", "xlsx", _FORMAT)
        self._check_members()
        self._places: dict[str, _Place] = {}
        units: dict[str, str] = {}
        with self._opened() as book:
            for sheet in book.worksheets:
                rows = list(islice(sheet.iter_rows(values_only=True), _HEAD_ROWS))
                layout = find_layout([(i, text) for i, row in enumerate(rows, 1) if (text := _line(row)).strip()])
                if layout is None or layout.delimiter != "\t" or layout.first > len(rows):
                    continue
                first = rows[layout.first - 1]
                if not any(isinstance(cell, (int, float, *_CLOCK)) for cell in first):
                    continue
                before = f"{sheet.title}." if self._places else ""
                for i, name in enumerate(layout.names):
                    clock = i < len(first) and isinstance(first[i], _CLOCK)
                    own = f"{before}{name}"
                    if name and own not in self._places:
                        self._places[own] = _Place(sheet.title, layout.first, i, clock)
                        units[own] = layout.units.get(name, "")
        self.names, self.units = list(self._places), {name: unit for name, unit in units.items() if unit}
        self.stamps = frozenset(name for name, place in self._places.items() if place.clock)
        if not self.names:
            raise LogError(f"{path}: no sheet has a row of names with numbers below it")

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a zip archive that begins with a member of a workbook."""
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return head.startswith(b"PK\x03\x04") and name.startswith(_MARKS)

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        places = [self._places[name] for name in names]
        sheets = {(place.sheet, place.first) for place in places}
        if len(sheets) > 1:
            raise LogError(f"{self.path}: columns {listed(list(names))} are on different sheets; put them on one")
        ((title, first),) = sheets
        firsts: dict[str, Any] = {}
        with self._opened() as book:
            cells = (
                (number, [_cell(row, place.column) for place in places])
                for number, row in enumerate(book[title].iter_rows(min_row=first, values_only=True), first)
            )
            used = (row for row in cells if any(cell not in _EMPTY for cell in row[1]))
            while rows := list(islice(used, n)):
                where = _row_of(title, [number for number, _ in rows])
                columns = [
                    np.array([self._number(name, cells[j], where(i), firsts) for i, (_, cells) in enumerate(rows)])
                    for j, name in enumerate(names)
                ]
                yield Block(columns, where)

    def _number(self, name: str, cell: Any, where: str, firsts: dict[str, Any]) -> float:
        """Return a cell as a number; NaN for an empty one that may be."""
        clock = self._places[name].clock
        if clock and isinstance(cell, _CLOCK):
            now = cell if isinstance(cell, datetime.datetime) else datetime.datetime.combine(_DAY, cell)
            try:
                return float((now - firsts.setdefault(name, now)).total_seconds())
            except TypeError:  # one of them has a zone
                pass
        elif not clock and isinstance(cell, (int, float)) and not isinstance(cell, bool):
            return float(cell)
        elif cell in _EMPTY and name == self.measured and self.may_miss:
            return math.nan
        missing = NEEDS_TRUST if cell in _EMPTY and name == self.measured else ""
        raise LogError(
            f"{self.path}, {where}: column {brief(name)} must be a {'date with a time' if clock else 'number'}, got "
            f"{'nothing' if cell in _EMPTY else brief(cell)}{missing}"
        )

    def _check_members(self) -> None:
        """Raise LogError for a workbook whose members would take the memory, or whose XML refers to anything."""
        try:
            with zipfile.ZipFile(self.path) as archive:
                for member in archive.infolist():
                    if member.filename.endswith("sharedStrings.xml") and member.file_size > _STRINGS_MAX:
                        raise LogError(f"{self.path}: its texts must have at most {_STRINGS_MAX >> 20} MB")
                    if member.filename.endswith((".xml", ".rels")):
                        with archive.open(member) as file:
                            if b"<!DOCTYPE" in file.read(4096):
                                raise LogError(f"{self.path}: {brief(member.filename)} has a document type")
        except ZIP_DAMAGE as error:
            raise LogError(f"{self.path}: is truncated, damaged or not {_FORMAT}: {first_line(error)}") from error

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        """Open the workbook; what openpyxl raises becomes LogError."""
        book = None
        try:
            with reading(self.path, _FORMAT), self.path.open("rb") as file, warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of styles and extensions that it does not know
                book = self._module.load_workbook(file, read_only=True, data_only=True)
                yield book
        finally:
            if book is not None:
                book.close()


def _cell(row: Sequence[Any], column: int) -> Any:
    return row[column] if column < len(row) else None


def _row_of(title: str, numbers: Sequence[int]) -> Callable[[int], str]:
    return lambda i: f"row {numbers[i]} of sheet {brief(title)}"


def _line(row: Sequence[Any]) -> str:
    """Return a row as a line of text between tabs, for the search for names and numbers."""
    return "\t".join("" if cell is None else " ".join(str(cell).split()) for cell in row).rstrip("\t")
