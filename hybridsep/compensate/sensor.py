"""Whether a window was measured at all."""

from __future__ import annotations

import math

import numpy as np

from ..base.signals import Array

__all__ = ["SensorWatch"]

_REPEATS = 3
"""So many equal values in a row may be a measurement that is held."""

_STEPS = 5.0
"""… if the drive has moved by so many of the sensor's smallest steps meanwhile,"""

_FIRST_STEP = 1e-5
"""What is taken for the smallest step, m, of a sensor that has not changed yet."""

_STILL = 1e-8
"""and by more than this, m."""


class SensorWatch:
    """Tells samples without measurement: NaN, or a value that is held while the command moves the drive.

    The sensor's step is the smallest change it has ever shown. Nothing else is remembered of a run of equal values
    than its length and the range of predicted positions over it, so a value that is held over many windows is
    recognised in each of them, at rest too, once the drive has moved.
    """

    def __init__(self) -> None:
        self.value = math.nan
        self.repeats = 0
        self.low = self.high = 0.0
        self.step = math.inf

    def misses(self, x: Array, x_pb: Array) -> bool:
        """Return whether a window has samples without measurement.

        Parameters
        ----------
        x : (Np,) array, m
            Measured positions, NaN for none.
        x_pb : (Np,) array, m
            Physics-based prediction of them.
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
        """Take over what :meth:`state` returned."""
        self.value, repeats, self.low, self.high, self.step = np.asarray(state).tolist()
        self.repeats = int(repeats)
