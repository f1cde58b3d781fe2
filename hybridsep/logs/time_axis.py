"""Validation of a log's time column, block by block: monotonicity, uniformity, sampling interval."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from ..base.errors import LogError, brief
from ..base.signals import Array
from .gaps import gap_starts, mean_interval, rounded_interval, standard_error
from .source import Block

__all__ = ["COUNTED", "TOLERANCE", "TimeAxis"]

TOLERANCE = 0.05
"""Largest relative deviation of an interval from the median one.

A recorder's clock jitters by a few per cent at most; a lost sample doubles an interval. At a feed rate of 80 mm/s
and 1 kHz, 5 % of an interval are 4 µm of travel, comparable to encoder noise.
"""

TIME_MAX = 1e15
"""Largest time, s, about a clock in ns since 1970 that is read in ms; differences of larger times may overflow."""

COUNTED = 10
"""Fewest times that count samples before they are taken for an index: a log with an interval of 1 s is none yet."""


class TimeAxis:
    """Time axis that arrives in blocks, checked in constant memory.

    Every interval is compared with the median interval of the first block.

    Parameters
    ----------
    path : Path
        The file, for messages.
    name : str
        The column, for messages.
    uniform : bool
        Whether an interval that is not the median one is refused; otherwise all times are kept, to tell gaps.
    """

    def __init__(self, path: Path, name: str, *, uniform: bool = True) -> None:
        self._path, self._name, self._uniform = path, name, uniform
        self._n = 0
        self._counts = True
        self._times: list[Array] = []
        self._first = self._last = self._median = self._squares = 0.0

    @np.errstate(over="ignore", invalid="ignore")  # an interval that overflows is reported at the end
    def extend(self, block: Block) -> None:
        """Check the next times, s, the only column of the block.

        Raises
        ------
        LogError
            If an interval is not the median one within :data:`TOLERANCE`.
        """
        t = block.columns[0]
        if not np.abs(t).max() <= TIME_MAX:
            i = int(np.argmax(~(np.abs(t) <= TIME_MAX)))
            raise LogError(
                f"{self._path}, {block.where(i)}: time {brief(self._name)} must be within "
                f"±{TIME_MAX:g} s, got {t[i]:g} s"
            )
        if self._n == 0:
            self._first = self._last = float(t[0])
            steps = np.diff(t)
        else:
            steps = np.diff(t, prepend=self._last)
        # steps[i] ends at sample i + shift of this block.
        shift = len(t) - len(steps)
        self._counts = self._counts and self._first in (0.0, 1.0) and bool((steps == 1.0).all())
        if not self._uniform:
            self._times.append(t)
        elif len(steps):
            self._check_increasing(steps, shift, block)
            if self._median == 0.0:
                self._median = float(np.median(steps))
            self._check_uniform(steps, shift, block)
        self._n += len(t)
        self._last = float(t[-1])

    @property
    def counts_samples(self) -> bool:
        """Whether the times are 0, 1, 2, … or 1, 2, 3, …, at least :data:`COUNTED` of them."""
        return self._counts and self._n >= COUNTED

    def interval(self) -> float:
        """Return the mean interval, s, gaps aside, rounded within its standard error; needs two samples.

        Raises
        ------
        LogError
            If the times never increase, or the interval or its reciprocal underflows.
        """
        if self._uniform:
            n = self._n - 1
            mean = (self._last - self._first) / n
            variance = self._squares / n - (mean / self._median - 1.0) ** 2 if self._median else 0.0
            error = standard_error(max(variance, 0.0) ** 0.5, n)
        else:
            mean, error = mean_interval(np.concatenate(self._times))
        if math.isnan(mean):
            raise LogError(f"{self._path}: time {brief(self._name)} must increase, it never does")
        if not sys.float_info.min <= mean <= 1 / sys.float_info.min:
            raise LogError(f"{self._path}: time {brief(self._name)} must be in seconds, got an interval of {mean:g} s")
        return rounded_interval(mean, error)

    @property
    def is_even(self) -> bool:
        """Whether times increase and none is missing, jitter aside; the intervals must have been kept."""
        t = np.concatenate(self._times)
        return bool((np.diff(t) > 0.0).all()) and not len(gap_starts(t, mean_interval(t)[0]))

    def _check_increasing(self, steps: Array, shift: int, block: Block) -> None:
        if steps.min() <= 0.0:
            i = int(np.argmax(steps <= 0.0))
            now = float(block.columns[0][i + shift])
            what, hint = "runs backwards", ""
            if steps[i] == 0.0:
                what, hint = "repeats", "; if times are rounded too coarsely, remove the column and give T_s (--T_s)"
            raise LogError(
                f"{self._path}, {block.where(i + shift)}: time {brief(self._name)} {what}: a value above "
                f"{now - float(steps[i]):.9g} s was expected, got {now:.9g} s{hint}"
            )

    def _check_uniform(self, steps: Array, shift: int, block: Block) -> None:
        deviations = np.abs(steps / self._median - 1.0)
        worst = float(deviations.max())
        if worst > TOLERANCE:
            i = int(np.argmax(deviations > TOLERANCE))
            lost = round(float(steps[i]) / self._median) - 1
            samples = f"; {lost} sample{'s' if lost > 1 else ''} may be lost" if lost >= 1 else ""
            raise LogError(
                f"{self._path}, {block.where(i + shift)}: time {brief(self._name)} must be uniform: an interval of "
                f"{self._median:.6g} s ± {100 * TOLERANCE:g} % was expected, got {steps[i]:.6g} s{samples}; "
                f"resample the log, or remove the time column and give T_s (--fix, --T_s)"
            )
        self._squares += float(deviations @ deviations)
