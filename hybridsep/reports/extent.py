"""Extent of logs in words: samples, duration, rate, and what share of their files it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..logs.log import Log

__all__ = ["extent", "partly_used"]

_ALL = 0.995
"""Share of a file's samples from which on it counts as used, all of it."""

_RATE = 0.01
"""Relative difference from the file's own rate from which on both are said."""


def extent(logs: Sequence[Log]) -> str:
    """Return how many samples logs of one sampling interval have, over what time and at what rate.

    Where measurements are missing or were cut out, or samples left out, the share of the files' samples and their own
    rate are said as well.
    """
    T_s, n = logs[0].T_s, sum(len(log.t) for log in logs)
    n_used, n_recorded = sum(map(_n_used, logs)), sum(map(_n_recorded, logs))
    words = f"{n} samples" if _is_all(logs) else f"{n_used} of {n_recorded} samples ({100 * n_used / n_recorded:.3g} %)"
    words += f", {n * T_s:.4g} s at {1 / T_s:.4g} Hz"
    own = logs[0].T_recorded
    if own and abs(T_s / own - 1.0) > _RATE:
        words += f" (recorded at {1 / own:.4g} Hz)"
    segments = sum(len(log.starts) for log in logs)
    if segments == len(logs):
        return words
    lasted = sum(float(log.t[-1] - log.t[0]) + T_s for log in logs)
    return f"{words} in {segments} segments of a record of {lasted:.4g} s"


def partly_used(log: Log) -> str:
    """Return the extent of a log of which a part is used, or at another rate than its file's; empty otherwise."""
    own = log.T_recorded or log.T_s
    if _is_all([log]) and abs(log.T_s / own - 1.0) <= _RATE:
        return ""
    return f"{log.path.name}: used are {extent([log])}"


def _is_all(logs: Sequence[Log]) -> bool:
    return sum(map(_n_used, logs)) >= _ALL * sum(map(_n_recorded, logs))


def _n_used(log: Log) -> int:
    """Return the samples that are measured."""
    return int(np.count_nonzero(~np.isnan(log.x_meas)))


def _n_recorded(log: Log) -> int:
    return log.n_recorded or len(log.t)
