"""Named arrays: in memory, or in files, NumPy's ``.npz``, MATLAB's ``.mat`` up to version 7, and Parquet.

What a file declares is compared with its size before NumPy, SciPy or pyarrow allocates anything.
"""

from __future__ import annotations

import struct
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from .source import N_COLUMNS, ArraysSource, check_column, check_declared

__all__ = ["MatSource", "NpzSource", "ParquetSource", "TableSource"]

_NPY_HEADER_MAX = 10_000
"""Largest header of an array, in bytes, that NumPy reads."""

_MAT4_TYPE_MAX = 4052
"""Largest type of a matrix in a version 4 file, ``1000·machine + 10·precision + kind``."""

_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Durations, s, of the units of Arrow's times."""

_DAY = 86_400


_OWN = (TypeError, AttributeError, LookupError)
"""Errors whose messages tell of the library's own names."""


@contextmanager
def _reading(path: Path, format_: str, what: str = "") -> Iterator[None]:
    """Turn what a library raises into a LogError on ``what`` of a file, all of it if left out, and why.

    A damaged file may fail in every way there is.
    """
    try:
        yield
    except (MemoryError, LogError):
        raise
    except Exception as error:
        name = type(error).__name__ if type(error).__module__ == "builtins" else _qualified(type(error))
        why = name if isinstance(error, _OWN) else first_line(f"{name}: {error}")
        subject = f"{what} is" if what else "is"
        raise LogError(f"{path}: {subject} truncated, damaged or not {format_}: {why}") from error


def _qualified(kind: type) -> str:
    """Return an exception's name, with its module where it is called error, as zlib's and struct's are."""
    return f"{kind.__module__}.{kind.__name__}" if kind.__name__ == "error" else kind.__name__


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
        check_column(self.path, name, values.shape, values.dtype)
        return values.astype(np.float64).ravel()


