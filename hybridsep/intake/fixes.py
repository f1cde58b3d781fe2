"""Changes that put a log right; each returns another log and leaves the given one as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from ..base.signals import Array, Indices
from ..logs.log import Log

__all__ = [
    "begin_at",
    "bridge",
    "cut_at",
    "cut_out",
    "filled",
    "from_error",
    "in_order",
    "inserted",
    "integrated",
    "missing_at",
    "offset_removed",
    "resampled",
    "scaled",
    "shifted_back",
    "swapped",
    "thinned",
    "unwrapped",
    "without_missing",
]


def in_order(log: Log) -> Log:
    """Sort by time and drop samples whose time repeats."""
    _, keep = np.unique(log.t, return_index=True)
    return replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=log.x_meas[keep], starts=(0,))


def filled(log: Log, starts: Indices, lost: Indices, most: int) -> Log:
    """Fill short gaps, and begin a segment behind the others.

    The command is interpolated by cubics that do not overshoot, times are evenly spaced, measurements missing.

    Parameters
    ----------
    log : Log
    starts : (n,) array of int
        Samples behind the gaps.
    lost : (n,) array of int
        Samples missing in each.
    most : int
        Samples in a gap up to which it is filled.
    """
    short = lost <= most
    inserted = np.zeros(len(log.t), dtype=np.intp)
    inserted[starts[short]] = lost[short]
    place = np.arange(len(log.t)) + np.cumsum(inserted)
    k = np.arange(place[-1] + 1)
    x_d, x_meas = log.x_d, np.full(len(k), np.nan)
    x_meas[place] = log.x_meas
    if short.any():
        with np.errstate(over="ignore"):  # a slope of next to nothing has no reciprocal, and is taken as 0
            x_d = PchipInterpolator(place, log.x_d)(k)
        x_d[place] = log.x_d
    begins = {int(place[start]) for start in (*log.starts, *starts[~short])}
    return replace(log, t=np.interp(k, place, log.t), x_d=x_d, x_meas=x_meas, starts=tuple(sorted(begins)))


def inserted(log: Log, starts: Indices, lost: Indices, *, missing: bool) -> Log:
    """Insert rows that are missing although the times go on evenly, and number the times again.

    Parameters
    ----------
    log : Log
    starts, lost : (n,) array of int
        As for :func:`filled`.
    missing : bool
        Whether the measured position is missing there, or interpolated.
    """
    more = filled(log, starts, lost, int(lost.max()))
    rows = np.ones(len(log.t), dtype=np.intp)
    rows[starts] += lost
    later = log.T_s * (np.cumsum(rows) - 1 - np.arange(len(log.t)))
    t = np.repeat(log.t + later, rows)
    t -= log.T_s * (np.repeat(np.cumsum(rows), rows) - 1 - np.arange(len(t)))  # rows before their sample
    more = replace(more, t=t)
    return more if missing else without_missing(more)


def resampled(log: Log) -> Log:
    """Interpolate linearly at multiples of ``T_s``, each segment from its own first time on."""
    parts = []
    for segment in log.segments():
        n = int((segment.t[-1] - segment.t[0]) / log.T_s + 1e-6) + 1
        t = segment.t[0] + log.T_s * np.arange(n)
        x_d, x_meas = (np.interp(t, segment.t, signal) for signal in (segment.x_d, segment.x_meas))
        parts.append(replace(segment, t=t, x_d=x_d, x_meas=x_meas))
    return _joined(log, parts)


def thinned(log: Log, step: int, first: int) -> Log:
    """Keep every ``step``-th sample from ``first`` on, at an interval as much longer."""
    parts = []
    for segment in log.segments():
        keep = slice(first % step, None, step)
        parts.append(replace(segment, t=segment.t[keep], x_d=segment.x_d[keep], x_meas=segment.x_meas[keep]))
    return replace(_joined(log, parts), T_s=log.T_s * step)


def bridge(log: Log, column: str, wrong: Indices) -> Log:
    """Interpolate linearly over the samples ``wrong``, indices, of ``x_d`` or ``x_meas``; missing ones stay missing."""
    signal = getattr(log, column)
    known = ~np.isnan(signal)
    there = known.copy()
    known[wrong] = False
    k = np.arange(len(signal))
    if not known.any():
        return log
    bridged = np.where(there, np.interp(k, k[known], signal[known]), np.nan)
    return replace(log, x_d=bridged) if column == "x_d" else replace(log, x_meas=bridged)


def without_missing(log: Log) -> Log:
    """Interpolate linearly in time over missing measurements; a log without any measurement stays as it is."""
    return replace(log, x_meas=_interpolated(log.t, log.x_meas))


def missing_at(log: Log, where: Indices) -> Log:
    """Take the measured position as missing in the samples ``where``, indices."""
    x_meas = log.x_meas.copy()
    x_meas[where] = np.nan
    return replace(log, x_meas=x_meas)


def cut_at(log: Log, first: Indices) -> Log:
    """Begin a segment at each of the samples ``first``."""
    return replace(log, starts=tuple(sorted({*log.starts, *(int(k) for k in first)})))


def cut_out(log: Log, begins: Indices, ends: Indices) -> Log:
    """Remove the samples ``begins[i]`` to ``ends[i] − 1``, and begin a segment behind each stretch."""
    keep = np.ones(len(log.t), dtype=np.bool_)
    for begin, end in zip(begins, ends, strict=True):
        keep[begin:end] = False
    place: Indices = np.cumsum(keep) - keep
    starts = {int(place[start]) for start in log.starts} | {int(place[end]) for end in ends if end < len(keep)}
    n = int(keep.sum())
    starts = {0, *(start for start in starts if start < n)}
    return replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=log.x_meas[keep], starts=tuple(sorted(starts)))


def begin_at(log: Log, first: int) -> Log:
    """Leave out the samples before ``first``."""
    starts = sorted({0, *(start - first for start in log.starts if start > first)})
    return replace(log, t=log.t[first:], x_d=log.x_d[first:], x_meas=log.x_meas[first:], starts=tuple(starts))


def swapped(log: Log) -> Log:
    """Exchange commanded and measured positions."""
    return replace(log, x_d=_interpolated(log.t, log.x_meas), x_meas=log.x_d)


def integrated(log: Log, column: str, factor: float) -> Log:
    """Integrate a velocity, times ``factor``, from the other column's first position on."""
    other = "x_d" if column == "x_meas" else "x_meas"
    parts = []
    for segment in log.segments():
        velocity = factor * _interpolated(segment.t, getattr(segment, column))
        position = np.concatenate(([0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2))) * log.T_s
        first = _interpolated(segment.t, getattr(segment, other))[0]
        position[np.isnan(getattr(segment, column))] = np.nan
        parts.append(replace(segment, **{column: first + position}))
    return _joined(log, parts)


