"""Checks of single samples: outliers, stuck and repeated values."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from ..base.signals import Array, Indices
from ..intake import fixes
from ..logs.log import Log
from .finding import NOTE, WARNING, Finding, Fix, Picture

__all__ = ["check_missing", "check_outliers", "check_repeated", "check_stuck", "resolution"]

_COLUMNS = {"x_d": "commanded position", "x_meas": "measured position"}

_OUTLIER = 5.0
"""Distance from the median of five, relative to its 95 % quantile, that no noise reaches."""

_TURN = 5.0
"""The same relative to the acceleration elsewhere, per sample squared: a triangle's corner has 4."""

_STUCK = 5
"""Equal values in a row that a moving axis does not show unless its sensor holds them."""

_HELD_SHARE = 0.2
"""Share of samples of a fast motion that repeat the one before, from which the sensor is slower than the log."""

_MOVING_MIN = 50
"""Samples of fast motion below which their share means nothing."""

_STEPS = 3.0
"""Motion per sample, in resolution steps, from which a repeated value is not due to the resolution."""


def resolution(x: Array) -> float:
    """Return the smallest change of a signal, 0 if it has none."""
    steps = np.abs(np.diff(x))
    return float(steps[steps > 0].min(initial=np.inf)) if steps.any() else 0.0


def check_missing(log: Log) -> Iterator[Finding]:
    """Find measured positions that are missing, NaN."""
    wrong = np.flatnonzero(np.isnan(log.x_meas))
    if not len(wrong) or len(wrong) == len(log.t):
        return
    words = (
        f"{len(wrong)} of {len(log.t)} measured positions {'are' if len(wrong) > 1 else 'is'} missing; the first is "
        f"sample {wrong[0] + 1}, t = {log.t[wrong[0]]:.6g} s; an identification leaves them out, and with trust they "
        "are replayed as missing"
    )
    evidence = {"n": float(len(wrong)), "first": float(wrong[0])}
    fix = Fix("interpolate over them, where a model without trust needs it", fixes.without_missing)
    yield Finding("missing samples", NOTE, words, evidence, _signals(log, _COLUMNS["x_meas"], wrong), fix)


def check_outliers(log: Log) -> Iterator[Finding]:
    """Find values that leave the signal for one or two samples."""
    for column, title in _COLUMNS.items():
        wrong, heights = outliers(_in_one_piece(getattr(log, column), log.starts))
        if not len(wrong):
            continue
        words = (
            f"{len(wrong)} of the samples of the {title} leave{'' if len(wrong) > 1 else 's'} the "
            f"signal by up to {log.shown.words(heights.max(), '.4g')}; the first is sample {wrong[0] + 1}, t = "
            f"{log.t[wrong[0]]:.6g} s"
        )
        evidence = {"n": float(len(wrong)), "first": float(wrong[0]), "largest": float(heights.max())}
        fix = Fix(f"interpolate the {title} over them", partial(fixes.bridge, column=column, wrong=wrong))
        yield Finding("outliers", WARNING, words, evidence, _signals(log, title, wrong), fix)


def _in_one_piece(x: Array, starts: tuple[int, ...]) -> Array:
    """Return a signal without its jumps between segments, which are no outliers."""
    jumps = np.zeros(len(x))
    for start in starts[1:]:
        jumps[start] = x[start] - x[start - 1]
    return x - np.cumsum(jumps) if len(starts) > 1 else x


def outliers(x: Array) -> tuple[Indices, Array]:
    """Return indices of outliers, and their distances from the median of five samples.

    An outlier is further from that median than noise and turning points of the motion are, and further from the cubic
    through its neighbours than what is around it.
    """
    distance = np.abs(x - median_filter(x, 5, mode="nearest"))
    padded = np.pad(x, 2, mode="edge")
    cubic = (-padded[:-4] + 4 * padded[1:-3] + 4 * padded[3:-1] - padded[4:]) / 6
    beside = np.abs(x - cubic)
    far = distance > max(_OUTLIER * float(np.quantile(distance, 0.95)), 4 * resolution(x))
    if not far.any():
        return np.empty(0, dtype=np.intp), np.empty(0)
    near = maximum_filter1d(far.astype(np.uint8), 3) > 0
    # Acceleration over nine samples, none of them near a candidate
    turns = np.abs(x[8:] - 2 * x[4:-4] + x[:-8]) / 16
    usual = float(turns[~(near[8:] | near[4:-4] | near[:-8])].max(initial=0.0))
    around = maximum_filter1d(np.where(maximum_filter1d(near, 5), 0.0, beside), 61)
    wrong = np.flatnonzero(
        far & (distance > _TURN * usual) & (beside > _OUTLIER / 2 * around) & (beside > 0.3 * distance)
    )
    return wrong, distance[wrong]


