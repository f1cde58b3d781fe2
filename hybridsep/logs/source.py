"""Interface of log formats: named columns of one length."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from ..base.errors import LogError, brief
from ..base.signals import Array


@dataclass(frozen=True)
class Block:
    """Samples of columns."""

    # one (m,) for each requested name, as in the file, not checked for NaN, timestamps as seconds since the first one
    columns: list[Array]
    # location of sample ``i`` of the block for messages: a line of the file, or a sample of the log
    where: Callable[[int], str] = lambda i: f"sample {i + 1} (the first is 1)"


class Source(ABC):
    """Open log file; one subclass a format, listed in :mod:`hybridsep.logs.formats`.

    A mapping without another word is by the name of a column; times are of the columns that may be sampled at rates of
    their own, and only those with the same times can be read side by side.
    """

    format: ClassVar[str]  # its name in messages
    endings: ClassVar[tuple[str, ...]]  # usual ones of its files' names; what a file is, its content tells
    marks: ClassVar[tuple[bytes, ...]] = ()  # what its files begin with, where that tells them

    def __init__(self, path: Path) -> None:
        self.path = path
        self.names: list[str] = []  # available columns
        # further columns of the same name, under names of their own, Time#2
        self.twins: Mapping[str, Sequence[str]] = {}
        self.units: Mapping[str, str] = {}  # units that the file states, where it does so outside the name
        self.assumed_units: Mapping[str, str] = {}  # units by the format's convention, which a given one overrides
        self.roles: Mapping[str, str] = {}  # "t", "x_d", "x" → the column that the format itself has for it
        self.stamps: Set[str] = frozenset()  # columns of clock timestamps, which become seconds since the first one
        self.times: Mapping[str, str] = {}  # columns of their times
        self.axes: Mapping[str, tuple[str, str]] = {}  # axis → columns of commanded and measured position
        self.axis = ""  # the one that is read without a word of the user's, where it is not the first
        self.remarks: list[str] = []  # what was chosen for the reader that the user may want to change
        # Columns that are read; nothing between two delimiters of the latter stands for NaN
        self.commanded, self.measured = "", ""

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Return whether a file that begins with these bytes, 4 kB if it has as many, is of this format."""
        return head.startswith(cls.marks)

    @abstractmethod
    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``; LogError if they cannot be read, or differ in length."""

    def notes(self) -> list[str]:
        """Return what the last pass over the file left out or filled."""
        return []


class ArraysSource(Source):
    """Columns that are read one at a time."""

    @abstractmethod
    def column(self, name: str) -> Array:
        """Return a column's values."""

    def read(self, names: Sequence[str]) -> Block:
        """Return the columns ``names``; LogError if they cannot be read, or differ in length."""
        columns = [self.column(name) for name in names]
        lengths = {name: len(column) for name, column in zip(names, columns, strict=True)}
        if len(set(lengths.values())) > 1:
            text = ", ".join(f"{brief(name)} has {length}" for name, length in lengths.items())
            raise LogError(f"{self.path}: all columns must have the same number of samples, got: {text}")
        return Block(columns)


def past_midnights(times: Array, day: float) -> Array:
    """Return times of day, ``(n,)``, which pass midnight where they fall by more than half a ``day``."""
    return np.asarray(times + day * np.cumsum(np.diff(times, prepend=times[:1]) < -day / 2))
