"""Check of the measured position for a limit at which it is clipped."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array, Indices
from ..intake import fixes
from ..logs.log import Log
from .finding import ERROR, NOTE, Finding, Fix, Picture
from .relation import line_at_best_lag, noise_std, shifted
from .samples import resolution

__all__ = ["check_clipped", "filled_by_command"]

_RUN = 5
"""Samples at a limit in a row: fewer are a turning point."""

_KNOWN = 50
"""Samples elsewhere below which nothing is known of the axis."""

_SHARE = 0.01
"""Share of the samples at limits below which nothing is lost."""

_BEYOND, _LEFT = 6.0, 3.0
"""Least distance of the expected motion beyond the limit, relative to the noise, and relative to the error of the
expected motion elsewhere (RMS)."""

_ENDS = 0.5
"""Largest such distance where a run begins and ends, relative to the largest in the run: a clipped position meets its
limit where it would pass it; an axis that sticks or has play stops at its turning point."""

_AT_REST = 0.05
"""Least distance beyond the limit, relative to the travel, of a stretch at the log's beginning or end: an axis at rest
may be off its command by half of its play."""

_RUNS = 0.6
"""Share of the samples at a limit that must be in such runs."""

_CLOSER, _BESIDE = 3.0, (10, 200)
"""Distance beyond the limit, relative to the error of the axis just before and after (RMS, over as many samples as the
run has, within these bounds): an axis that stands by friction or load is off its command by as much before it
stands."""

_FAR = 20.0
"""The same ratio, from which on the axis need not meet its limit at speed: it followed too closely to stand there."""

_LEAST = 0.02
"""Distance beyond the limit, relative to the travel, below which a stretch tells nothing: corners of a command are
rounded."""

_SPEED, _STEPS = 0.3, 3
"""Least speed with which the position meets and leaves the limit, relative to its largest nearby; and samples over
which a speed is taken."""

_TIMES = 3
"""Separate times at one limit from which it is the sensor's limit: an axis may stop twice at one place by chance."""

_REACH, _TAPS = 400, 20
"""Past samples of the command that a position is fitted to, and number of means that they are reduced to: a swept sine
has another lag at each of its frequencies."""

_RCOND = 1e-4
"""Smallest singular value of that regression, relative to the largest, that is kept: directions that the motion hardly
excites would give arbitrary values beyond the limit."""

_ROWS = 50_000
"""Samples, evenly spread, that the expected motion is fitted to at most."""


@dataclass(frozen=True)
class _Limit:
    """Limit at which a position stays while its command, and so the axis, goes beyond it.

    ``begins`` and ``ends``, (m,), are the stretches' in samples; ``sharp``, (m,), says which the axis met at speed
    after it had followed closer.
    """

    value: float
    begins: Indices
    ends: Indices
    sharp: NDArray[np.bool_]


def check_clipped(log: Log, bridged: int = 1) -> Iterator[Finding]:
    """Find a measured position that stays at one limit while its command, and so the axis, goes beyond it.

    An axis that stands by friction or load, short of its command, stays at one place too, again and again where its
    command repeats. So a log is refused only where the position stays at two limits, or many times at one, and had
    followed closer before; anything less is a note.

    Parameters
    ----------
    log : Log
        Without missing measurements.
    bridged : int
        0 if the fix must not leave measurements missing; it cuts them out then.
    """
    found = _clipped(log)
    if not found:
        return
    begins, ends = (np.sort(np.concatenate([getattr(one, edge) for one in found])) for edge in ("begins", "ends"))
    n = int((ends - begins).sum())
    if n < _SHARE * len(log.t):
        return
    where = np.concatenate([np.arange(begin, end) for begin, end in zip(begins, ends, strict=True)])
    factor, unit = log.shown.position
    n_sharp = [int(one.sharp.sum()) for one in found]
    limits = " and ".join(f"{factor * one.value:.6g}" for one in found)
    stretches = f"{len(begins)} stretch{'es' if len(begins) > 1 else ''}"
    first = f"the first is sample {begins[0] + 1}, t = {log.t[begins[0]]:.6g} s"
    much = f"{n} of {len(log.t)} samples ({100 * n / len(log.t):.2g} %)"
    evidence = {
        "n": float(n),
        "share": n / len(log.t),
        "n_stretches": float(len(begins)),
        "n_sharp": float(sum(n_sharp)),
    }
    t = log.t - log.t[0]
    lines = {"commanded": (t, factor * log.x_d), "measured": (t, factor * log.x_meas)}
    picture = Picture("Measured position at its limits", "time [s]", f"position [{unit}]", lines, t[where])
    if max(n_sharp) < _TIMES and (len(found) < 2 or min(n_sharp) == 0):
        words = (
            f"the measured position stays at {limits} {unit} in {much} and {stretches} while its command goes further; "
            f"{first}: an axis that stands by friction or load does so, and so does a position that is clipped, by the "
            "sensor or the recorder; where it is, leave these samples out"
        )
        yield Finding("clipped", NOTE, words, evidence, picture)
        return
    words = (
        f"the measured position is clipped at {limits} {unit} in {much} and {stretches}, where the command goes beyond "
        f"and the axis had followed closer before: a limit of the sensor, of its signal or of the recorder; {first}"
    )
    if bridged:
        fix = Fix("treat the clipped samples as missing", partial(fixes.missing_at, where=where))
    else:
        fix = Fix(
            "cut out the clipped samples and treat the rest as separate segments",
            partial(fixes.cut_out, begins=begins, ends=ends),
        )
    yield Finding("clipped", ERROR, words, evidence, picture, fix)


