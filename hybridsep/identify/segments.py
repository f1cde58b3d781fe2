"""Pieces of recordings without gaps, with the samples that a model is fitted to."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.signals import Array, as_measured, as_samples

__all__ = ["Segment", "as_segments", "delayed", "in_time", "motion_split"]

SAMPLES_MAX = 60_000
"""Samples that are used of long recordings: the parts in which the axis moves most."""

PIECE = 6_000
"""Samples of one part of a long recording."""


@dataclass(frozen=True)
class Segment:
    """Consecutive samples, relative to the first command.

    Attributes
    ----------
    u, y : (n,) array, m
        Commanded and measured positions; ``y`` is NaN where it is missing.
    stop : int
        Samples before this one are fitted to.
    """

    u: Array
    y: Array
    stop: int

    @property
    def motion(self) -> Array:
        """Commanded path up to each sample, ``(n,)``, m."""
        return np.concatenate(([0.0], np.cumsum(np.abs(np.diff(self.u)))))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Samples with a measured position, ``(n,)``; the others have no residual."""
        return np.asarray(~np.isnan(self.y))


def as_segments(recordings: Iterable[tuple[ArrayLike, ArrayLike]], samples_max: int = SAMPLES_MAX) -> list[Segment]:
    """Return the segments of pairs ``(x_d, x)``, of long ones the parts with most motion; none without measurements."""
    segments = []
    for x_d, x in recordings:
        u = as_samples(x_d, "x_d")
        y = as_measured(x, "x", len(u))
        segments.append((u, y))
    if sum(len(u) for u, _ in segments) > samples_max:
        segments = _liveliest(segments, samples_max // PIECE)
    return [Segment(u - u[0], y - u[0], len(u)) for u, y in segments if np.count_nonzero(~np.isnan(y)) > 1]


def _liveliest(segments: list[tuple[Array, Array]], n: int) -> list[tuple[Array, Array]]:
    """Return the ``n`` pieces with the largest sum of squared velocity, in their order."""
    pieces = [
        (u[i : i + PIECE], y[i : i + PIECE])
        for u, y in segments
        for i in range(0, len(u), PIECE)
        if len(u) - i > PIECE // 2 or i == 0
    ]
    power = [float(np.sum(np.diff(u) ** 2)) for u, _ in pieces]
    return [pieces[i] for i in sorted(np.argsort(power)[::-1][:n])]


def motion_split(segments: Sequence[Segment], fraction: float) -> list[Segment]:
    """Return the segments with ``stop`` where that fraction of all commanded motion is over; 0 in later ones."""
    total = sum(float(segment.motion[-1]) for segment in segments)
    left = fraction * total
    split = []
    for segment in segments:
        motion = segment.motion
        stop = len(motion) if motion[-1] <= left else int(np.searchsorted(motion, left)) if left > 0 else 0
        split.append(replace(segment, stop=stop))
        left -= float(motion[-1])
    return split


def delayed(u: Array, n: int) -> Array:
    """Return a command ``n`` samples later, at rest at its first value before."""
    if n <= 0:
        return u
    return np.concatenate((np.full(min(n, len(u)), u[0]), u[: max(0, len(u) - n)]))


def in_time(x_d: Array, x: Array, n_late: int) -> tuple[Array, Array]:
    """Return commands and the positions of the same instants, of measurements that are ``n_late`` samples late."""
    return x_d[: max(0, len(x_d) - n_late)], x[n_late:]
