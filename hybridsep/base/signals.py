"""Validation of sampled signals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SignalError

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_POSITION_MAX: Mapping[str, float] = {"m": 1e3, "rad": 1e6}
"""Largest magnitude of a position: beyond any axis, though a rotary one may turn on and on; a larger value is an error
or in another unit."""

PREDICTION_MAX = 1e100
"""Largest magnitude of a published prediction, m, beyond which the learned recursion counts as diverging: sums of
squares of smaller values cannot overflow."""


def as_samples(values: ArrayLike, name: str, length: int | None = None) -> Array:
    """Return ``(n,)`` samples as a contiguous float64 vector of ``length``, validated; ``name`` is for messages.

    Raises
    ------
    SignalError
        If they are not one-dimensional, of the wrong length, not all finite, or no positions in metres or radians.
    """
    samples: Any = np.asarray(values)
    if samples.dtype != np.float64 or not samples.flags.c_contiguous:
        try:
            samples = np.ascontiguousarray(samples, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise SignalError(f"{name} must be numbers, got {samples.dtype}") from None
    if samples.ndim != 1:
        raise SignalError(f"{name} must be one-dimensional, got shape {samples.shape}")
    if length is not None and len(samples) != length:
        raise SignalError(f"{name} must have {length} samples, got {len(samples)}")
    if not np.isfinite(samples).all():
        i = int(np.flatnonzero(~np.isfinite(samples))[0])
        raise SignalError(f"{name} must be finite, got {samples[i]} at sample {i}")
    most = max(_POSITION_MAX.values())
    if len(samples) and np.abs(samples).max() > most:
        i = int(np.argmax(np.abs(samples)))
        raise SignalError(f"{name} must be within ±{most:g} m or rad, got {samples[i]:g} at sample {i}")
    return samples  # type: ignore[no-any-return]


def as_measured(values: ArrayLike, name: str, length: int | None = None) -> Array:
    """Return measured positions as :func:`as_samples` does, NaN where they are missing."""
    samples: Any = np.asarray(values)
    missing = np.isnan(samples) if samples.dtype.kind == "f" else np.zeros(samples.shape, dtype=np.bool_)
    return np.where(missing, np.nan, as_samples(np.where(missing, 0.0, samples), name, length))


def check_position(name: str, value: float, when: str = "", unit: str = "m") -> None:
    """Raise SignalError if a position is not finite or beyond :data:`_POSITION_MAX`; ``when`` ends the message."""
    if not math.isfinite(value):
        raise SignalError(f"{name} must be finite, got {value}{when}")
    if abs(value) > _POSITION_MAX[unit]:
        raise SignalError(f"{name} must be within ±{_POSITION_MAX[unit]:g} {unit}, got {value:g}{when}")


def as_published(window: Array, name: str) -> Array:
    """Return a window of predictions, ``(n,)``, m, if it is bounded; ``name`` is the output's.

    Raises
    ------
    SignalError
        If a value is not finite, or beyond :data:`PREDICTION_MAX`.
    """
    if not np.abs(window).max() <= PREDICTION_MAX:  # NaN too
        raise SignalError(
            f"{name} must stay within ±{PREDICTION_MAX:g} m: the learned recursion diverges; "
            "raise lambda, lower p or reset"
        )
    return window
