"""Columns of one file that are sampled at rates of their own: told apart, and resampled onto one of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from ..base.errors import LogError, brief
from ..base.signals import Array
from .columns import Column
from .source import Block, Source

__all__ = ["on_one_clock"]

_BLOCK = 10_000

_GAP = 1.5
"""Intervals of the slower column between two samples of the faster one from which on the latter has a gap."""

_SAME = 1e-6
"""Largest difference of two channels' times, relative to their interval, at which they are the same: rounding."""


@dataclass
class _Clock:
    """Times of a column, as far as they have been seen."""

    n: int = 0
    first: float = 0.0
    last: float = 0.0

    def extend(self, t: Array) -> None:
        self.first = self.first if self.n else float(t[0])
        self.last = float(t[-1])
        self.n += len(t)

    @property
    def interval(self) -> float:
        """Mean interval; infinite of a single sample."""
        return (self.last - self.first) / (self.n - 1) if self.n > 1 else np.inf


def on_one_clock(source: Source, columns: Mapping[str, Column], *, resample: bool) -> tuple[Source, dict[str, Column]]:
    """Return a source whose columns can be read side by side, and the columns.

    Where commanded and measured position have times of their own that differ, both are taken at the times of the one
    that is sampled more slowly, between its first and last time in which there are both; the other is interpolated
    linearly, and refused where it has a gap: nothing is invented between samples.

    Parameters
    ----------
    source : Source
    columns : mapping
        By role.
    resample : bool
        Whether that is done; otherwise times that differ are refused.

    Raises
    ------
    LogError
        If the times differ and are not to be resampled, or cannot be.
    """
    chosen = dict(columns)
    x_d, x = chosen["x_d"].name, chosen["x"].name
    t_d, t = source.times.get(x_d), source.times.get(x)
    if t_d is None or t is None or t_d == t or "t" not in chosen or chosen["t"].name != t_d:
        return source, chosen
    clocks, same = _compared(source, t_d, t)
    if same:
        return source, chosen
    unit = chosen["t"].unit.factor
    rates = f"{brief(x_d)} {_words(clocks[t_d], unit)}, {brief(x)} {_words(clocks[t], unit)}"
    if not resample:
        raise LogError(
            f"{source.path}: columns are sampled at different times: {rates}; record them at one rate, or "
            "resample=True (--resample) takes both at the times of the slower one"
        )
    slow = max((t, t_d), key=lambda name: clocks[name].interval)
    chosen["t"] = Column(slow, chosen["t"].unit, True)
    resampled = _Resampled(source, slow, {x_d: t_d, x: t}, clocks)
    resampled.remarks = [*source.remarks, f"resampled onto the times of the slower column: {rates}"]
    return resampled, chosen


def _compared(source: Source, one: str, other: str) -> tuple[dict[str, _Clock], bool]:
    """Return both columns of times as far as they go, and whether they are the same."""
    clocks, same = {one: _Clock(), other: _Clock()}, True
    both = zip_longest(*((block.columns[0] for block in source.blocks([name], _BLOCK)) for name in (one, other)))
    for a, b in both:
        for name, t in ((one, a), (other, b)):
            if t is not None:
                clocks[name].extend(t)
        if a is None or b is None or len(a) != len(b):
            same = False
        elif same:
            step = min(abs(clocks[one].interval), abs(clocks[other].interval))
            same = bool((np.abs(a - b) <= _SAME * step).all())
    return clocks, same


def _words(clock: _Clock, unit: float) -> str:
    return f"has {clock.n} samples every {unit * clock.interval:.6g} s"


class _Resampled(Source):
    """Columns of a source at the times of one of them."""

    def __init__(self, source: Source, slow: str, times: Mapping[str, str], clocks: Mapping[str, _Clock]) -> None:
        super().__init__(source.path)
        self._source, self._slow, self._times = source, slow, times
        self._begin = max(clock.first for clock in clocks.values())
        self._end = min(clock.last for clock in clocks.values())
        self._gap = _GAP * clocks[slow].interval
        self.names, self.units, self.roles = source.names, source.units, source.roles

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return False: it is no format of files."""
        return False

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        self._source.measured, self._source.may_miss = self.measured, self.may_miss
        slow = [name for name in names if self._times.get(name, self._slow) == self._slow]
        followers = {name: _Follower(self._source, self._times[name], name) for name in names if name not in slow}
        for block in self._source.blocks([self._slow, *slow], n):
            t = block.columns[0]
            inside = np.flatnonzero((t >= self._begin) & (t <= self._end))
            if not len(inside):
                continue
            found = dict(zip(slow, (column[inside] for column in block.columns[1:]), strict=True))
            where = _Where(block, inside)
            for name, follower in followers.items():
                found[name], distances = follower.at(t[inside])
                if distances.max() > self._gap:
                    i = int(np.argmax(distances > self._gap))
                    raise LogError(
                        f"{self.path}, {where(i)}: column {brief(name)} has a gap of {distances[i]:.6g} s there and "
                        "cannot be resampled; record it without, or both columns at one rate"
                    )
            yield Block([found[name] for name in names], where)


@dataclass(frozen=True)
class _Where:
    """Location of sample ``i`` of the samples taken from a block."""

    block: Block
    inside: np.ndarray[tuple[int], np.dtype[np.intp]]

    def __call__(self, i: int) -> str:
        return self.block.where(int(self.inside[i]))


class _Follower:
    """Column that is interpolated at times which arrive in blocks, in constant memory."""

    def __init__(self, source: Source, t: str, name: str) -> None:
        self._path, self._name = source.path, t
        self._blocks = source.blocks([t, name], _BLOCK)
        self._t, self._x = np.empty(0), np.empty(0)

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return the values at the next times, and how far apart the samples are between which they lie."""
        last = float(t.max())
        while not len(self._t) or self._t[-1] < last:
            block = next(self._blocks, None)
            if block is None:
                break
            new = np.concatenate([self._t[-1:], block.columns[0]])
            if not (np.diff(new) > 0.0).all():
                i = int(np.argmin(np.diff(new) > 0.0)) + 1 - len(new) + len(block.columns[0])
                raise LogError(
                    f"{self._path}, {block.where(i)}: time {brief(self._name)} must increase to be resampled"
                )
            self._t, self._x = np.concatenate([self._t, block.columns[0]]), np.concatenate([self._x, block.columns[1]])
        found: Array = np.interp(t, self._t, self._x)
        after = np.minimum(np.searchsorted(self._t, t), len(self._t) - 1)
        between = self._t[after] - self._t[np.maximum(after - 1, 0)]
        distances: Array = np.where(self._t[after] == t, 0.0, between)
        keep = max(int(np.searchsorted(self._t, float(t.min()))) - 1, 0)
        self._t, self._x = self._t[keep:], self._x[keep:]
        return found, distances
