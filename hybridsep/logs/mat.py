"""MATLAB ``.mat`` files up to version 7, loaded whole by SciPy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy import io

from ..errors import LogError
from .source import Block, check_column, check_lengths, sample_number

__all__ = ["MatSource"]


class MatSource:
    """The vectors of a ``.mat`` file; SciPy reads it whole, so its size is limited by the memory."""

    advice = ""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            variables = io.loadmat(path)
        except NotImplementedError:
            raise LogError(
                f"{path}: is a MATLAB v7.3 (HDF5) file; versions up to 7 are read: save it with '-v7' in MATLAB"
            ) from None
        except Exception as error:  # a damaged file makes SciPy's reader fail in nearly every way there is
            raise LogError(f"{path}: is truncated, damaged or not a MATLAB file: {error}") from error
        self._variables = {name: value for name, value in variables.items() if not name.startswith("__")}
        self.names = list(self._variables)

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Give the columns ``names`` from their beginning, at most ``n`` samples at a time."""
        lengths, columns = {}, []
        for name in names:
            value = self._variables[name]
            if not isinstance(value, np.ndarray):
                raise LogError(f"{self.path}: column {name!r} must be a full matrix, got {type(value).__name__}")
            lengths[name] = check_column(self.path, name, value.shape, value.dtype)
            columns.append(value.astype(np.float64).ravel())
        check_lengths(self.path, lengths)
        for i in range(0, lengths[names[0]], n):
            yield Block([column[i : i + n] for column in columns], sample_number(i))
