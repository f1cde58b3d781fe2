"""Observer of a tool's position from its accelerometer and a slow reference, such as the motor's encoder.

``p̂' = v̂ + l₁ (r − p̂)``, ``v̂' = a − b̂ + l₂ (r − p̂)``, ``b̂' = −l₃ (r − p̂)`` with the gains of a triple pole: above
the crossover the position is the double integral of the acceleration, below it the reference; the sensor's offset ``b̂``
and its drift are estimated. Deflections slower than the crossover are lost, as no accelerometer sees them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from ..base.errors import ParameterError
from ..base.settings import check
from ..base.signals import Array, as_samples

__all__ = ["PositionObserver", "observe_position"]


CROSSOVER = 0.5
"""Default crossover, Hz: a twentieth of a first mode of 10 Hz, whose deflection is then observed within 15 %."""


class PositionObserver:
    """Observer that runs sample by sample; exact for inputs that are straight between the samples.

    Parameters
    ----------
    T_s : float
        Sampling interval, s.
    crossover : float
        Frequency above which the accelerometer decides, Hz: below the first mode, above the frequencies of the sensor's
        drift.
    position, velocity, bias : float
        Position, m, velocity, m/s, and the sensor's offset, m/s², at the first sample.

    Raises
    ------
    ParameterError
        If ``T_s`` is out of its range, or the crossover is not between 0 and a tenth of the sampling frequency.
    """

    def __init__(
        self,
        T_s: float,
        crossover: float = CROSSOVER,
        *,
        position: float = 0.0,
        velocity: float = 0.0,
        bias: float = 0.0,
    ) -> None:
        T_s = check("T_s", T_s)
        if not 0 < crossover <= 0.1 / T_s:
            raise ParameterError(f"crossover must be above 0 and at most {0.1 / T_s:g} Hz, got {crossover!r}")
        omega = 2 * np.pi * crossover
        l1, l2, l3 = 3 * omega, 3 * omega**2, omega**3
        A = np.array([[-l1, 1.0, 0.0], [-l2, 0.0, -1.0], [l3, 0.0, 0.0]])
        B = np.array([[0.0, l1], [1.0, l2], [0.0, -l3]])  # inputs: acceleration, reference
        # Both inputs run straight from one sample to the next
        augmented = np.zeros((7, 7))
        augmented[:3, :3], augmented[:3, 3:5], augmented[3:5, 5:] = A * T_s, B * T_s, np.eye(2)
        exponential = expm(augmented)
        self._A, self._start, self._ramp = exponential[:3, :3], exponential[:3, 3:5], exponential[:3, 5:]
        self._state = np.array([position, velocity, bias])
        self._last: Array | None = None

    @property
    def bias(self) -> float:
        """Estimated offset of the accelerometer, m/s²."""
        return float(self._state[2])

    def step(self, acceleration: float, reference: float) -> float:
        """Return the position at the sample of these measurements, m.

        Parameters
        ----------
        acceleration : float
            Measured acceleration, m/s².
        reference : float
            Position of the motor's encoder, or of another slow reference, m.
        """
        now = np.array([acceleration, reference])
        if self._last is not None:
            self._state = self._A @ self._state + self._start @ self._last + self._ramp @ (now - self._last)
        self._last = now
        return float(self._state[0])


def observe_position(acceleration: ArrayLike, reference: ArrayLike, T_s: float, crossover: float = CROSSOVER) -> Array:
    """Return the position of a recording, ``(n,)``, m, which starts at the reference with its velocity.

    The sensor's offset is first taken to be its mean, less the reference's change of velocity over the recording.

    Parameters
    ----------
    acceleration : (n,) array_like, m/s²
    reference : (n,) array_like, m
    T_s : float
        Sampling interval, s.
    crossover : float
        Frequency above which the accelerometer decides, Hz.
    """
    r = as_samples(reference, "reference")
    a = np.asarray(acceleration, dtype=np.float64)
    if a.shape != r.shape or not np.isfinite(a).all():
        raise ParameterError(f"acceleration must be {len(r)} finite numbers, got shape {a.shape}")
    if len(r) < 2:
        return np.array(r)
    velocity = float(r[1] - r[0]) / T_s
    bias = float(a.mean()) - (float(r[-1] - r[-2]) / T_s - velocity) / (len(r) * T_s)
    observer = PositionObserver(T_s, crossover, position=float(r[0]), velocity=velocity, bias=bias)
    return np.array([observer.step(*pair) for pair in zip(a, r, strict=True)])
