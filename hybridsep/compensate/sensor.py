"""Detection of missing and held measurements."""

from __future__ import annotations

import math

from ..base.signals import Array
from ..predict.held import HeldValue

__all__ = ["SensorWatch"]

_FIRST_STEP = 1e-5
"""Resolution step assumed before the sensor has changed its value, m: that of a coarse encoder."""

_STILL = 1e-8
"""Predicted motion below which the drive counts as at rest, m, whatever the resolution."""


class SensorWatch:
    """Detector of samples without measurement: NaN, or a value held while the command moves the drive."""

    def __init__(self) -> None:
        self.held = HeldValue()

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
            if math.isnan(value) or self.held.holds(value, position, still=_STILL, first_step=_FIRST_STEP):
                missing = True
        return missing

    def state(self) -> list[float]:
        """Return the state as plain numbers."""
        return self.held.state()

    def restore(self, state: Array) -> None:
        """Restore a :meth:`state`; SignalError if it is none."""
        self.held.restore(state)
