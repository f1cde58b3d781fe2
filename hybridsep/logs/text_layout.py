"""Layout of a text log: where its names and numbers are among preamble, comments and units, and what delimits them."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from .timestamps import stamp_kind
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
    clocks : mapping
        Index of a column of timestamps with a time of day → index of the column with their dates, None if they hold
        them or there are none.
    """

    names: list[str]
    units: dict[str, str]
    delimiter: str | None
    decimal_comma: bool
    header: int
    first: int
    clocks: Mapping[int, int | None]


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

    The numbers are the longest run of lines with equally many fields, at least half of them numbers where timestamps
    are not counted, below a line of that many names. Where there is no such run, the first line that is no comment is
    taken for the names, so that the reader's message names what is wrong below it.

    Parameters
    ----------
    lines : sequence of (int, str)
        Line numbers, from 1, and lines that are not blank.
    """
    best: tuple[tuple[int, int], Layout] | None = None
    for delimiter in _DELIMITERS:
        for start, end, width in _runs(lines, delimiter):
            layout = _with_names(lines, start, end, width, delimiter)
            if layout is None:
                continue
            # Of two readings of the same lines, the one with more columns; that blanks divide a timestamp makes none
            divided = delimiter is None and any(date is not None for date in layout.clocks.values())
            score = (end - start, width - divided)
            if best is None or score > best[0]:
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
    """Return the number of fields of a row of numbers, 0 if more than half of them are neither that nor timestamps."""
    fields = split(line.strip(" \r\n"), delimiter)
    others = [text for text in fields if not is_number(decimal_points(text))]
    numbers = len(fields) - len(others)
    return len(fields) if numbers and numbers >= sum(not stamp_kind(text) for text in others) else 0


def _with_names(
    lines: Sequence[tuple[int, str]], start: int, end: int, width: int, delimiter: str | None
) -> Layout | None:
    """Return the layout of a run below its names, and perhaps a row of units; None without them."""
    rows = [split(line.strip(" \r\n"), delimiter) for _, line in lines[start:end]]
    kinds = [_kind([row[i] for row in rows]) for i in range(width)]
    above: list[tuple[int, list[str]]] = []
    for number, line in reversed(lines[:start]):
        fields = _names(line, delimiter)
        if delimiter is None and len(fields) == width - 1 and ("date", "time") in pairwise(kinds):
            i = list(pairwise(kinds)).index(("date", "time"))  # one name for both
            fields = [*fields[:i], f"{fields[i]} (date)", *fields[i:]]
        if len(fields) == width and not all(map(is_number, fields)) and not any(map(stamp_kind, fields)):
            above.append((number, fields))
        elif not _is_comment(line):
            break
    if not above:
        return None
    numeric = [i for i in range(width) if not kinds[i]]  # hh:mm:ss may stand above timestamps, or anything else
    has_units = len(above) > 1 and _is_row_of_units([above[0][1][i] for i in numeric])
    header, names = above[1 if has_units else 0]
    units = dict(zip(names, above[0][1], strict=True)) if has_units else {}
    comma = delimiter != "," and any("," in field for row in rows for field in row if is_number(decimal_points(field)))
    stated = {name: unit.strip("[]()") for name, unit in units.items() if unit not in _NO_UNITS}
    return Layout(names, stated, delimiter, comma, header, lines[start][0], _clocks(kinds))


def _kind(cells: Sequence[str]) -> str:
    """Return which timestamps most cells of a column are, empty if they are none."""
    ((kind, n),) = Counter(map(stamp_kind, cells)).most_common(1)
    return kind if 2 * n > len(cells) else ""


def _clocks(kinds: Sequence[str]) -> dict[int, int | None]:
    """Return the columns with a time of day, each with the column beside it that holds the dates."""
    clocks: dict[int, int | None] = {}
    for i, kind in enumerate(kinds):
        beside = [j for j in (i - 1, i + 1) if kind == "time" and 0 <= j < len(kinds) and kinds[j] == "date"]
        if "time" in kind:
            clocks[i] = beside[0] if beside else None
    return clocks


def _first_line(lines: Sequence[tuple[int, str]]) -> Layout | None:
    known = [(number, line) for number, line in lines if not _is_comment(line)] or list(lines)
    if not known:
        return None
    number, line = known[0]
    delimiter = next((mark for mark in _DELIMITERS if mark and mark in line), None)
    names = _names(line, delimiter)
    return Layout(names, {}, delimiter, False, number, number + 1, {})


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