def scaled(log: Log, factor: float, *, column: str | None = None, unit: str | None = None) -> Log:
    """Multiply a column, or both, by a factor; ``unit`` is the SI unit of both then."""
    columns = ("x_d", "x_meas") if column is None else (column,)
    changed = {name: factor * getattr(log, name) for name in columns}
    return replace(log, **changed, unit=unit or log.unit)


def offset_removed(log: Log, offset: float) -> Log:
    """Subtract an offset from the measured position."""
    return replace(log, x_meas=log.x_meas - offset)


def shifted_back(log: Log, delay: float) -> Log:
    """Advance the measured position by ``delay`` samples, and leave out the ends where it is not known then.

    Fractions of a sample are interpolated by a cubic spline, and missing beside a missing sample.
    """
    parts = []
    for segment in log.segments():
        n, k = len(segment.t), np.arange(len(segment.t), dtype=np.float64)
        inside = (k + delay >= 0) & (k + delay <= n - 1)
        if inside.sum() < 4:
            continue
        at = (k + delay)[inside]
        whole = delay == round(delay)
        before = at.astype(np.intp)
        x = segment.x_meas[before]
        if not whole:
            known = ~np.isnan(segment.x_meas)
            beside = known[before] & known[np.minimum(before + 1, n - 1)]
            x = np.full(len(at), np.nan)
            if beside.any():
                x[beside] = CubicSpline(k[known], segment.x_meas[known])(at[beside])
        parts.append(replace(segment, t=segment.t[inside], x_d=segment.x_d[inside], x_meas=x))
    return _joined(log, parts)


def _interpolated(t: Array, signal: Array) -> Array:
    """Return a signal with what is NaN interpolated linearly in time, unless all of it is."""
    known = ~np.isnan(signal)
    if known.all() or not known.any():
        return signal
    return np.asarray(np.where(known, signal, np.interp(t, t[known], signal[known])))


def from_error(log: Log, sign: float) -> Log:
    """Take the measured position for the following error: ``x = x_d − sign·x``."""
    return replace(log, x_meas=log.x_d - sign * log.x_meas)


def unwrapped(log: Log, turn: float) -> Log:
    """Add whole turns so that no position jumps by one, and the measured one stays by its command.

    Measured positions that are missing, NaN, remain so.
    """
    x_d, x_meas = np.unwrap(log.x_d, period=turn), log.x_meas.copy()
    known = np.isfinite(x_meas)
    x_meas[known] = np.unwrap(x_meas[known], period=turn)
    if known.any():
        x_meas -= turn * np.round(np.median(x_meas[known] - x_d[known]) / turn)
    return replace(log, x_d=x_d, x_meas=x_meas)


def _joined(log: Log, parts: list[Log]) -> Log:
    lengths = np.cumsum([0, *(len(part.t) for part in parts[:-1])])
    t, x_d, x_meas = (np.concatenate([getattr(part, name) for part in parts]) for name in ("t", "x_d", "x_meas"))
    return replace(log, t=t, x_d=x_d, x_meas=x_meas, starts=tuple(int(length) for length in lengths))