def check_stuck(log: Log) -> Iterator[Finding]:
    """Find stretches in which the measurement is held although the axis moves, and jumps afterwards."""
    x, x_d = log.x_meas, log.x_d
    begins, ends = _runs(x)
    if not len(begins):
        return
    steps = np.abs(np.diff(x))
    # The jumps at the ends of the runs are not what a step usually is.
    edges = np.concatenate((begins[begins > 0] - 1, ends[ends < len(x)] - 1))
    usual = float(np.delete(steps, edges).max(initial=0.0))
    held, still = [], _still_share(x, begins, ends)
    for begin, end in zip(begins, ends, strict=True):
        moved = float(np.ptp(x_d[begin:end]))
        after = steps[end - 1] if end < len(x) else 0.0
        before = steps[begin - 1] if begin > 0 else 0.0
        jumps = max(after, before) > 3.0 * usual and max(after, before, moved) > 10 * resolution(x)
        dead = end == len(x) and still < 0.2 and moved > 0.05 * np.ptp(x_d)
        if (jumps and moved > 0.0 and (after > 0.3 * moved or before > 3.0 * usual)) or dead:
            held.append((begin, end))
    if not held:
        return
    first = np.array(held)
    lengths = first[:, 1] - first[:, 0]
    words = (
        f"the measured position is held {len(held)} time{'s' if len(held) > 1 else ''} while the axis is commanded to "
        f"move, for {lengths.max()} samples at most; the first is from sample {held[0][0] + 1}, t = "
        f"{log.t[held[0][0]]:.6g} s"
    )
    evidence = {"n": float(len(held)), "n_samples": float(lengths.sum()), "longest": float(lengths.max())}
    fix = Fix(
        "cut them out and treat the rest as separate segments",
        partial(fixes.cut_out, begins=first[:, 0], ends=first[:, 1]),
    )
    marks = np.concatenate([np.arange(begin, end) for begin, end in held])
    yield Finding("stuck samples", WARNING, words, evidence, _signals(log, _COLUMNS["x_meas"], marks), fix)


def _runs(x: Array) -> tuple[Indices, Indices]:
    """Return where runs of at least :data:`_STUCK` equal values begin and end."""
    edges = np.flatnonzero(np.concatenate(([True], np.diff(x) != 0.0, [True])))
    long = np.diff(edges) >= _STUCK
    return edges[:-1][long], edges[1:][long]


def _still_share(x: Array, begins: Indices, ends: Indices) -> float:
    """Return the share of samples, the last run aside, that repeat the one before."""
    end = begins[-1] if ends[-1] == len(x) else len(x)
    return float(np.mean(np.diff(x[:end]) == 0.0)) if end > 1 else 1.0


def check_repeated(log: Log) -> Iterator[Finding]:
    """Find a measurement that is renewed less often than it is recorded."""
    x, step = log.x_meas, resolution(log.x_meas)
    # Speed over six samples, in which a value that is held for a few moves, too
    speed = np.abs(np.convolve(np.pad(np.diff(x), (2, 3), mode="edge"), np.full(6, 1 / 6), "valid"))
    moving = speed > max(_STEPS * step, 0.2 * float(speed.max(initial=0.0)))
    if moving.sum() < _MOVING_MIN:
        return
    held = (np.diff(x) == 0.0) & moving
    share = float(held.sum() / moving.sum())
    if share < _HELD_SHARE:
        return
    renewed = np.flatnonzero(np.diff(x) != 0.0) + 1
    between = np.diff(renewed[maximum_filter1d(moving, 9)[renewed - 1]])
    period = int(np.median(between)) if len(between) else 0
    regular = period > 1 and float(np.mean(between[between < 3 * period] == period)) > 0.8
    words = (
        f"{100 * share:.0f} % of the measured positions repeat the one before while the axis moves: they are "
        f"renewed about every {period if regular else 1 / max(1 - share, 1e-3):.2g} samples only"
    )
    evidence = {"share": share, "period": float(period)}
    if regular:
        first = int(renewed[0]) % period
        fix = Fix(f"keep every {period}th sample, where it is new", partial(fixes.thinned, step=period, first=first))
    else:
        wrong = np.flatnonzero((np.diff(x) == 0.0) & maximum_filter1d(moving, 9)) + 1
        fix = Fix("interpolate over the repeated ones", partial(fixes.bridge, column="x_meas", wrong=wrong))
    marks = np.flatnonzero(held) + 1
    yield Finding("repeated samples", WARNING, words, evidence, _signals(log, _COLUMNS["x_meas"], marks), fix)


def _signals(log: Log, title: str, marks: Indices) -> Picture:
    t = log.t - log.t[0]
    factor, unit = log.shown.position
    lines = {name: (t, factor * getattr(log, column)) for column, name in _COLUMNS.items()}
    return Picture(title.capitalize(), "time [s]", f"position [{unit}]", lines, t[marks])
