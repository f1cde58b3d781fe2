"""Detection of held measurements: a value that stays equal while the command moves the drive."""

from __future__ import annotations

import math

import numpy as np

from ...base.errors import SignalError
from ...base.saved import COUNT_MAX
from ...base.signals import Array

__all__ = ["HeldValue"]

_REPEATS = 3
"""Equal consecutive values from which a measurement may be held: two may occur by chance at slow motion."""

_STEPS = 5.0
"""Predicted motion, in resolution steps of the sensor, within which equal values are plausible."""


class HeldValue:
    """Detector of values held while the drive should move.

    The sensor's resolution step is estimated as the smallest change so far. Of a run of equal values only its length
    and the range of predicted positions are kept, so a value held over many windows is detected in each of them, also
    at rest once the drive has moved.

    Attributes
    ----------
    value : float, m
        Last value; NaN before the first.
    repeats : int
        Length of the run of equal values.
    low, high : float, m
        Range of predicted positions over it.
    step : float, m
        Smallest change so far; infinite before there is one.
    """

    N_STATE = 5
    """Numbers of a state."""

    def __init__(self) -> None:
        self.step = math.inf
        self.restart()

    def restart(self) -> None:
        """Begin another run; the resolution step is kept."""
        self.value, self.repeats, self.low, self.high = math.nan, 0, 0.0, 0.0

    def holds(self, value: float, position: float, *, still: float) -> bool:
        """Take in a measured value and return whether it is held.

        Parameters
        ----------
        value, position : float, m
            Measurement, and its physics-based prediction.
        still : float, m
            Predicted motion within which equal values are plausible whatever the resolution.
        """
        if value != self.value:
            if not math.isnan(self.value):
                self.step = min(self.step, abs(value - self.value))
            self.value, self.repeats, self.low, self.high = value, 0, position, position
        self.repeats += 1
        self.low, self.high = min(self.low, position), max(self.high, position)
        return self.stays(self.high - self.low, still=still)

    def stays(self, motion: float, *, still: float, first_step: float = math.inf) -> bool:
        """Return whether the last value has been equal under a predicted motion, m.

        ``first_step`` is the resolution step assumed before the first change, m; the rest as for :meth:`holds`.
        """
        step = first_step if math.isinf(self.step) else self.step
        return self.repeats >= _REPEATS and motion > max(_STEPS * step, still)

    def state(self) -> list[float]:
        """Return the state as plain numbers."""
        return [self.value, float(self.repeats), self.low, self.high, self.step]

    def restore(self, state: Array) -> None:
        """Restore a :meth:`state`; SignalError if it is none."""
        self.value, repeats, self.low, self.high, self.step = np.asarray(state).tolist()
        if not (0 <= repeats <= COUNT_MAX and self.low <= self.high and self.step > 0 and not math.isinf(self.value)):
            raise SignalError("the sensor's state must be a value, a count, a range of positions and a step")
        self.repeats = int(repeats)
