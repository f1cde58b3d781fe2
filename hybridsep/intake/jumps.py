"""Check for jumps of the command within one sample: logs that were pasted together, or targets in place of a motion."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..base.signals import Array, Indices
from ..intake import fixes
from ..logs.log import Log
from .finding import ERROR, WARNING, Finding, Fix, Picture
from .relation import noise_std

__all__ = ["check_jumps"]

_USUAL, _TIMES = 0.98, 8.0
"""Quantile of the steps' differences from the median of the four steps around each; and least difference of a jump, in
multiples of it: where the command consists of steps, they are usual."""

_ALONE = 3.0
"""Least size of a jump, relative to the largest of the two steps before and the two after it: a fast motion lasts."""

_TRAVEL, _NOISE = 0.005, 20.0
"""Least size of a jump, relative to the travel, and relative to the noise."""


def check_jumps(log: Log) -> Iterator[Finding]:
    """Find jumps of the command within one sample; where the measured position jumps with it, logs were pasted."""
    commanded = np.setdiff1d(_jumps(log.x_d), log.starts)
    if not len(commanded):
        return
    measured = _jumps(log.x_meas)
    both = np.intersect1d(commanded, measured)
    steps = np.abs(np.diff(log.x_d))
    largest = float(steps[commanded - 1].max())
    others = float(np.delete(steps, commanded - 1).max(initial=0.0))
    n, m = len(commanded), len(both)
    factor, unit = log.shown.position
    words = (
        f"the command jumps {n} time{'s' if n > 1 else ''} within one sample, by up to {factor * largest:.4g} {unit}, "
        f"where it otherwise moves by {log.shown.words(others)} at most; the first is at sample {commanded[0] + 1}, "
        f"t = {log.t[commanded[0]]:.6g} s"
    )
    evidence = {"n": float(n), "n_measured": float(m), "largest": largest, "usual": others}
    t = log.t - log.t[0]
    lines = {"commanded": (t, factor * log.x_d), "measured": (t, factor * log.x_meas)}
    picture = Picture("Jumps of the command", "time [s]", f"position [{unit}]", lines, t[commanded])
    if m:
        words += f"; the measured position jumps with it{'' if m == n else f' {m} times'}: logs were pasted together"
        fix = Fix("split the log there", partial(fixes.cut_at, first=both))
        yield Finding("jumps", ERROR, words, evidence, picture, fix)
        return
    words += "; the measured position does not: it is a target, or commands of two logs, and no motion of the axis"
    yield Finding("jumps", WARNING, words, evidence, picture)


def _jumps(x: Array) -> Indices:
    """Return the samples to which a signal jumps."""
    steps = np.diff(x)
    padded = np.pad(steps, 2, mode="edge")
    excess = np.abs(steps - np.median([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]], axis=0))
    if not excess.any():
        return np.empty(0, dtype=np.intp)
    usual = float(np.quantile(excess[excess > 0.0], _USUAL))
    padded = np.pad(excess, 2)
    beside = np.maximum.reduce([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]])
    least = max(_TIMES * usual, _TRAVEL * float(np.ptp(x)), _NOISE * noise_std(x))
    return np.asarray(np.flatnonzero((excess > least) & (excess > _ALONE * beside)) + 1)
