"""Detection of missing and held measurements."""

from __future__ import annotations

import math

import numpy as np

from ..base.errors import SignalError
from ..base.saved import COUNT_MAX
from ..base.signals import Array

__all__ = ["SensorWatch"]

_REPEATS = 3
"""Equal consecutive values from which a measurement may be held: two may occur by chance at slow motion."""

_STEPS = 5.0
"""Predicted motion, in resolution steps of the sensor, within which equal values are plausible."""

_FIRST_STEP = 1e-5
"""Resolution step assumed before the sensor has changed its value, m: that of a coarse encoder."""

_STILL = 1e-8
"""Predicted motion below which the drive counts as at rest, m, whatever the resolution."""


class SensorWatch:
    """Detector of samples without measurement: NaN, or a value held while the command moves the drive.

    The sensor's resolution step is estimated as the smallest change so far. Of a run of equal values only its length
    and the range of predicted positions are kept, so a value held over many windows is detected in each of them, also
    at rest once the drive has moved.
    """

    def __init__(self) -> None:
        self.value = math.nan
        self.repeats = 0
        self.low = self.high = 0.0
        self.step = math.inf

    def misses(self, x: Array, x_pb: Array) -> bool:
        """Return whether a window has missing samples.

        Parameters
        ----------
        x : (Np,) array, m
            Measured positions, NaN where missing.
        x_pb : (Np,) array, m
            Their physics-based prediction.
        """
        missing = False
        for value, position in zip(x.tolist(), x_pb.tolist(), strict=True):
            if math.isnan(value):
                missing = True
                continue
            if value != self.value:
                if not math.isnan(self.value):
                    self.step = min(self.step, abs(value - self.value))
                self.value, self.repeats = value, 0
                self.low = self.high = position
            self.repeats += 1
            self.low, self.high = min(self.low, position), max(self.high, position)
            step = _FIRST_STEP if math.isinf(self.step) else self.step
            if self.repeats >= _REPEATS and self.high - self.low > max(_STEPS * step, _STILL):
                missing = True
        return missing

    def state(self) -> list[float]:
        """Return the state as plain numbers."""
        return [self.value, float(self.repeats), self.low, self.high, self.step]

    def restore(self, state: Array) -> None:
        """Restore a :meth:`state`; SignalError if it is none."""
        self.value, repeats, self.low, self.high, self.step = np.asarray(state).tolist()
        if not (0 <= repeats <= COUNT_MAX and self.low <= self.high and self.step > 0 and not math.isinf(self.value)):
            raise SignalError("the sensor's state must be a value, a count, a range of positions and a step")
        self.repeats = int(repeats)
