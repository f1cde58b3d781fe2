"""Columns of Arrow's record batches as arrays of numbers, for the formats that pyarrow reads."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..base.errors import LogError, brief
from ..base.signals import Array
from .extras import library, reading
from .source import Block, Source, sample_number

__all__ = ["ArrowColumnsSource"]

_UNIT_KEYS = (b"unit", b"units")
"""Keys of a field's metadata under which its unit may stand."""

_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Durations, s, of the units of Arrow's timestamps."""


class ArrowColumnsSource(Source):
    """Columns of a file that pyarrow reads batch by batch; fields of structs are ``struct.field``.

    Nothing in the place of a number is NaN; timestamps and times of day become seconds since the first one.

    Attributes
    ----------
    article : str
        The format's name with its article, for messages.
    """

    article: ClassVar[str]

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._arrow = library(path, "pyarrow", "parquet", self.article)
        with self._reading():
            self._leaves = {".".join(place): (place, field) for place, field in self._found(self._schema(), ())}
        types = self._arrow.types
        self.names = list(self._leaves)
        self.stamps = frozenset(
            name
            for name, (_, field) in self._leaves.items()
            if types.is_timestamp(field.type) or types.is_time(field.type)
        )
        self.units = {
            name: (field.metadata or {})[key].decode(errors="replace")
            for name, (_, field) in self._leaves.items()
            for key in _UNIT_KEYS
            if (field.metadata or {}).get(key)
        }

    @abstractmethod
    def _schema(self) -> Any:
        """Return the file's schema."""

    @abstractmethod
    def _batches(self, columns: Sequence[str], n: int) -> Iterator[Any]:
        """Iterate over record batches with at least the columns of these names, about ``n`` rows each."""

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        firsts: dict[str, int] = {}
        start = 0
        with self._reading():
            for batch in self._batches(names, n):
                for i in range(0, batch.num_rows, n):
                    part = batch.slice(i, n)
                    yield Block([self._numbers(part, name, firsts) for name in names], sample_number(start))
                    start += part.num_rows

    def _found(self, fields: Any, above: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
        """Yield the fields that hold no others, each with its place."""
        for field in fields:
            place = (*above, field.name)
            if self._arrow.types.is_struct(field.type):
                yield from self._found([field.type.field(i) for i in range(field.type.num_fields)], place)
            else:
                yield place, field

    def _numbers(self, batch: Any, name: str, firsts: dict[str, int]) -> Array:
        """Return a column of a batch."""
        (top, *fields), _ = self._leaves[name]
        values = batch.column(batch.schema.get_field_index(top))
        values.validate(full=True)  # what a damaged file holds may point anywhere
        for field in fields:
            values = values.field(field)
        kind, types = values.type, self._arrow.types
        if name in self.stamps:
            return self._seconds(values, name, firsts)
        if types.is_decimal(kind):
            values = values.cast(self._arrow.float64())
        elif not (types.is_integer(kind) or types.is_floating(kind)):
            raise LogError(f"{self.path}: column {brief(name)} must be numbers, got {kind}")
        found: Array = np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)
        return found

    def _seconds(self, values: Any, name: str, firsts: dict[str, int]) -> Array:
        """Return timestamps as seconds since the first one, NaN where there is none."""
        ticks = values.cast(self._arrow.int32() if values.type.bit_width == 32 else self._arrow.int64())
        numbers = np.asarray(ticks.fill_null(0).to_numpy(zero_copy_only=False), dtype=np.int64)
        first = firsts.setdefault(name, int(numbers[0]))
        found = np.asarray((numbers - first) * _TICKS[values.type.unit], dtype=np.float64)
        found[np.asarray(values.is_null())] = np.nan
        return found

    def _reading(self) -> AbstractContextManager[None]:
        """Turn what pyarrow raises into LogError."""
        errors = (self._arrow.ArrowException, OSError, ValueError, KeyError, TypeError)
        return reading(self.path, self.article, errors=errors)
