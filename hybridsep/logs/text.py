"""Streaming reader of delimited text: one line of column names, then numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np

from ..base.errors import LogError
from ..base.signals import Array
from .source import Block

__all__ = ["TextSource"]

_DELIMITERS = (";", "\t", ",")
"""Delimiters by precedence in the line of names; blanks if none occurs."""


class TextSource:
    """Text file with a line of column names, delimited by comma, semicolon, tab or blanks."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with self._open() as file:
                header, self._header_line = _first_line(file)
        except UnicodeDecodeError as error:
            raise LogError(f"{path}: must be text in UTF-8, got byte {error.object[error.start]:#04x}") from None
        if not header:
            raise LogError(f"{path}: the file is empty, a line of column names was expected")
        self._delimiter = next((mark for mark in _DELIMITERS if mark in header), None)
        # A leading # is how numpy.savetxt writes its header.
        self.names = self._split(header.removeprefix("#").strip(" \r\n"))
        no_names = all(_is_number(name) for name in self.names)
        self.advice = f"; line {self._header_line} must hold the column names, it holds numbers" if no_names else ""

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        use = [self.names.index(name) for name in names]
        try:
            with self._open() as file:
                _, line = _first_line(file)
                while lines := list(islice(file, n)):
                    numbers = [line + 1 + i for i, text in enumerate(lines) if not text.isspace()]
                    line += len(lines)
                    if len(numbers) < len(lines):
                        lines = [text for text in lines if not text.isspace()]
                    if lines:
                        yield self._block(lines, numbers, use)
        except UnicodeDecodeError as error:
            byte = error.object[error.start]
            raise LogError(f"{self.path}: must be text in UTF-8, got byte {byte:#04x} after line {line}") from None

    def _open(self) -> IO[str]:
        return self.path.open(encoding="utf-8-sig")

    def _split(self, line: str) -> list[str]:
        return [field.strip().strip("\"'") for field in line.split(self._delimiter)]

    def _block(self, lines: list[str], numbers: list[int], use: list[int]) -> Block:
        mark, expected = self._delimiter, len(self.names)
        widths = [text.count(mark) + 1 for text in lines] if mark else [len(text.split()) for text in lines]
        if min(widths) != expected or max(widths) != expected:
            i = next(i for i, width in enumerate(widths) if width != expected)
            self._convert(lines[i], numbers[i], use)  # a decimal comma is the likelier fault
            raise LogError(
                f"{self.path}, line {numbers[i]}: {expected} columns were expected as in line {self._header_line}, "
                f"got {widths[i]}"
            )
        try:
            values = np.loadtxt(lines, delimiter=mark, usecols=use, comments=None, quotechar='"', ndmin=2)
        except ValueError:
            # Line by line, for the message, or for a notation that only Python's float() accepts.
            rows = [self._convert(text, number, use) for text, number in zip(lines, numbers, strict=True)]
            values = np.array(rows)
        columns: list[Array] = [np.ascontiguousarray(column) for column in values.T]
        return Block(columns, lambda i: f"line {numbers[i]}")

    def _convert(self, text: str, number: int, use: list[int]) -> list[float]:
        """Return the numbers of one line in those of the columns ``use`` that it has."""
        fields, row = self._split(text), []
        for i in use:
            if i < len(fields) and not _is_number(fields[i]):
                field = fields[i]
                hint = "; write decimal points" if _is_number(field.replace(",", ".", 1)) else ""
                came = repr(field) if field else "nothing"
                raise LogError(
                    f"{self.path}, line {number}: column {self.names[i]!r} must be a number, got {came}{hint}"
                )
            row += [float(fields[i])] if i < len(fields) else []
        return row


def _first_line(file: IO[str]) -> tuple[str, int]:
    """Return the first non-blank line, without its line end, and its number; empty if there is none."""
    number = 0
    for number, line in enumerate(file, 1):
        if line.strip():
            return line.rstrip("\r\n"), number
    return "", number


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
