"""Gaps in a log's times, told from jitter, and the interval between the samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..base.signals import Array, Indices

__all__ = ["gap_starts", "mean_interval", "rounded_interval", "row_interval", "standard_error"]

_GAP = 1.5
"""Intervals, in sampling intervals, from which at least one sample is missing."""

_LATE = 0.6
"""The same of the times around it, on the whole: jitter alone does not last."""

_AROUND = 9
"""Samples on each side that tell whether times stay late."""

_ROUNDING = 1e-8
"""Relative tolerance when the interval is rounded: 0.001000000003 s becomes 0.001 s."""

_ERRORS, _ROUNDING_MAX = 3.0, 1e-4
"""Standard errors of a mean within which it may be rounded, and the largest relative change by that."""


@np.errstate(over="ignore", invalid="ignore")  # times may be any finite numbers
def gap_starts(t: Array, T_s: float) -> Indices:
    """Return the samples before which at least one is missing: later than the one before, and late ever after.

    Parameters
    ----------
    t : (n,) array, s
        Times.
    T_s : float, s
        Sampling interval.
    """
    at = np.flatnonzero(np.diff(t) > _GAP * T_s) + 1
    if not len(at):
        return at
    phase = t / T_s - np.arange(len(t))
    around = sliding_window_view(np.pad(phase, _AROUND, constant_values=np.nan), _AROUND)
    # Window i ends before sample i, window i + _AROUND begins with it
    late = np.nanmedian(around[at + _AROUND], axis=1) - np.nanmedian(around[at], axis=1)
    return at[late > _LATE]


@np.errstate(over="ignore", invalid="ignore")
def mean_interval(t: Array) -> tuple[float, float]:
    """Return the mean interval, s, gaps and times out of order aside, and its relative standard error; NaN without any.

    Without gaps it is ``(t_end − t_0)/(n − 1)``. The error holds for times that scatter independently.
    """
    increasing = np.unique(t)
    steps = np.diff(increasing)
    if not len(steps):
        return math.nan, 0.0
    interval = float(np.median(steps))
    inner = np.ones(len(steps), dtype=np.bool_)
    for _ in range(2):  # once more with the mean, as jitter moves a median
        inner[:] = True
        inner[gap_starts(increasing, interval) - 1] = False
        if inner.any():
            interval = float(steps[inner].sum() / inner.sum())
    n_pieces = len(steps) - int(inner.sum()) + 1
    return interval, standard_error(float(np.std(steps[inner] / interval)), int(inner.sum()), n_pieces)


def row_interval(t: Array, T_s: float) -> float:
    """Return the mean interval, s, of rows whose distinct times are ``T_s`` apart; times that repeat are rounded."""
    return T_s * len(np.unique(t)) / len(t)


def standard_error(deviation: float, n: int, n_pieces: int = 1) -> float:
    """Return the relative standard error of the mean of ``n`` intervals, of which the ends alone count.

    Parameters
    ----------
    deviation : float
        Relative standard deviation of the intervals: √2 times the times' deviation.
    n : int
        Intervals.
    n_pieces : int
        Pieces between gaps, each with two ends.
    """
    return deviation * math.sqrt(n_pieces) / max(n, 1)


def rounded_interval(mean: float, error: float) -> float:
    """Return the interval or rate with the fewest digits within three standard errors, at most 1e-4, of a mean.

    Parameters
    ----------
    mean : float, s
    error : float
        Its relative standard error.
    """
    tolerance = _ROUNDING + (min(_ROUNDING_MAX, _ERRORS * error) if math.isfinite(error) else 0.0)
    # 0.001 s, or 1/3000 s; ten digits always are within the tolerance
    candidates = (
        candidate
        for digits in range(10)
        for candidate in (float(f"{mean:.{digits}e}"), 1 / float(f"{1 / mean:.{digits}e}"))
    )
    return next(candidate for candidate in candidates if abs(candidate - mean) <= tolerance * mean)
