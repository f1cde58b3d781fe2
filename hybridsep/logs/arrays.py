"""Named arrays: in memory, or in files, NumPy's ``.npz``, MATLAB's ``.mat`` up to version 7, and Parquet."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import LogError, SignalError, brief, first_line
from ..base.signals import Array, Given, check_same_index, given_column, index_values
from .names import known_names
from .source import ArraysSource, Block, past_midnights
from .text import with_own_names
from .units import TIME_UNITS


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
        is_own = isinstance(error, TypeError | AttributeError | LookupError)  # whose messages tell of its own names
        why = name if is_own else first_line(f"{name}: {error}")
        subject = f"{what} is" if what else "is"
        raise LogError(f"{path}: {subject} truncated, damaged or not {format_}: {why}") from error


def _by_columns(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Return arrays with the columns of a matrix, whose longer side are samples, as ``name[0]``, ``name[1]``."""
    found: dict[str, Any] = {}
    for name, values in arrays.items():
        is_array = (isinstance(values, np.ndarray) and values.dtype.names is None) or hasattr(values, "dims")
        if is_array and values.ndim == 2 and min(values.shape) > 1:
            columns = values.T if values.shape[0] >= values.shape[1] else values
            found |= {f"{name}[{j}]": columns[j] for j in range(len(columns))}
        else:
            found[name] = values
    return found


class GivenSource(ArraysSource):
    """Columns in memory; of times the seconds since the first one."""

    def __init__(self, path: Path, arrays: Mapping[str, Any]) -> None:
        super().__init__(path)
        self._given: dict[str, Given] = {}
        self._refused: dict[str, LogError] = {}  # said where it is read
        for name, values in _by_columns(arrays).items():
            try:
                if isinstance(values, LogError):
                    raise values
                self._given[name] = given_column(values)
            except LogError as error:
                self._refused[name] = error
            except (TypeError, ValueError, OverflowError) as error:
                self._refused[name] = LogError(f"{path}: column {brief(name)} must be numbers: {first_line(error)}")
        self.names = [*self._given, *self._refused]
        self.units = {name: one.unit for name, one in self._given.items() if one.unit}
        self.stamps = frozenset(name for name, one in self._given.items() if one.values.dtype.kind in "mM")

    def column(self, name: str) -> Array:
        """Return a column's values."""
        if name in self._refused:
            raise self._refused[name]
        values = self._given[name].values
        if name in self.stamps:
            values = (values - values[:1]) / np.timedelta64(1, "s")
        shape, dtype, must = values.shape, values.dtype, f"{self.path}: column {brief(name)} must"
        if dtype.kind == "c":
            raise LogError(f"{must} be real, got complex numbers ({dtype})")
        if dtype.kind not in "fiu":
            raise LogError(f"{must} be numbers, got {dtype}")
        if len(shape) != 1 and not (len(shape) == 2 and {0, 1}.intersection(shape)):
            raise LogError(f"{must} have shape (n,), (n, 1) or (1, n), got {brief(shape)}")
        return values.astype(np.float64).ravel()


class TableSource(GivenSource):
    """A mapping of arrays, a structured array, or a table of pandas, polars, Arrow or xarray.

    An index of times is the time, unless a column is called so; one of numbers tells where rows are missing.
    """

    def __init__(self, table: Any, path: Path = Path("arrays")) -> None:
        if callable(getattr(type(table), "collect", None)):  # polars' LazyFrame
            table = table.collect()
        super().__init__(path, _columns_of(table))
        if hasattr(type(table), "column_names"):  # Arrow
            stated = ((one.name, one.metadata or {}) for one in table.schema)
            units = {name: (of.get(b"unit") or of.get(b"units", b"")).decode(errors="replace") for name, of in stated}
            self.units = {**self.units, **{name: unit for name, unit in units.items() if unit}}
            self.twins = with_own_names(table.column_names)[1]
        try:
            check_same_index(**self._given)
        except SignalError as error:
            raise LogError(f"{self.path}: {error}") from None
        own = getattr(table, "index", None)
        index = next((one.index for one in self._given.values() if one.index is not None), own)
        if index is not None and not callable(index) and not known_names("t", self.names):
            self._add_time(index)

    def _add_time(self, index: Any) -> None:
        """Take an index for the time: of times or fractions, called so, or numbers some of which are left out."""
        name, labels = str(getattr(index, "name", None) or "index"), index_values(index)
        if getattr(index, "nlevels", 1) > 1:
            raise LogError(f"{self.path}: an index of several levels is not read; reset_index() makes columns of them")
        if len(labels) < 2 or name in self.names:
            return
        if labels.dtype.kind in "iu" and not known_names("t", [name]):
            steps = np.diff(labels.astype(np.int64))
            usual = float(np.median(steps))
            if np.mean(steps < 0) > 0.01:  # tables that were joined begin anew
                raise LogError(f"{self.path}: the index runs backwards; sort_index() puts the rows in their order")
            if usual == 0.0 or (steps == usual).all():
                return
            labels = (labels - labels[0]) / usual
        self._given[name] = Given(labels)
        self.names, self.roles = [*self.names, name], {"t": name}
        if labels.dtype.kind in "mM":
            self.stamps |= {name}


