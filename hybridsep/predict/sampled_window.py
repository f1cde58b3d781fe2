"""What a look-ahead shows of its window, sample by sample."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

from ..base.errors import SignalError
from ..base.signals import POSITION_MAX, Array

__all__ = ["SampledWindow"]


class SampledWindow(ABC):
    """The sample ``k`` that comes next, and the window it is part of.

    Attributes
    ----------
    k : int
        Sample that comes next, counted from the beginning of the run.
    Np : int
        Samples in a window.
    diverged : str
        Why the window could not be predicted; every further sample is refused then. Empty as long as it could.
    x_d_window, x_pb_window, x_h_window : (Np,) arrays, m
        Commanded positions, and the two predictions of what the drive makes of them.
    """

    k: int
    Np: int
    diverged: str = ""
    x_d_window: Array
    x_pb_window: Array
    x_h_window: Array

    @property
    def batch(self) -> int:
        """``⌊k/Np⌋``."""
        return self.k // self.Np

    @property
    def x_d(self) -> float:
        """Commanded position now, m."""
        return self._now(self.x_d_window)

    @property
    def x_pb(self) -> float:
        """Physics-based prediction for now, m."""
        return self._now(self.x_pb_window)

    @property
    def x_h(self) -> float:
        """Prediction for now by the best model there is, m."""
        return self._now(self.x_h_window)

    @property
    def e_servo(self) -> float:
        """Predicted servo error ``x_d − x_h``, m."""
        return self.x_d - self.x_h

    def check(self, x_d_ahead: float, x_meas: float, k: int | None = None) -> None:
        """Raise SignalError if a value cannot be taken in as sample ``k``, the next one if left out.

        Nothing is changed then. Nothing can be taken in once a window has diverged.
        """
        if self.diverged:
            raise SignalError(self.diverged)
        sample = self.k if k is None else k
        for name, value in (("x_d_ahead", x_d_ahead), ("x_meas", x_meas)):
            if not math.isfinite(value):
                raise SignalError(f"{name} must be finite, got {value} at sample {sample}")
            if abs(value) > POSITION_MAX:
                raise SignalError(f"{name} must be within ±{POSITION_MAX:g} m, got {value:g} at sample {sample}")

    @abstractmethod
    def sample(self, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to ``k + 1``."""

    @abstractmethod
    def to_bytes(self) -> bytes:
        """Return the whole state."""

    @classmethod
    @abstractmethod
    def from_bytes(cls, blob: bytes) -> SampledWindow:
        """Return what :meth:`to_bytes` described."""

    def _begin_window(self) -> None:
        """Go on to the next window; if it diverges, none is shown and no sample is taken in any more."""
        try:
            self._next_window()
        except SignalError as error:
            self.diverged = str(error)
            raise

    @abstractmethod
    def _next_window(self) -> None:
        """Predict the window that begins and show it; raise SignalError, and show nothing, if it diverges."""

    def _now(self, window: Array) -> float:
        return float(window[self.k % self.Np])


def checked_start(start: float) -> float:
    """Return the position where a drive rests.

    Raises
    ------
    SignalError
        If it is not finite, or further out than any machine is.
    """
    if not math.isfinite(start):
        raise SignalError(f"the start value of x_d_ahead must be finite, got {start}")
    if abs(start) > POSITION_MAX:
        raise SignalError(f"the start value of x_d_ahead must be within ±{POSITION_MAX:g} m, got {start:g}")
    return start
