"""Formats whose columns lie in records of their own length, each of which is read on its own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from ..base.errors import LogError, brief
from ..base.signals import Array
from .source import Block, Source, check_lengths, sample_number

__all__ = ["RecordsSource"]

_READ = 50_000
"""Samples that are read of a column at once: few calls of a library, and half a megabyte."""


class RecordsSource(Source):
    """Columns of which any stretch can be read.

    Attributes
    ----------
    lengths : dict
        Name of a column → its samples.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.lengths: dict[str, int] = {}

    @abstractmethod
    def _opened(self) -> AbstractContextManager[Any]:
        """Open the file; what its library raises becomes LogError."""

    @abstractmethod
    def _values(self, file: Any, name: str, start: int, n: int) -> Array:
        """Return ``n`` values of a column of the open file from ``start`` on."""

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        check_lengths(self.path, {name: self.lengths[name] for name in names})
        total, most = self.lengths[names[0]], max(n, _READ // n * n)
        with self._opened() as file:
            for start in range(0, total, most):
                size = min(most, total - start)
                columns = [self._checked(file, name, start, size) for name in names]
                for i in range(0, size, n):
                    yield Block([column[i : i + n] for column in columns], sample_number(start + i))

    def _checked(self, file: Any, name: str, start: int, n: int) -> Array:
        values = self._values(file, name, start, n)
        if len(values) != n:
            raise LogError(
                f"{self.path}: column {brief(name)} is truncated: {n} samples were expected from sample {start + 1} "
                f"on, got {len(values)}"
            )
        return values
