"""Checks of a log's times: order, gaps, jitter."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..base.saved import COUNT_MAX
from ..base.signals import Indices
from ..intake import fixes
from ..logs.gaps import gap_starts
from ..logs.log import Log
from ..logs.time_axis import TOLERANCE
from .finding import ERROR, WARNING, Finding, Fix, Picture

__all__ = ["BRIDGED_MAX", "check_gaps", "check_jitter", "check_order"]

BRIDGED_MAX = 10
"""Samples missing in a row that are bridged, a tenth of the default window: a command of 2 m/s² at 1 kHz is
interpolated within 0.2 µm over one of them, 11 µm over ten."""

_ROUNDED = 0.2
"""Share of times that repeat from which a coarse clock is likelier than samples that were written twice."""


def check_order(log: Log) -> Iterator[Finding]:
    """Find times that repeat or run backwards."""
    steps = np.diff(log.t)
    wrong = np.flatnonzero(steps <= 0.0) + 1
    if not len(wrong):
        return
    back = int((steps < 0.0).sum())
    words = (
        f"{len(wrong)} times are not above the one before, {back} of them run backwards; the first is sample "
        f"{wrong[0] + 1}, t = {log.t[wrong[0]]:.6g} s"
    )
    if len(wrong) - back > _ROUNDED * len(log.t):
        words += "; if they are rounded too coarsely, remove the column and give T_s"
    evidence = {"n": float(len(wrong)), "n_backwards": float(back), "first": float(wrong[0])}
    fix = Fix("sort the samples by time and keep one of each time", fixes.in_order)
    yield Finding("time order", ERROR, words, evidence, _intervals(log, wrong), fix)


def check_gaps(log: Log, bridged: int = BRIDGED_MAX) -> Iterator[Finding]:
    """Find stretches of time without samples.

    Parameters
    ----------
    log : Log
    bridged : int
        Samples in a gap up to which the fix fills it in, as missing; longer ones separate segments.
    """
    steps = np.diff(log.t) / log.T_s
    gaps = np.setdiff1d(gap_starts(log.t, log.T_s), np.array(log.starts, dtype=np.intp))
    if not len(gaps):
        return
    lost = np.minimum(np.round(steps[gaps - 1]) - 1, COUNT_MAX)
    longest, n = float(steps[gaps - 1].max() * log.T_s), int(lost.sum())
    many = f"{n} samples are missing in {len(gaps)} gap{'s' if len(gaps) > 1 else ''}, the longest"
    words = (
        f"{many if n > 1 else '1 sample is missing in 1 gap'} of {longest:.4g} s; the first is before sample "
        f"{gaps[0] + 1}, t = {log.t[gaps[0]]:.6g} s"
    )
    n_short = int((lost <= bridged).sum())
    evidence = {"n": float(len(gaps)), "n_lost": float(n), "longest": longest, "n_bridged": float(n_short)}
    which = "" if n_short == len(gaps) else f", where at most {bridged} samples are missing"
    filled = f"interpolate the command over them and take the measured position as missing{which}"
    apart = "keep the segments apart" + (" at longer ones" if n_short else "")
    does = ", and ".join(([filled] if n_short else []) + ([apart] if n_short < len(gaps) else []))
    change = partial(fixes.filled, starts=gaps, lost=lost.astype(np.intp), most=bridged)
    yield Finding("gaps", ERROR, words, evidence, _intervals(log, gaps), Fix(does, change))


def check_jitter(log: Log) -> Iterator[Finding]:
    """Find uneven sampling: intervals that differ by more than a reader accepts."""
    steps = np.diff(log.t) / log.T_s
    inner = np.isin(np.arange(1, len(log.t)), log.starts)
    deviations = np.where(inner, 0.0, np.abs(steps - 1.0))
    uneven = np.flatnonzero(deviations > TOLERANCE) + 1
    if not len(uneven):
        return
    words = (
        f"{len(uneven)} of {len(steps)} intervals differ{'' if len(uneven) > 1 else 's'} by more than "
        f"{100 * TOLERANCE:g} % from {log.T_s:.6g} s, by up to {100 * deviations.max():.3g} %; the model assumes "
        "equal ones"
    )
    evidence = {"n": float(len(uneven)), "largest": float(deviations.max()), "std": float(np.std(deviations))}
    fix = Fix(f"resample at {log.T_s:.6g} s, linearly between samples", fixes.resampled)
    yield Finding("jitter", WARNING, words, evidence, _intervals(log, uneven), fix)


def _intervals(log: Log, wrong: Indices) -> Picture:
    t = log.t - log.t[0]
    lines = {"interval": (t[1:], 1e3 * np.diff(log.t))}
    return Picture("Sampling intervals", "time [s]", "interval [ms]", lines, t[wrong])
