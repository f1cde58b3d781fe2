"""Named arrays: in memory, or in files, NumPy's ``.npz``, MATLAB's ``.mat`` up to version 7, and Parquet."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from .source import ArraysSource, past_midnights

_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Durations, s, of the units of Arrow's times."""

_OWN = (TypeError, AttributeError, LookupError)
"""Errors whose messages tell of the library's own names."""


@contextmanager
def _reading(path: Path, format_: str, what: str = "") -> Iterator[None]:
    """Turn what a library raises into a LogError on ``what`` of a file, all of it if left out, and why.

    A damaged file may fail in every way there is; one that declares more than it has, for want of memory.
    """
    try:
        yield
    except LogError:
        raise
    except Exception as error:
        name = type(error).__name__
        why = name if isinstance(error, _OWN) else first_line(f"{name}: {error}")
        subject = f"{what} is" if what else "is"
        raise LogError(f"{path}: {subject} truncated, damaged or not {format_}: {why}") from error


def _check(path: Path, name: str, values: NDArray[Any]) -> None:
    """Raise LogError unless the values of a column are real numbers, in a vector, one row or one column."""
    shape, dtype = values.shape, values.dtype
    if dtype.kind == "c":
        raise LogError(f"{path}: column {brief(name)} must be real, got complex numbers ({dtype})")
    if dtype.kind not in "fiu":
        hint = "; save (t - t[0]) / numpy.timedelta64(1, 's') in its place" if dtype.kind == "M" else ""
        raise LogError(f"{path}: column {brief(name)} must be numbers, got {dtype}{hint}")
    if len(shape) != 1 and not (len(shape) == 2 and {0, 1}.intersection(shape)):
        raise LogError(f"{path}: column {brief(name)} must have shape (n,), (n, 1) or (1, n), got {brief(shape)}")


class TableSource(ArraysSource):
    """Columns in memory: a mapping of arrays, or a table with ``columns``, as pandas and polars have it."""

    format = "columns in memory"
    endings = ()

    def __init__(self, table: Any) -> None:
        super().__init__(Path("arrays"))
        names = getattr(table, "columns", table)
        self._arrays = {str(name): np.asarray(table[name]) for name in names}
        self.names = list(self._arrays)
        self.stamps = frozenset(name for name, values in self._arrays.items() if values.dtype.kind in "Mm")

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return False: it is no file."""
        return False

    def column(self, name: str) -> Array:
        """Return a column's values, of times the seconds since the first one."""
        values = self._arrays[name]
        if name in self.stamps:
            values = (values - values[:1]) / np.timedelta64(1, "s")
        _check(self.path, name, values)
        return values.astype(np.float64).ravel()


class NpzSource(ArraysSource):
    """The arrays of an ``.npz`` file, compressed or not."""

    format = "NumPy .npz"
    endings = (".npz",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with _reading(path, "an .npz file"), path.open("rb") as file, np.load(file) as archive:
            self.names = list(archive.files)

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a zip archive whose first member is an array, as far as that can be seen."""
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return head.startswith(b"PK\x03\x04") and name.endswith(b".npy")

    def column(self, name: str) -> Array:
        """Return an array's values."""
        what = f"column {brief(name)}"
        with _reading(self.path, "an array", what), self.path.open("rb") as file, np.load(file) as archive:
            values = archive[name]
        _check(self.path, name, values)
        return np.asarray(values, dtype=np.float64).ravel()


class MatSource(ArraysSource):
    """The vectors of a ``.mat`` file of version 4, 5, 6 or 7; in structs they are called ``struct.field``.

    A complex vector ``H`` is there as ``H.real`` and ``H.imag`` too.
    """

    format = "MATLAB"
    endings = (".mat",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        from scipy import io  # a quarter of a second, which a text need not wait

        with _reading(path, "a MATLAB file"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of names that occur twice: the last one counts, as in MATLAB
            variables = [item for item in io.loadmat(path).items() if not item[0].startswith("__")]
            self._variables = {name: value for one in variables for name, value in _fields(*one)}
        self.names = list(self._variables)

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it has the text of version 5; version 4 has none, and is known by the file's name."""
        return head.startswith(b"MATLAB 5.0 MAT-file")

    def column(self, name: str) -> Array:
        """Return a variable's values."""
        value = self._variables[name]
        if not isinstance(value, np.ndarray) or value.dtype.names is not None:
            kind = type(value).__name__ if not isinstance(value, np.ndarray) else "structs"
            raise LogError(f"{self.path}: column {brief(name)} must be a full matrix, got {kind}")
        _check(self.path, name, value)
        return value.astype(np.float64).ravel()


def _fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a variable, or what is in it if it is a scalar struct."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names and value.size == 1:
        for field in names:
            yield from _fields(f"{name}.{field}", value[field].reshape(-1)[0])
    else:
        yield name, value
        if getattr(getattr(value, "dtype", None), "kind", "") == "c":  # a frequency response
            yield f"{name}.real", value.real
            yield f"{name}.imag", value.imag


class ParquetSource(ArraysSource):
    """The columns of a Parquet file; fields of structs are ``struct.field``.

    Nothing in the place of a number is NaN. Timestamps, times of day and durations become seconds since the first one.
    """

    format = "Parquet"
    endings = (".parquet", ".pq")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        try:
            self._arrow, self._parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        except ModuleNotFoundError as error:
            raise LogError(
                f"{path}: is a Parquet file, which needs the extra parquet: pip install 'hybridsep[parquet]'"
            ) from error
        with _reading(path, "a Parquet file"), self._parquet.ParquetFile(path) as file:
            schema = self._flat(file.schema_arrow.empty_table()).schema
        types, key = self._arrow.types, (b"unit", b"units")
        temporal = (types.is_timestamp, types.is_time, types.is_duration)
        self.names = list(schema.names)
        self.stamps = frozenset(field.name for field in schema if any(is_one(field.type) for is_one in temporal))
        stated = {field.name: next(filter(None, map((field.metadata or {}).get, key)), b"") for field in schema}
        self.units = {name: unit.decode(errors="replace") for name, unit in stated.items() if unit}

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with Parquet's mark."""
        return head.startswith(b"PAR1")

    def column(self, name: str) -> Array:
        """Return a column."""
        with _reading(self.path, "a Parquet file"), self._parquet.ParquetFile(self.path) as file:
            values = self._flat(file.read(columns=[name])).column(name)
            kind, types = values.type, self._arrow.types
            if name in self.stamps:
                whole = self._arrow.int32() if kind.bit_width == 32 else self._arrow.int64()
                counts = values.cast(whole).to_numpy()
                since = np.asarray((counts - counts[:1]) * _UNITS[kind.unit], dtype=np.float64)
                return past_midnights(since, 86_400.0) if types.is_time(kind) else since
            if types.is_decimal(kind):
                values = values.cast(self._arrow.float64())
            elif not (types.is_integer(kind) or types.is_floating(kind)):
                raise LogError(f"{self.path}: column {brief(name)} must be numbers, got {kind}")
            return np.asarray(values.to_numpy(), dtype=np.float64)

    def _flat(self, table: Any) -> Any:
        """Return a table with the fields of its structs as columns."""
        while any(map(self._arrow.types.is_struct, table.schema.types)):
            table = table.flatten()
        return table
