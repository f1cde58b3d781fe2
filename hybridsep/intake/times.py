"""Checks of a log's times: order, gaps, jitter."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..base.signals import Array, Indices
from ..logs.log import Log
from ..logs.time_axis import TOLERANCE
from . import fixes
from .finding import ERROR, WARNING, Finding, Fix, Picture

__all__ = ["check_gaps", "check_jitter", "check_order"]

_GAP = 1.5
"""Intervals, in sampling intervals, from which at least one sample is missing."""

_LATE = 0.6
"""The same of the times around it, on the whole: jitter alone does not last."""

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
        words += "; if they are rounded too coarsely, take the column out and give T_s"
    evidence = {"n": float(len(wrong)), "n_backwards": float(back), "first": float(wrong[0])}
    fix = Fix("sort the samples by time and keep one of each time", fixes.in_order)
    yield Finding("time order", ERROR, words, evidence, _intervals(log, wrong), fix)


def check_gaps(log: Log) -> Iterator[Finding]:
    """Find stretches of time without samples."""
    steps = np.diff(log.t) / log.T_s
    inner = np.isin(np.arange(1, len(log.t)), log.starts)
    phase = log.t / log.T_s - np.arange(len(log.t))
    gaps = np.array([k for k in np.flatnonzero((steps > _GAP) & ~inner) + 1 if _is_late(phase, int(k))], dtype=np.intp)
    if not len(gaps):
        return
    lost = np.round(steps[gaps - 1]) - 1
    words = (
        f"{int(lost.sum())} samples are missing in {len(gaps)} gap{'s' if len(gaps) > 1 else ''}, the longest of "
        f"{steps.max() * log.T_s:.4g} s; the first is before sample {gaps[0] + 1}, t = {log.t[gaps[0]]:.6g} s"
    )
    evidence = {"n": float(len(gaps)), "n_lost": float(lost.sum()), "longest": float(steps.max() * log.T_s)}
    fix = Fix("keep the segments apart", partial(fixes.split, starts=gaps))
    yield Finding("gaps", ERROR, words, evidence, _intervals(log, gaps), fix)


def _is_late(phase: Array, k: int) -> bool:
    """Return whether times lag behind their count from sample ``k`` on, as jitter does not make them."""
    return float(np.median(phase[k : k + 9]) - np.median(phase[max(0, k - 9) : k])) > _LATE


def check_jitter(log: Log) -> Iterator[Finding]:
    """Find uneven sampling: intervals that differ by more than a reader accepts."""
    steps = np.diff(log.t) / log.T_s
    inner = np.isin(np.arange(1, len(log.t)), log.starts)
    deviations = np.where(inner, 0.0, np.abs(steps - 1.0))
    uneven = np.flatnonzero(deviations > TOLERANCE) + 1
    if not len(uneven):
        return
    words = (
        f"{len(uneven)} of {len(steps)} intervals differ by more than {100 * TOLERANCE:g} % from {log.T_s:.6g} s, by "
        f"up to {100 * deviations.max():.3g} %; the model takes them as equal"
    )
    evidence = {"n": float(len(uneven)), "largest": float(deviations.max()), "std": float(np.std(deviations))}
    fix = Fix(f"resample at {log.T_s:.6g} s, linearly between samples", fixes.resampled)
    yield Finding("jitter", WARNING, words, evidence, _intervals(log, uneven), fix)


def _intervals(log: Log, wrong: Indices) -> Picture:
    t = log.t - log.t[0]
    lines = {"interval": (t[1:], 1e3 * np.diff(log.t))}
    return Picture("Sampling intervals", "time [s]", "interval [ms]", lines, t[wrong])
