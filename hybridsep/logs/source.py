"""Interface of log formats: named columns in blocks of samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..base.errors import LogError
from ..base.signals import Array

__all__ = ["Block", "Source", "check_column", "check_lengths", "sample_number"]


@dataclass(frozen=True)
class Block:
    """Block of consecutive samples.

    Attributes
    ----------
    columns : list of (m,) array
        One for each requested name, as in the file, not checked for NaN; ``m ≥ 1``.
    where : callable
        Location of sample ``i`` of the block for messages: a line of the file, or a sample of the log.
    """

    columns: list[Array]
    where: Callable[[int], str]


class Source(Protocol):
    """Open log file.

    Attributes
    ----------
    path : Path
        The file.
    names : list of str
        Available columns.
    advice : str
        Addition to the message about a missing column.
    """

    path: Path
    names: list[str]
    advice: str

    def __init__(self, path: Path) -> None: ...

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        ...


def sample_number(offset: int) -> Callable[[int], str]:
    """Return the location, for messages, of samples in a block that begins at ``offset``; counted from 1."""
    return lambda i: f"sample {offset + i + 1} (the first is 1)"


def check_column(path: Path, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """Return the number of samples of a column of that shape and type; LogError if it is not one."""
    if dtype.kind == "c":
        raise LogError(f"{path}: column {name!r} must be real, got complex numbers ({dtype})")
    if dtype.kind not in "fiu":
        raise LogError(f"{path}: column {name!r} must be numbers, got {dtype}")
    # Row and column vectors are accepted.
    lengths = [length for length in shape if length != 1]
    if len(shape) not in (1, 2) or (len(lengths) > 1 and 0 not in shape):
        raise LogError(f"{path}: column {name!r} must have shape (n,), (n, 1) or (1, n), got {shape}")
    return 0 if 0 in lengths else max(lengths, default=1)


def check_lengths(path: Path, lengths: dict[str, int]) -> None:
    """Raise LogError if columns differ in length."""
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{name!r} has {length}" for name, length in lengths.items())
        raise LogError(f"{path}: all columns must have the same number of samples, got: {text}")
