"""Formats of named arrays that a C library reads whole, in a process of its own.

A damaged file can crash SciPy's reader (99 of 6300 random mutations of a ``.mat`` file did); there that is an error
message.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..base.apart import run_apart
from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from .source import Block, Source, check_column, check_lengths, sample_number

__all__ = ["ArraysSource"]


class _Variable(NamedTuple):
    """Variable of a file.

    Attributes
    ----------
    kind : str
        Its type.
    shape : tuple of int, optional
    dtype : str, optional
        Of an array; else None.
    values : array, optional
        Where it is numeric.
    """

    kind: str
    shape: tuple[int, ...] | None = None
    dtype: str | None = None
    values: Array | None = None


class ArraysSource(Source):
    """Vectors of a file that is read whole, so that its size is limited by the memory.

    Attributes
    ----------
    library : str
        The library that reads it, for messages.
    """

    library: ClassVar[str]

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._variables = self._read()
        self.names = list(self._variables)

    @staticmethod
    @abstractmethod
    def items(file: str) -> Iterator[tuple[str, Any]]:
        """Yield the variables of a file, of any type, by their names."""

    def without_library(self) -> str:
        """Return what to do where the library is not installed."""
        return f"is a {self.format} file; install {self.library} to read it"

    def _read(self) -> dict[str, _Variable]:
        """Return the variables."""
        damaged = f"{self.path}: is truncated, damaged or not a {self.format} file"

        def ended(how: str) -> LogError:
            return LogError(f"{damaged}: {self.library} crashed on it {how}")

        try:
            return run_apart(ended, _variables, type(self), str(self.path.absolute()), quiet=True)
        except ModuleNotFoundError as error:
            raise LogError(f"{self.path}: {self.without_library()}") from error
        except RuntimeError as error:
            raise LogError(f"{damaged}: {error}") from error

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        lengths, columns = {}, []
        for name in names:
            variable = self._variables[name]
            if variable.shape is None:
                raise LogError(f"{self.path}: column {brief(name)} must be a full matrix, got {variable.kind}")
            lengths[name] = check_column(self.path, name, variable.shape, np.dtype(variable.dtype))
            assert variable.values is not None  # by check_column
            columns.append(variable.values.astype(np.float64).ravel())
        check_lengths(self.path, lengths)
        for i in range(0, lengths[names[0]], n):
            yield Block([column[i : i + n] for column in columns], sample_number(i))


def _variables(source: type[ArraysSource], file: str) -> dict[str, _Variable]:
    """Return the variables of a file; RuntimeError with what the library says of a damaged one."""
    try:
        return {name: _variable(value) for name, value in source.items(file)}
    except (MemoryError, ModuleNotFoundError):
        raise
    except Exception as error:  # a damaged file makes both libraries fail in nearly every way there is
        name = type(error).__name__
        if name == "error":  # zlib's, struct's
            name = f"{type(error).__module__}.{name}"
        raise RuntimeError(first_line(f"{name}: {error}")) from None


def _variable(value: Any) -> _Variable:
    if not isinstance(value, np.ndarray):
        return _Variable(type(value).__name__)
    if value.dtype.names is not None:
        return _Variable("structs")
    return _Variable("ndarray", value.shape, str(value.dtype), value if value.dtype.kind in "fiu" else None)
