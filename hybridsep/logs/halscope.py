"""LinuxCNC halscope: its CSV since version 2.9, and the pairs of names and values before.

Both are written by ``write_log_file`` of LinuxCNC's ``src/hal/utils/scope_files.c``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import ClassVar

import numpy as np

from ..base.errors import LogError, brief, listed
from ..base.signals import Array
from .source import Block, Source, line_number
from .text import TextSource, bounded_lines, decimal_points, is_number, split, with_own_names

__all__ = ["HalscopeCsvSource", "HalscopePairsSource"]

_PERIOD = re.compile(rb"(#?)\s*Sampling period is\s+(-?\d{1,18})\s+ns\s")
"""First line, with a number sign in the CSV."""

_TIME = "t"
"""Name of the time column, which is made from the period."""

_COMMANDED, _MEASURED = ("motor-pos-cmd", "pos-cmd"), ("motor-pos-fb", "pos-fb")
"""Ends of the names of HAL pins with positions of a joint, at the motor first: between the two lies the servo."""

_UNIT = "halscope states no unit: positions are in the machine's, which unit='mm' or 'in' (--unit) says"


class _HalscopeSource(Source):
    """What both formats share: the period, and joints by the names of their pins."""

    def _begin(self, path: Path) -> None:
        with path.open("rb") as file:
            match = _PERIOD.match(file.read(200))
        period = int(match[2]) if match else 0
        if period <= 0:
            raise LogError(f"{path}, line 1: the sampling period must be a positive number of ns, got {period}")
        self._period = period / 1e9

    def _end(self, names: Sequence[str]) -> None:
        """Add the time to the columns, and find the joints among them."""
        self.names = [*names, _TIME] if _TIME not in names else list(names)
        self.axes = {}
        for commanded, measured in zip(_COMMANDED, _MEASURED, strict=True):
            for name in names:
                joint = name.removesuffix(f".{commanded}")
                if joint != name and f"{joint}.{measured}" in names:
                    self.axes.setdefault(joint, (name, f"{joint}.{measured}"))
        self.roles = {"t": _TIME}
        self.remarks = [_UNIT]

    def _times(self, n: int) -> Array:
        return self._period * np.arange(n, dtype=np.float64)


class HalscopeCsvSource(_HalscopeSource, TextSource):
    """The channels of halscope's CSV: the period in a comment, names, then numbers between semicolons."""

    format = "LinuxCNC halscope"
    endings: ClassVar[tuple[str, ...]] = (".csv", ".log")

    def __init__(self, path: Path) -> None:
        self._begin(path)
        super().__init__(path)
        with path.open(encoding="utf-8", errors="replace") as file:
            names = split(list(islice(bounded_lines(path, file), 2))[-1].rstrip("\r\n"), ";")
        # Positions and scales of the screen stand in comments between names and numbers
        self._table = replace(self._table, names=names, units={}, header=2)
        own, self.twins = with_own_names(names)
        self.units = {}
        self._end(own)

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with the period in a comment."""
        match = _PERIOD.match(head)
        return match is not None and bool(match[1])

    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``."""
        own = [name for name in names if name != _TIME] or self.names[:1]
        block = super().read(own)
        found = dict(zip(own, block.columns, strict=True))
        t = self._times(len(block.columns[0]))
        return Block([t if name == _TIME else found[name] for name in names], block.where)


class HalscopePairsSource(_HalscopeSource):
    """The channels of halscope's older files: a line a sample, of names and values, with a decimal point or comma.

    The last line was written from behind the samples, as the loop ran to ``n <= samples``; it is left out.
    """

    format = "LinuxCNC halscope"
    endings = (".txt", ".log")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._begin(path)
        first = next(self._lines(), None)
        if first is None:
            raise LogError(f"{path}: lines of names and values were expected below the sampling period, got none")
        fields = first[1].split()
        if len(fields) % 2 or not all(map(is_number, map(decimal_points, fields[1::2]))):
            raise LogError(f"{path}, line {first[0]}: names and values in turn were expected, got {brief(first[1])}")
        self._names = fields[::2]
        # A channel that is off has the name of a null pointer
        self._end([name for i, name in enumerate(self._names) if name != "(null)" and name not in self._names[:i]])

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with the period, in no comment."""
        match = _PERIOD.match(head)
        return match is not None and not match[1]

    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``."""
        use = [2 * self._names.index(name) + 1 for name in names if name != _TIME]
        lines = list(self._lines())[:-1]
        found = iter(self._columns(lines, use))
        columns = [self._times(len(lines)) if name == _TIME else next(found) for name in names]
        return Block(columns, line_number([number for number, _ in lines]))

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Iterate over the lines of samples with their numbers."""
        with self.path.open(encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(bounded_lines(self.path, file), 1):
                if number > 1 and not line.isspace():
                    yield number, line

    def _columns(self, lines: Sequence[tuple[int, str]], use: Sequence[int]) -> list[Array]:
        """Return the fields ``use`` of lines as numbers."""
        rows = []
        for number, line in lines:
            fields = line.split()
            if fields[::2] != self._names or len(fields) % 2:
                raise LogError(
                    f"{self.path}, line {number}: values of {listed(self._names)} in turn were expected, got "
                    f"{brief(line)}"
                )
            try:
                rows.append([float(decimal_points(fields[i])) for i in use])
            except ValueError:
                i = next(i for i in use if not is_number(decimal_points(fields[i])))
                raise LogError(
                    f"{self.path}, line {number}: column {brief(fields[i - 1])} must be a number, got "
                    f"{brief(fields[i])}"
                ) from None
        return list(np.array(rows, dtype=np.float64).reshape(len(rows), len(use)).T)