def filled_by_command(log: Log) -> Log:
    """Interpolate the difference of measured and expected motion where missing; the position itself if few are known.

    A straight line across what was clipped would look as clipped.
    """
    known = np.isfinite(log.x_meas)
    straight = fixes.without_missing(log)
    if known.all() or known.sum() < _KNOWN:
        return straight
    expected = _expected(log.x_d, straight.x_meas, known)
    difference = np.where(known, log.x_meas - expected, np.nan)
    return replace(log, x_meas=fixes.without_missing(replace(log, x_meas=difference)).x_meas + expected)


def _clipped(log: Log) -> list[_Limit]:
    """Return the limits at which the position stays while the expected motion goes beyond."""
    x, noise = log.x_meas, max(noise_std(log.x_meas), 1e-12 * float(np.ptp(log.x_meas)))
    sides = {side: (limit, *_stretches(side * (limit - x) <= _near(x, limit, noise))) for side, limit in _limits(x)}
    held = np.zeros(len(x), dtype=np.bool_)
    for _, begins, ends in sides.values():
        for begin, end in zip(begins, ends, strict=True):
            held[max(begin - 1, 0) : end + 1] = True
    if not held.any() or (~held).sum() < _KNOWN:
        return []
    expected = _expected(log.x_d, x, ~held)
    left = float(np.sqrt(np.mean((x - expected)[~held] ** 2)))
    least = max(_BEYOND * noise, _LEFT * left, 4 * resolution(x))
    found = []
    for side, (limit, begins, ends) in sides.items():
        stretches = list(zip(begins.tolist(), ends.tolist(), strict=True))
        passes = np.array([_passes(side * (expected - limit), *one, least) for one in stretches], dtype=np.bool_)
        beyond = np.array([float((side * (expected - limit))[slice(*one)].max()) for one in stretches])
        fast = np.array([_is_fast(side * x, *one) for one in stretches], dtype=np.bool_)
        stays = passes | (fast & (beyond > max(_BEYOND * noise, 4 * resolution(x), _LEAST * float(np.ptp(x)))))
        if stays.any() and (ends - begins)[stays].sum() > _RUNS * (ends - begins).sum():
            closer = np.array([_followed_closer(side * x, side * expected, held, *one) for one in stretches])
            sharp = passes & (closer > _CLOSER) & (fast | (closer > _FAR))
            found.append(_Limit(limit, begins[stays], ends[stays], sharp[stays]))
    return found


def _limits(x: Array) -> tuple[tuple[float, float], ...]:
    """Return the sides, 1 and -1, and the largest and the smallest value."""
    return (1.0, float(x.max())), (-1.0, float(x.min()))