class NpzSource(ArraysSource):
    """The arrays of an ``.npz`` file, compressed or not."""

    format = "NumPy .npz"
    endings = (".npz",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with _reading(path, "an .npz file"), zipfile.ZipFile(path) as archive:
            members = archive.namelist()
        self.names = [member.removesuffix(".npy") for member in members if member.endswith(".npy")]

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a zip archive whose first member is an array, as far as that can be seen."""
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return head.startswith(b"PK\x03\x04") and name.endswith(b".npy")

    def column(self, name: str) -> Array:
        """Return an array's values, after its header was compared with the member's size."""
        member = f"{name}.npy"
        with _reading(self.path, "an array", f"column {brief(name)}"), zipfile.ZipFile(self.path) as archive:
            with archive.open(member) as stream:
                shape, dtype = _npy_header(stream)
                n = check_column(self.path, name, shape, dtype)
                there, declared = archive.getinfo(member).file_size - stream.tell(), n * dtype.itemsize
            if declared > there:
                raise LogError(
                    f"{self.path}: column {brief(name)} is truncated: {declared} bytes were expected, got {there}"
                )
            check_declared(self.path, declared)
            with archive.open(member) as stream:
                values = npy.read_array(stream, allow_pickle=False)
        return np.asarray(values, dtype=np.float64).ravel()


def _npy_header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = npy.read_magic(stream)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(stream, max_header_size=_NPY_HEADER_MAX)
    return shape, dtype


class MatSource(ArraysSource):
    """The vectors of a ``.mat`` file of version 4, 5, 6 or 7; in structs they are called ``struct.field``."""

    format = "MATLAB"
    endings = (".mat",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        from scipy import io  # a quarter of a second, which a text need not wait

        with _reading(path, "a MATLAB file"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of names that occur twice: the last one counts, as in MATLAB
            check_declared(path, sum(8 * int(np.prod(shape, dtype=np.float64)) for _, shape, _ in io.whosmat(path)))
            variables = [item for item in io.loadmat(path).items() if not item[0].startswith("__")]
            self._variables = {name: value for one in variables for name, value in _fields(*one)}
        self.names = list(self._variables)

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it has the text of version 5, or the five small integers that begin one of version 4."""
        if head.startswith(b"MATLAB 5.0 MAT-file"):
            return True
        for order in "<>" if len(head) >= 20 else "":
            kind, rows, columns, imaginary, length = struct.unpack(f"{order}5I", head[:20])
            plausible = kind <= _MAT4_TYPE_MAX and rows and columns and imaginary in (0, 1) and 1 < length <= 64
            if plausible and head[19 + length : 20 + length] == b"\0":
                return True
        return False

    def column(self, name: str) -> Array:
        """Return a variable's values."""
        value = self._variables[name]
        if not isinstance(value, np.ndarray) or value.dtype.names is not None:
            kind = type(value).__name__ if not isinstance(value, np.ndarray) else "structs"
            raise LogError(f"{self.path}: column {brief(name)} must be a full matrix, got {kind}")
        check_column(self.path, name, value.shape, value.dtype)
        return value.astype(np.float64).ravel()


def _fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a variable, or what is in it if it is a scalar struct, and the parts of a complex one."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names and value.size == 1:
        for field in names:
            yield from _fields(f"{name}.{field}", value[field].reshape(-1)[0])
    else:
        yield name, value
        if getattr(getattr(value, "dtype", None), "kind", "") == "c":
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
        with _reading(path, "a Parquet file"), self._file() as file:
            groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
            written = sum(group.column(i).total_uncompressed_size for group in groups for i in range(group.num_columns))
            check_declared(path, max(written, N_COLUMNS * 8 * file.metadata.num_rows))  # a value that repeats is one
            self._leaves = {".".join(place): (place, field) for place, field in self._found(file.schema_arrow, ())}
        types = self._arrow.types
        temporal = (types.is_timestamp, types.is_time, types.is_duration)
        self.names = list(self._leaves)
        kinds = {name: field.type for name, (_, field) in self._leaves.items()}
        self.stamps = frozenset(name for name, kind in kinds.items() if any(is_one(kind) for is_one in temporal))
        self.units = {
            name: (field.metadata or {})[key].decode(errors="replace")
            for name, (_, field) in self._leaves.items()
            for key in (b"unit", b"units")
            if (field.metadata or {}).get(key)
        }

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with Parquet's mark."""
        return head.startswith(b"PAR1")

    def column(self, name: str) -> Array:
        """Return a column."""
        (top, *fields), _ = self._leaves[name]
        with _reading(self.path, "a Parquet file"), self._file() as file:
            table = file.read(columns=[name], use_threads=False)
            values = table.column(table.schema.get_field_index(top)).combine_chunks()
            values.validate(full=True)  # what a damaged file holds may point anywhere
            for field in fields:
                values = values.field(field)
            return self._seconds(values) if name in self.stamps else self._numbers(values, name)

    def _file(self) -> Any:
        # A column of a row group is then read in pieces, not at once
        return self._parquet.ParquetFile(self.path, buffer_size=1 << 20, pre_buffer=False)

    def _found(self, fields: Any, above: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
        """Yield the fields that hold no others, each with its place."""
        for field in fields:
            place = (*above, field.name)
            if self._arrow.types.is_struct(field.type):
                yield from self._found([field.type.field(i) for i in range(field.type.num_fields)], place)
            else:
                yield place, field

    def _numbers(self, values: Any, name: str) -> Array:
        """Return an array of numbers, NaN where there is none."""
        kind, types = values.type, self._arrow.types
        if types.is_decimal(kind):
            values = values.cast(self._arrow.float64())
        elif not (types.is_integer(kind) or types.is_floating(kind)):
            raise LogError(f"{self.path}: column {brief(name)} must be numbers, got {kind}")
        return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)

    def _seconds(self, values: Any) -> Array:
        """Return times as seconds since the first one; a time of day passes midnight where it falls by half a day."""
        kind = values.type
        integers = values.cast(self._arrow.int32() if kind.bit_width == 32 else self._arrow.int64()).fill_null(0)
        ticks = np.asarray(integers.to_numpy(zero_copy_only=False), dtype=np.int64)
        found: Array = np.asarray((ticks - ticks[0]) * _TICKS[kind.unit], dtype=np.float64)
        if self._arrow.types.is_time(kind):
            found += _DAY * np.cumsum(np.diff(found, prepend=0.0) < -_DAY / 2)
        found[np.asarray(values.is_null())] = np.nan
        return found
