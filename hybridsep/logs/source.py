"""What every log format gives: named columns, block by block."""

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
    """Some consecutive samples.

    Attributes
    ----------
    columns : list of (m,) array
        One for each name asked for, as the file has them, not checked for NaN; ``m ≥ 1``.
    where : callable
        Names sample ``i`` of the block as a user counts it: a line of the file, or a sample of the log.
    """

    columns: list[Array]
    where: Callable[[int], str]


class Source(Protocol):
    """An open log format.

    Attributes
    ----------
    path : Path
        The file.
    names : list of str
        The columns that are there.
    advice : str
        What to add to a message about a missing column.
    """

    path: Path
    names: list[str]
    advice: str

    def __init__(self, path: Path) -> None: ...

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Give the columns ``names`` from their beginning, at most ``n`` samples at a time."""
        ...


def sample_number(offset: int) -> Callable[[int], str]:
    """Return what names sample ``i`` of a block that begins ``offset`` samples into the log, counted from 1."""
    return lambda i: f"sample {offset + i + 1} (the first is 1)"


def check_column(path: Path, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """Return the number of samples of an array of that shape and type, or say why it is no column."""
    if dtype.kind == "c":
        raise LogError(f"{path}: column {name!r} must be real, got complex numbers ({dtype})")
    if dtype.kind not in "fiu":
        raise LogError(f"{path}: column {name!r} must be numbers, got {dtype}")
    # A column or a row of a matrix is as good as a vector.
    lengths = [length for length in shape if length != 1]
    if len(shape) not in (1, 2) or (len(lengths) > 1 and 0 not in shape):
        raise LogError(f"{path}: column {name!r} must have shape (n,), (n, 1) or (1, n), got {shape}")
    return 0 if 0 in lengths else max(lengths, default=1)


def check_lengths(path: Path, lengths: dict[str, int]) -> None:
    """Say which columns differ in length, if they do."""
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{name!r} has {length}" for name, length in lengths.items())
        raise LogError(f"{path}: all columns must have the same number of samples, got: {text}")
