"""Times of a log: counters that wrap, gaps and clocks that were set back, the interval between the samples."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..base.errors import LogError, brief
from ..base.signals import Array, Indices
from .units import time_unit

_DAY = 86_400.0

_CLOCKS = {"ms": 1e-3, "us": 1e-6, "100 ns": 1e-7, "ns": 1e-9, "min": 60.0, "d": _DAY}
"""Units, s, that a column of times may be in which states none and is not in seconds."""

_PLAUSIBLE = (2e-6, 0.5)  # intervals, s, of a log of an axis; beyond, a unit of times that is not stated is unknown
_DRIFT = 0.01  # relative difference of intervals that are the same, more than a clock drifts
COUNTED = 10  # fewest times whose unit is doubted: two or three seconds are no index yet

NOT_LATER = 0.05  # share of times not above the one before from which they are too coarse to tell an interval or a gap

_GAP, _LATE, _AROUND = 1.5, 0.6, 9
"""Interval, in sampling intervals, from which samples are missing, or by which, less one, a clock was set back; how
much later or earlier the times must stay then, and over how many samples: jitter does not last."""

_BRIDGED = 10
"""Rows lost in a row that are put back, a tenth of the default window: of five commands of 0.2 to 1 kHz the cubic
through the neighbours missed ten rows by 0.4 to 6 % of what a line does, one by 0.2 to 5 %."""

_WHOLE, _JITTER, _WHOLE_MAX = 0.05, 4.0, 0.35
"""Difference, in intervals, of a gap from whole rows with which the times tell how many are lost: of even times, by how
many times their usual jitter it is larger, and its most."""

_ROUNDING, _ERRORS, _ROUNDING_MAX = 1e-8, 3.0, 1e-4
"""Relative change by which an interval may be rounded at least, in standard errors, and at most."""


@dataclass(frozen=True)
class Times:
    """Times of a log in the order of the file."""

    t: Array  # (n,), s
    T_s: float  # sampling interval, s
    starts: tuple[int, ...] = (0,)  # first samples of the segments; the first is 0
    remarks: tuple[str, ...] = ()  # what was unwrapped, what is missing, and why segments begin
    lost: Indices | None = None  # (n,): rows lost before each sample, in short gaps within segments; None without any


@np.errstate(over="ignore", invalid="ignore")  # times may be any finite numbers
def recorded_times(path: Path, name: str, times: Array, factor: float, *, stated: bool, given: float | None) -> Times:
    """Return what a column of times tells.

    ``times``, ``(n,)`` with n ≥ 2, are as in the file, in a unit of ``factor`` seconds, which the file ``stated`` or
    not. A ``given`` sampling interval, s, tells the unit of times that state none, and replaces times that are rounded
    too coarsely.

    LogError if the times never increase, their unit is unknown, they are too coarse, or another interval was given.
    """
    single = times.astype(np.float32)
    # Numbers of single precision that do not resolve the interval to a fifth, and so tell no gap
    coarse = np.array_equal(single, times) and (
        float(np.spacing(np.abs(single).max())) > 0.2 * abs(float(times[-1] - times[0])) / (len(times) - 1)
    )
    t, remarks = _unwrapped(times * factor)
    steps = np.diff(t)
    if not (steps > 0.0).any():
        raise LogError(f"{path}: time {brief(name)} must increase, it never does")
    if coarse or np.mean(steps <= 0.0) > NOT_LATER:
        return _rows(path, name, t, given, remarks)
    interval, error = _mean_interval(t)
    told = stated or len(t) < COUNTED
    counts = not told and float(np.median(steps)) == 1.0
    if given is None:
        if counts or not (told or _PLAUSIBLE[0] <= interval <= _PLAUSIBLE[1]):
            raise _unknown_unit(path, name, float(t[0]), interval, counts=counts)
        if not 1e-300 <= interval <= 1e300:
            raise LogError(f"{path}: time {brief(name)} must be in seconds, got an interval of {interval:g} s")
        T_s = _rounded(interval, _ROUNDING + min(_ROUNDING_MAX, _ERRORS * error))
    elif counts or (not stated and any(abs(given / interval / one - 1.0) <= _DRIFT for one in _CLOCKS.values())):
        t, T_s = (t - t[0]) * (given / interval), given  # precise, as it may be of 1970
        interval = given
    elif abs(given / interval - 1.0) <= _DRIFT:
        T_s = given
    else:
        raise LogError(
            f"{path}: T_s = {given:g} s was given, but column {brief(name)} has an interval of {interval:g} s; leave "
            "T_s out, or correct it or the column"
        )
    gaps, lost = _gaps(t, interval)
    starts = gaps[lost[gaps] == 0]
    put_back = "the command is the cubic through its neighbours there, the measurement missing"
    words = (*_words(t, np.flatnonzero(lost), T_s, put_back, lost[lost > 0]), *_words(t, starts, T_s))
    return Times(t, T_s, (0, *starts.tolist()), (*remarks, *words), lost if lost.any() else None)


def _unwrapped(t: Array) -> tuple[Array, tuple[str, ...]]:
    """Return times without the wraps of a counter of 16 or 32 bits, or of a time of day, and what was done."""
    steps = np.diff(t)
    back = np.flatnonzero(steps < 0.0)
    if not len(back) or not (steps > 0.0).any():
        return t, ()
    usual, remarks = float(np.median(steps[steps > 0.0])), []
    counters = [(2.0**bits * unit, f"{bits} bits") for bits in (16, 32) for unit in (1.0, 1e-3, 1e-6, 1e-9)]
    for period, what in (*counters, (_DAY, "a day")):
        wraps = back[np.abs(steps[back] + period - usual) <= usual / 2]
        if len(wraps):
            added = np.zeros(len(t))
            added[wraps + 1] = period
            t = t + np.cumsum(added)
            many = "once" if len(wraps) == 1 else f"{len(wraps)} times"
            remarks.append(f"the time wraps {many}, after {what}: unwrapped")
    return t, tuple(remarks)


def _rows(path: Path, name: str, t: Array, given: float | None, remarks: tuple[str, ...]) -> Times:
    """Return rows a given interval apart whose times are too coarse; they still tell long gaps, and clocks set back."""
    steps = np.diff(t)
    resolution = float(np.median(steps[steps > 0.0]))
    usual = steps[(steps >= 0.0) & (steps <= 2.0 * resolution)]
    changes = np.flatnonzero(usual > 0.0)
    mean = float(usual[changes[0] + 1 : changes[-1] + 1].mean() if len(changes) > 1 else usual.mean())
    about = _rounded(mean, resolution / max(float(usual.sum()), resolution))
    if given is None and np.mean(steps < 0.0) > NOT_LATER:
        raise LogError(f"{path}: time {brief(name)} goes back in {np.sum(steps < 0.0)} rows; sort the rows by it")
    if given is None:
        raise LogError(
            f"{path}: time {brief(name)} is rounded too coarsely, {100 * np.mean(steps <= 0.0):.3g} % of the times are "
            f"not above the one before; say the interval between the rows, about {about:g} s (--T_s {about:g})",
            [(f"--T_s {about:g}", "the rows in their order, so far apart")],
        )
    scale = given / mean
    beyond = (scale * steps > scale * resolution + _GAP * given) | (steps < -2.0 * resolution)
    starts = np.flatnonzero(beyond) + 1
    said = f"the times are rounded coarsely: the rows are taken {given:g} s apart"
    even = np.arange(len(t), dtype=np.float64) * given
    return Times(even, given, (0, *starts.tolist()), (*remarks, said, *_words(scale * t, starts, given)))


def _unknown_unit(path: Path, name: str, first: float, interval: float, *, counts: bool) -> LogError:
    """Return the error of times that state no unit and are not in seconds, with the intervals that they may have."""
    units = [unit for unit, size in _CLOCKS.items() if _PLAUSIBLE[0] <= size * interval <= _PLAUSIBLE[1]]
    earlier = ("100 ns", "d")  # since 1601 or 1 in Windows, 1900 in Excel, 0 in MATLAB; others since 1970, to 2286
    since = next((unit for unit in units if 3e8 < first * _CLOCKS[unit] < (1e11 if unit in earlier else 1e10)), "")
    units = [since] if since else [name] if name in _CLOCKS else units
    guess = f", or a time in {units[0]}{'' if since in ('', *earlier) else ' since 1970'}" if units else ""
    hint = f"--T_s {interval * _CLOCKS[units[0]]:.4g}" if units else ""
    named = units[0] if units else "ms"
    how = f", or name its unit in the file, '{name:.60} [{named}]'" if time_unit(named) else ""
    says = "counts samples: it is an index" if counts else f"has an interval of {interval:.6g}, no axis's in s"
    return LogError(
        f"{path}: column {brief(name)} {says}{guess}; give T_s ({hint or '--T_s'}){how}",
        [(hint, "the interval between the rows, s")] if hint else (),
    )


def _words(
    t: Array, at: Indices, T_s: float, what: str = "another segment begins after each", rows: Indices | None = None
) -> list[str]:
    """Return what is missing before samples, as many ``rows`` as are put back or as times tell, and what is done."""
    steps = np.diff(t)[at - 1]
    gaps, back, said = at[steps > 0.0], at[steps <= 0.0], []
    if len(gaps):
        lost = np.round(steps[steps > 0.0] / T_s) - 1.0 if rows is None else rows
        longest = float(steps[steps > 0.0].max())
        said.append(
            f"{lost.sum():.6g} sample{'s are' if lost.sum() > 1 else ' is'} missing in {len(gaps)} "
            f"gap{'s' if len(gaps) > 1 else ''}, the longest of {longest:.4g} s; the first is before sample "
            f"{gaps[0] + 1}: {what}"
        )
    if len(back):
        said.append(
            f"the time goes back {len(back)} time{'s' if len(back) > 1 else ''}, first at sample {back[0] + 1}, by "
            f"{-float(steps[steps <= 0.0].min()):.6g} s at most: the file's order is kept, another segment begins"
        )
    return said


def _gaps(t: Array, T_s: float) -> tuple[Indices, Indices]:
    """Return the samples that are later than the one before by over an interval, or earlier, and all after them.

    And the rows that are lost before every sample: none where times do not tell how many, or these are too many.
    """
    steps = np.diff(t) / T_s
    at = np.flatnonzero((steps > _GAP) | (steps < 1.0 - _GAP)) + 1
    found = at[:0]
    while len(at):
        late = _late(steps, at, found)
        is_start = (np.abs(late) > _LATE) & (late * steps[at - 1] > 0.0)
        if not is_start.any():
            break
        # Once more without these, which may hide one a few samples beside
        found, at = np.union1d(found, at[is_start]), at[~is_start]
    late = steps[found - 1] - 1.0 + _late(steps, found, found)
    lost, rows = np.zeros(len(t), dtype=np.intp), np.round(late)
    whole = min(_WHOLE + _JITTER * float(np.median(np.abs(steps - 1.0))), _WHOLE_MAX)
    lost[found] = np.where((np.abs(late - rows) <= whole) & (rows > 0.0) & (rows <= _BRIDGED), rows, 0.0)
    return found, lost


def _late(steps: Array, at: Indices, known: Indices) -> Array:
    """Return how many intervals later the times from samples on are than those before, ``known`` jumps left out."""
    jumps = np.zeros(len(steps))
    jumps[known - 1] = steps[known - 1] - 1.0
    phase = np.append(0.0, np.cumsum(steps - 1.0 - jumps))
    around = sliding_window_view(np.pad(phase, _AROUND, constant_values=np.nan), _AROUND)
    # Window i ends before sample i, window i + _AROUND begins with it
    return np.asarray(np.nanmedian(around[at + _AROUND], axis=1) - np.nanmedian(around[at], axis=1))


def _mean_interval(t: Array) -> tuple[float, float]:
    """Return the mean interval, segments apart, and its relative standard error if times scatter independently."""
    steps = np.diff(t)
    interval = float(np.median(steps[steps > 0.0]))
    for _ in range(2):  # once more with the mean, as jitter moves a median
        gaps, lost = _gaps(t, interval)
        rows = lost[1:] + 1.0  # in each step, none between segments
        rows[gaps[lost[gaps] == 0] - 1] = 0.0
        if steps[rows > 0.0].sum() > 0.0:
            interval = float(steps[rows > 0.0].sum() / rows.sum())
    inner = rows > 0.0
    n_pieces = len(steps) - int(inner.sum()) + 1
    deviation = float(np.std(steps[inner] / interval - rows[inner])) if inner.any() else 0.0
    return interval, deviation * math.sqrt(n_pieces) / max(rows.sum(), 1.0)  # only the ends of the pieces count


def _rounded(mean: float, tolerance: float) -> float:
    """Return the interval, s, or inverse of a rate, with the fewest digits within a relative tolerance of a mean."""
    # 0.001 s, or 1/3000 s; twelve digits always are within the tolerance
    for digits in range(12):
        for one in (float(f"{mean:.{digits}e}"), 1 / float(f"{1 / mean:.{digits}e}")):
            if abs(one - mean) <= tolerance * mean:
                return one
    return mean
