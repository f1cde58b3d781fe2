"""Quantiles of step times in constant memory: a histogram whose bins are 2 % wide."""

from __future__ import annotations

import math

import numpy as np

__all__ = ["StepTimes"]

_SHORTEST, _WIDTH, _BINS = 1e-7, math.log(1.02), 1000
"""Shortest time that is resolved, s, logarithmic width of a bin and number of bins, which reach 40 s."""


class StepTimes:
    """Step times of a run.

    Attributes
    ----------
    n : int
        How many.
    longest : float
        The longest one, s.
    """

    def __init__(self) -> None:
        self.n, self.longest = 0, 0.0
        self._counts = np.zeros(_BINS, dtype=np.int64)

    def add(self, time: float) -> None:
        """Add a time, s."""
        place = int(math.log(time / _SHORTEST) / _WIDTH) if time > _SHORTEST else 0
        self._counts[min(place, _BINS - 1)] += 1
        self.n += 1
        self.longest = max(self.longest, time)

    def quantile(self, share: float) -> float:
        """Return the time, s, that so large a share of the steps does not exceed, to 2 %; 0 without any step."""
        if self.n == 0:
            return 0.0
        place = int(np.searchsorted(np.cumsum(self._counts), math.ceil(share * self.n)))
        return min(_SHORTEST * math.exp((place + 1) * _WIDTH), self.longest) if place < _BINS - 1 else self.longest