def _columns_of(table: Any) -> dict[str, Any]:
    if hasattr(type(table), "column_names"):  # Arrow
        return dict(zip(with_own_names(table.column_names)[0], table.columns, strict=True))
    fields = getattr(getattr(table, "dtype", None), "names", None)
    if fields is None and hasattr(type(table), "data_vars"):  # xarray
        labels = set(table.indexes) - set(known_names("t", list(map(str, table.indexes))))
        fields = [name for name in (*table.data_vars, *table.coords) if name not in labels]
    return {str(name): table[name] for name in (fields or getattr(table, "columns", table))}


class NpzSource(GivenSource):
    """The arrays of an ``.npz`` file, compressed or not; a column of a matrix is ``name[0]``."""

    format = "NumPy .npz"
    endings = (".npz",)

    def __init__(self, path: Path) -> None:
        arrays: dict[str, Any] = {}
        with _reading(path, "an .npz file"), path.open("rb") as file, np.load(file) as archive:
            for name in archive.files:
                try:
                    with _reading(path, "an array", f"column {brief(name)}"):
                        arrays[name] = archive[name]
                except LogError as error:
                    arrays[name] = error
        super().__init__(path, arrays)
        self.names += [name for i, name in enumerate(archive.files) if name in archive.files[:i]]

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a zip archive whose first member is an array, as far as that can be seen."""
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return head.startswith(b"PK\x03\x04") and name.endswith(b".npy")


class MatSource(GivenSource):
    """The vectors of a ``.mat`` file of version 4, 5, 6 or 7; in structs they are called ``struct.field``.

    A complex vector ``H`` is there as ``H.real`` and ``H.imag`` too, a column of a matrix as ``name[0]``.
    """

    format = "MATLAB"
    endings = (".mat",)
    marks = (b"MATLAB 5.0 MAT-file",)  # of version 5; version 4 has none, and is known by the file's name

    def __init__(self, path: Path) -> None:
        from scipy import io  # a quarter of a second, which a text need not wait

        with _reading(path, "a MATLAB file"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of names that occur twice: the last one counts, as in MATLAB
            variables = [item for item in io.loadmat(path).items() if not item[0].startswith("__")]
        found = {name: value for one in variables for name, value in _fields(*one)}
        for name, value in found.items():
            if not isinstance(value, np.ndarray) or value.dtype.names is not None:
                kind = type(value).__name__ if not isinstance(value, np.ndarray) else "structs"
                found[name] = LogError(f"{path}: column {brief(name)} must be a full matrix, got {kind}")
        super().__init__(path, found)


def _fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a variable, or what is in it if it is a scalar struct."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names and value.size == 1:
        for field in names:
            yield from _fields(f"{name}.{field}", value[field].reshape(-1)[0])
    elif names and value.size < 1000 and "values" in names:  # of Simulink, one for each signal of a scope
        labels = ["".join(map(str, np.ravel(one["label"])[:1])) if "label" in names else "" for one in value.ravel()]
        for i, (label, one) in enumerate(zip(labels, value.ravel(), strict=True)):
            yield from _fields(f"{name}.{label if label and labels.count(label) == 1 else i}", one["values"])
    else:
        yield name, value
        if getattr(getattr(value, "dtype", None), "kind", "") == "c":  # a frequency response
            yield f"{name}.real", value.real
            yield f"{name}.imag", value.imag


class ParquetSource(TableSource):
    """The columns of a Parquet file, read where they are asked for; fields of structs are ``struct.field``.

    Nothing in the place of a number is NaN. Timestamps, times of day and durations become seconds since the first one.
    """

    format = "Parquet"
    endings = (".parquet", ".pq")
    marks = (b"PAR1",)

    def __init__(self, path: Path) -> None:
        try:
            self._parquet = import_module("pyarrow.parquet")
        except ModuleNotFoundError as error:
            raise LogError(f"{path}: is a Parquet file, which needs: pip install 'hybridsep[parquet]'") from error
        with _reading(path, "a Parquet file"), self._parquet.ParquetFile(path) as file:
            super().__init__(_flat(file.schema_arrow.empty_table()), path)

    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``; LogError if they cannot be read."""
        first = {twin: name for name, twins in self.twins.items() for twin in twins}
        with _reading(self.path, "a Parquet file"), self._parquet.ParquetFile(self.path) as file:
            table = _flat(file.read(columns=[first.get(name, name) for name in names]))
            return TableSource(table, self.path).read(names)


def _flat(table: Any) -> Any:
    """Return an Arrow table with the fields of structs as columns, and times of day in seconds since the first one."""
    while any(str(kind).startswith("struct<") for kind in table.schema.types):
        table = table.flatten()
    for i, field in enumerate(table.schema):
        if (kind := str(field.type)).startswith(("time32", "time64")):  # time32[ms]
            counts = table.column(i).cast(f"int{kind[4:6]}").to_numpy()
            seconds = past_midnights(counts * TIME_UNITS[kind[7:-1]].factor, 86_400.0)
            own = import_module("pyarrow").field(field.name, "float64", metadata={"unit": "s"})
            table = table.set_column(i, own, [seconds - seconds[:1]])
    return table
