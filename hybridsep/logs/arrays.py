"""Files of named arrays: NumPy's ``.npz``, MATLAB's ``.mat`` up to version 7, and Parquet.

What a file declares is compared with its size before NumPy, SciPy or pyarrow allocates anything.
"""

from __future__ import annotations

import struct
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, ClassVar

import numpy as np
from numpy.lib import format as npy

from ..base.errors import LogError, brief
from ..base.signals import Array
from .extras import library, reading
from .source import ArraysSource, Block, Source, check_column, sample_number

__all__ = ["MatSource", "NpzSource", "ParquetSource"]

_SMALL, _COMPRESSION_MAX = 1 << 28, 100
"""Bytes that any file may declare, and those that it may declare for each of its own: positions, of which the last
digits are noise, never compress so far."""

_COLUMNS = 3
"""Columns that are read of a log."""

_NPY_HEADER_MAX = 10_000
"""Largest header of an array, in bytes, that NumPy reads."""

_MAT4_TYPE_MAX = 4052
"""Largest type of a matrix in a version 4 file, ``1000·machine + 10·precision + kind``."""

_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Durations, s, of the units of Arrow's times."""

_DAY = 86_400


def check_declared(path: Path, n_bytes: int) -> None:
    """Raise LogError if a file declares more than its size can hold."""
    size = path.stat().st_size
    if n_bytes > max(_SMALL, _COMPRESSION_MAX * size):
        raise LogError(
            f"{path}: declares {n_bytes} bytes of values in a file of {size}: is truncated, damaged or made to fill "
            "the memory; save the log again, without compression"
        )


class NpzSource(ArraysSource):
    """The arrays of an ``.npz`` file, compressed or not."""

    format = "NumPy .npz"
    endings = (".npz",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with reading(path, "an .npz file"), zipfile.ZipFile(path) as archive:
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
        with reading(self.path, "an array", f"column {brief(name)}"), zipfile.ZipFile(self.path) as archive:
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

        with reading(path, "a MATLAB file"), warnings.catch_warnings():
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


class ParquetSource(Source):
    """The columns of a Parquet file, streamed row group by row group; fields of structs are ``struct.field``.

    Nothing in the place of a number is NaN. Timestamps, times of day and durations become seconds since the first one.
    """

    format = "Parquet"
    endings: ClassVar[tuple[str, ...]] = (".parquet", ".pq")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._arrow = library(path, "pyarrow", "parquet", "a Parquet file")
        self._parquet = library(path, "pyarrow.parquet", "parquet", "a Parquet file")
        with reading(path, "a Parquet file"), self._file() as file:
            groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
            written = sum(group.column(i).total_uncompressed_size for group in groups for i in range(group.num_columns))
            check_declared(path, max(written, _COLUMNS * 8 * file.metadata.num_rows))  # a value that repeats is one
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

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        clocks = {name: _ArrowClock() for name in names}
        start = 0
        with reading(self.path, "a Parquet file"), self._file() as file:
            columns = list(dict.fromkeys(names))
            for batch in file.iter_batches(batch_size=n, columns=columns, use_threads=False):
                yield Block([self._numbers(batch, name, clocks[name]) for name in names], sample_number(start))
                start += batch.num_rows

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

    def _numbers(self, batch: Any, name: str, clock: _ArrowClock) -> Array:
        """Return a column of a batch."""
        (top, *fields), _ = self._leaves[name]
        values = batch.column(batch.schema.get_field_index(top))
        values.validate(full=True)  # what a damaged file holds may point anywhere
        for field in fields:
            values = values.field(field)
        kind, types = values.type, self._arrow.types
        if name in self.stamps:
            integers = values.cast(self._arrow.int32() if kind.bit_width == 32 else self._arrow.int64())
            ticks = np.asarray(integers.fill_null(0).to_numpy(zero_copy_only=False), dtype=np.int64)
            missing = np.asarray(values.is_null())
            return clock.seconds(ticks, missing, _TICKS[kind.unit], of_day=types.is_time(kind))
        if types.is_decimal(kind):
            values = values.cast(self._arrow.float64())
        elif not (types.is_integer(kind) or types.is_floating(kind)):
            raise LogError(f"{self.path}: column {brief(name)} must be numbers, got {kind}")
        return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)


class _ArrowClock:
    """Arrow's times as seconds since the first one; a time of day passes midnight where it falls by half a day."""

    def __init__(self) -> None:
        self._first: int | None = None
        self._last, self._days = 0.0, 0

    def seconds(self, ticks: np.ndarray[Any, np.dtype[np.int64]], missing: Any, tick: float, *, of_day: bool) -> Array:
        """Return the next times, NaN where there is none."""
        if self._first is None:
            self._first = int(ticks[0])
        found: Array = np.asarray((ticks - self._first) * tick, dtype=np.float64)
        if of_day:
            falls = np.diff(found, prepend=self._last) < -_DAY / 2
            self._last = float(found[-1])
            days = self._days + np.cumsum(falls)
            self._days, found = int(days[-1]), found + _DAY * days
        found[missing] = np.nan
        return found
