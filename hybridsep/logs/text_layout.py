"""Layout of a text log: where its names and numbers are among preamble, comments and units, and what delimits them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass

from .units import plain_name, position_unit, time_unit

__all__ = ["COMMENTS", "Layout", "decimal_points", "find_layout", "is_number", "split"]

COMMENTS = ("#", "%", "//", "!")
"""Beginnings of a comment line."""

_DELIMITERS = (";", "\t", ",", None)
"""Delimiters by precedence; None is blanks."""

_NO_UNITS = ("", "-", "1", "[-]")
"""Entries of a row of units where a column has none."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text log.

    Attributes
    ----------
    names : list of str
        Column names.
    units : dict
        Name → unit, from a row of units below the names.
    delimiter : str or None
        Between columns; None is blanks.
    decimal_comma : bool
        Whether numbers have a decimal comma.
    header : int
        Line number of the names, from 1.
    first : int
        Line number from which numbers are read.
    """

    names: list[str]
    units: dict[str, str]
    delimiter: str | None
    decimal_comma: bool
    header: int
    first: int


def is_number(text: str) -> bool:
    """Return whether a field is a number with a decimal point; an underscore is not one of its digits."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def decimal_points(text: str) -> str:
    """Return a text with decimal points for commas."""
    return text.replace(",", ".")


def split(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line without blanks and quotation marks around them."""
    if delimiter is not None and '"' in line:
        return [
            field.strip().strip("'") for field in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
        ]
    return [field.strip().strip("\"'") for field in line.split(delimiter)]


def find_layout(lines: Sequence[tuple[int, str]]) -> Layout | None:
    """Return the layout of a file that begins with these lines; None if they are all blank or comments.

    The numbers are the longest run of lines with equally many fields, at least half of them numbers, below a line of
    that many names. Where there is no such run, the first line that is no comment is taken for the names, so that the
    reader's message names what is wrong below it.

    Parameters
    ----------
    lines : sequence of (int, str)
        Line numbers, from 1, and lines that are not blank.
    """
    best: tuple[tuple[int, int], Layout] | None = None
    for delimiter in _DELIMITERS:
        for start, end, width in _runs(lines, delimiter):
            layout = _with_names(lines, start, end, width, delimiter)
            score = (end - start, width)  # of two readings of the same lines, the one with more columns
            if layout is not None and (best is None or score > best[0]):
                best = (score, layout)
    return _first_line(lines) if best is None else best[1]


def _runs(lines: Sequence[tuple[int, str]], delimiter: str | None) -> list[tuple[int, int, int]]:
    """Return runs of rows of numbers with equally many fields: indices of first and behind the last, fields."""
    runs: list[tuple[int, int, int]] = []
    for i, (_, line) in enumerate(lines):
        width = 0 if _is_comment(line) else _row_width(line, delimiter)
        if width and runs and runs[-1][1] == i and runs[-1][2] == width:
            runs[-1] = (runs[-1][0], i + 1, width)
        elif width:
            runs.append((i, i + 1, width))
    return runs


def _row_width(line: str, delimiter: str | None) -> int:
    """Return the number of fields of a row of numbers, 0 if at least half of them are not."""
    fields = split(line.strip(" \r\n"), delimiter)
    numbers = sum(is_number(decimal_points(field)) for field in fields)
    return len(fields) if 2 * numbers >= len(fields) else 0


def _with_names(
    lines: Sequence[tuple[int, str]], start: int, end: int, width: int, delimiter: str | None
) -> Layout | None:
    """Return the layout of a run below its names, and perhaps a row of units; None without them."""
    above: list[tuple[int, list[str]]] = []
    for number, line in reversed(lines[:start]):
        fields = _names(line, delimiter)
        if len(fields) == width and not all(map(is_number, fields)):
            above.append((number, fields))
        elif not _is_comment(line):
            break
    if not above:
        return None
    has_units = len(above) > 1 and _is_row_of_units(above[0][1])
    header, names = above[1 if has_units else 0]
    units = dict(zip(names, above[0][1], strict=True)) if has_units else {}
    rows = [split(line, delimiter) for _, line in lines[start:end]]
    comma = delimiter != "," and any("," in field for row in rows for field in row if is_number(decimal_points(field)))
    stated = {name: unit.strip("[]()") for name, unit in units.items() if unit not in _NO_UNITS}
    return Layout(names, stated, delimiter, comma, header, lines[start][0])


def _first_line(lines: Sequence[tuple[int, str]]) -> Layout | None:
    known = [(number, line) for number, line in lines if not _is_comment(line)] or list(lines)
    if not known:
        return None
    number, line = known[0]
    delimiter = next((mark for mark in _DELIMITERS if mark and mark in line), None)
    names = _names(line, delimiter)
    return Layout(names, {}, delimiter, False, number, number + 1)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(COMMENTS)


def _names(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of a line of names; a leading comment mark is how numpy.savetxt and MATLAB write theirs."""
    line = line.strip(" \r\n")
    for mark in COMMENTS:
        line = line.removeprefix(mark)
    return split(line.strip(" "), delimiter)


def _is_row_of_units(fields: Sequence[str]) -> bool:
    texts = [field.strip("[]()").strip() for field in fields]
    known = [bool(position_unit(text) or time_unit(text) or "/" in text) for text in texts]
    blank = [plain_name(text) in _NO_UNITS for text in texts]
    return any(known) and all(a or b for a, b in zip(known, blank, strict=True))