def _passes(beyond: Array, begin: int, end: int, least: float) -> bool:
    """Return whether the expected motion meets the limit where a run begins, passes it, and meets it where it ends."""
    peak = float(beyond[begin:end].max())
    whole = begin == 0 and end == len(beyond)
    least = max(least, _AT_REST * float(np.ptp(beyond))) if begin == 0 or end == len(beyond) else least
    meets = (begin == 0 or beyond[begin] < _ENDS * peak) and (end == len(beyond) or beyond[end - 1] < _ENDS * peak)
    return peak > least and meets and not whole


def _is_fast(x: Array, begin: int, end: int) -> bool:
    """Return whether a position, whose upper limit it is, meets and leaves it at speed, as far as the log goes."""
    sides = _beside(len(x), begin, end)
    for beside, way in sides:
        speed = way * (x[beside][_STEPS:] - x[beside][:-_STEPS])
        if (speed[-1] if way > 0 else speed[0]) <= _SPEED * float(np.abs(speed).max()):
            return False
    return bool(sides)


def _followed_closer(x: Array, expected: Array, held: NDArray[np.bool_], begin: int, end: int) -> float:
    """Return how far the command goes beyond an upper limit, relative to the axis' error just before and after (RMS).

    0 where that is too little of the travel to tell anything. ``held``, (n,), are the samples in runs at limits.
    """
    peak = float((expected - x)[begin:end].max())
    if peak < _LEAST * float(np.ptp(x)):
        return 0.0
    missed = [(x - expected)[beside][~held[beside]] for beside, _ in _beside(len(x), begin, end)]
    known = [float(np.mean(one**2)) for one in missed if one.size]
    return peak / max(math.sqrt(max(known)), 1e-300) if len(known) == len(missed) > 0 else 0.0


def _beside(n: int, begin: int, end: int) -> list[tuple[slice, float]]:
    """Return the samples before and after a run in a log of n, and the way to the limit; none where there are few."""
    width = min(max(end - begin, _BESIDE[0]), _BESIDE[1])
    before = [(slice(max(begin - width, 0), begin + 1), 1.0)] if begin >= _BESIDE[0] else []
    return before + ([(slice(end - 1, end + width), -1.0)] if end <= n - _BESIDE[0] else [])


def _near(x: Array, limit: float, noise: float) -> float:
    """Return the distance from a limit within which values are at it: none if several are it, else the noise's."""
    return 1e-9 * float(np.ptp(x)) if np.count_nonzero(x == limit) >= _RUN else _BEYOND * noise


def _expected(x_d: Array, x: Array, known: NDArray[np.bool_]) -> Array:
    """Return the motion that the command makes, by a linear regression on its past over the samples that are known."""
    lag = line_at_best_lag(x_d, x, known).lag
    rows = np.flatnonzero(known)[:: 1 + np.count_nonzero(known) // _ROWS]
    matrix = np.stack([mean[rows] for mean in _means(x_d, lag)], axis=1)
    centre, offset = matrix.mean(axis=0), float(x[rows].mean())
    weights = np.linalg.lstsq(matrix - centre, x[rows] - offset, rcond=_RCOND)[0]
    expected = np.full(len(x), offset)
    for weight, mean, middle in zip(weights, _means(x_d, lag), centre, strict=True):
        expected += weight * (mean - middle)
    return expected


def _means(x_d: Array, lag: float) -> Iterator[Array]:
    """Yield the command, (n,), at a lag, and how far its means over stretches of the past are from that."""
    at_lag = shifted(x_d, lag)
    yield at_lag
    edges = np.unique(np.round(np.geomspace(1, _REACH + 1, _TAPS)).astype(np.intp)) - 1
    sums = np.concatenate(([0.0], np.cumsum(np.concatenate((np.full(edges[-1], x_d[0]), x_d)) - x_d[0])))
    n = len(x_d)
    for near, far in itertools.pairwise(edges.tolist()):
        # Mean of x_d(k − far + 1) … x_d(k − near)
        high = sums[edges[-1] + 1 - near : edges[-1] + 1 - near + n]
        low = sums[edges[-1] + 1 - far : edges[-1] + 1 - far + n]
        yield (high - low) / (far - near) + x_d[0] - at_lag


def _stretches(mask: NDArray[np.bool_]) -> tuple[Indices, Indices]:
    """Return where runs of at least :data:`_RUN` samples begin and end."""
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - begins >= _RUN
    return begins[long], ends[long]
