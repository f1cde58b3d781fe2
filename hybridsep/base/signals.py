"""Validation of sampled signals."""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import ParameterError, SignalError, brief, first_line

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
_Factor = Callable[[str], float] | None

_POSITION_MAX: Mapping[str, float] = {"m": 1e3, "rad": 1e6}
"""Largest magnitude of a position, beyond any axis, though a rotary one may turn on and on."""

PREDICTION_MAX = 1e100
"""Largest magnitude of a published prediction, m, beyond which the learned recursion counts as diverging: sums of
squares of smaller values cannot overflow."""

_SI = ("", "m", "meter", "metre", "rad", "radian", "dimensionless")  # units of a quantity that is taken as it is

_GAP = 1.75  # usual steps of an index from which on samples are missing in it; 1.25 ms may be rounded to 2 ms


@dataclass(frozen=True, eq=False)
class Given:
    """Column as somebody hands it over."""

    values: NDArray[Any]  # numbers, NaN where they are missing, or times
    index: Any = None  # labels of its samples, as pandas and xarray have them; None without
    unit: str = ""  # that it states; empty without


def given_column(values: Any) -> Given:
    """Return what somebody hands over as a column: any array or sequence, masked, labelled, with a unit or without.

    What is masked, None or NA is NaN; Decimals are floats, and times with a zone durations since the first one.

    TypeError if they are not all numbers or times; or something else that NumPy raises.
    """
    index = getattr(values, "index", None)
    dims: Any = getattr(values, "dims", ())
    if len(dims) == 1 and hasattr(values, "indexes"):  # xarray
        index = values.indexes.get(dims[0])
    index = None if callable(index) else index
    unit = str((getattr(values, "attrs", None) or {}).get("units", ""))
    first = values[0] if isinstance(values, list | tuple) and values else None
    if (hasattr(first, "units") or hasattr(first, "unit")) and not hasattr(first, "isoformat"):  # pandas' times
        raise TypeError("a list of quantities; make one quantity of it")
    for size, of in (("magnitude", "units"), ("value", "unit"), ("value", "units")):  # pint, astropy, unyt
        if hasattr(values, size) and hasattr(values, of):
            values, unit = getattr(values, size), str(getattr(values, of) or "")
    plain: NDArray[Any] = np.asarray(values)
    if plain.dtype == np.object_:
        plain = _of_objects(plain)
    masked = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else np.zeros(1, np.bool_)
    if masked.any():
        plain = np.where(masked, np.timedelta64("NaT") if plain.dtype.kind in "mM" else np.nan, plain)
    return Given(plain, index, unit)


def _of_objects(values: NDArray[Any]) -> NDArray[Any]:
    """Return what Python's or pandas' objects hold."""
    found: list[Any] = [None if type(one).__name__ in ("NAType", "NaTType") else one for one in values.ravel()]
    first = next((one for one in found if one is not None), None)
    if hasattr(first, "utcoffset") or hasattr(first, "total_seconds"):
        since = [math.nan if one is None else (one - first).total_seconds() for one in found]
        return np.asarray((1e9 * np.array(since)).round().astype("m8[ns]"))
    for other in {type(one) for one in found} & {str, bytes, bool}:
        raise TypeError(f"values of type {other.__name__}")
    return np.array([math.nan if one is None else float(one) for one in found]).reshape(values.shape)


def first_differences(signal: Array, before: Array | float = 0.0) -> Array:
    """Return how samples differ from the one before, the first one from ``before``, ``(n, …)``; n ≥ 1.

    ``np.diff`` with ``prepend`` takes ten times as long.
    """
    found = np.empty_like(signal)
    found[0] = signal[0] - before
    np.subtract(signal[1:], signal[:-1], out=found[1:])
    return found


def mean(signal: Array) -> float:
    """Return the mean of ``(n,)``, n ≥ 1, as ``np.mean`` does in three times the time."""
    return float(np.add.reduce(signal)) / len(signal)


def check_same_index(**columns: Any) -> None:
    """Raise SignalError if columns have indexes that differ; samples without an index are by their place."""
    indexes = {name: getattr(one, "index", None) for name, one in columns.items()}
    indexed = {name: np.asarray(one) for name, one in indexes.items() if one is not None and not callable(one)}
    for name, index in indexed.items():
        first, labels = next(iter(indexed.items()))
        if len(index) == len(labels) and not np.array_equal(index, labels):
            i = int(np.argmax(index != labels))
            raise SignalError(
                f"{first} and {name} must have the same index, got {labels[i]} and {index[i]} at sample {i}; align "
                "them, or give arrays, which are paired by place"
            )


def index_values(index: Any) -> NDArray[Any]:
    """Return the numbers or times of an index, empty if it is none or holds something else."""
    with suppress(TypeError, ValueError, OverflowError):
        if index is not None and (values := given_column(index).values).dtype.kind in "iufmM":
            return values
    return np.empty(0)


def check_interval(name: str, T_s: float, other: str, expected: float) -> None:
    """Raise ParameterError if a sampling interval, s, is not the one that something else has."""
    if abs(T_s - expected) > 0.01 * expected:
        raise ParameterError(
            f"{name} is sampled every {T_s:g} s, but {other} has T_s = {expected:g} s; resample it, say its unit of "
            "time in the column's name, or correct T_s"
        )


def as_array(values: Any, name: str, factor: _Factor = None, *, T_s: float | None = None) -> Array:
    """Return numbers, NaN where missing; errors as of :func:`as_samples`, and SignalError of another unit or a gap."""
    if factor is None and type(values) is np.ndarray and values.dtype == np.float64 and values.flags.c_contiguous:
        return values
    if hasattr(values, "columns") or isinstance(values, Mapping):
        raise SignalError(f"{name} must be one column, got a table ({type(values).__name__}); read_log reads tables")
    try:
        given = given_column(values)
    except (TypeError, ValueError, OverflowError) as error:
        raise SignalError(f"{name} must be numbers, got {type(values).__name__}: {first_line(error)}") from None
    if given.values.dtype.kind not in "fiu":
        raise SignalError(f"{name} must be numbers, got {given.values.dtype}")
    if factor is None and given.unit.lower() not in _SI:
        raise SignalError(f"{name} must be in m or rad, got {brief(given.unit)}; convert it, or read_log does")
    labels = index_values(given.index)
    if len(labels) > 1:
        expected, n = T_s if labels.dtype.kind in "mM" else None, len(labels) - 1
        steps = np.diff(labels) / (np.timedelta64(1, "s") if labels.dtype.kind in "mM" else 1)
        usual = abs(float(np.median(steps)))
        usual = expected if expected and abs(usual - expected) < 0.5 * expected else usual  # times may be rounded
        if not (even := (steps > 0.0) & (steps < _GAP * usual)).all():
            i = int(np.argmin(even))
            raise SignalError(
                f"the index of {name} must be even, it goes from {labels[i]} to {labels[i + 1]} at sample {i + 1}; "
                "read_log puts a few rows back, and begins another segment after a longer gap"
            )
        if expected is not None and n > 1 and abs(steps.sum() - n * expected) > max(0.01 * n, 1.0) * expected:
            check_interval(f"the index of {name}", float(steps.mean()), "the predictor", expected)
    return np.asarray((factor(given.unit) if factor else 1.0) * given.values, dtype=np.float64, order="C")


def as_samples(
    values: Any, name: str, length: int | None = None, *, factor: _Factor = None, T_s: float | None = None
) -> Array:
    """Return ``(n,)`` samples as a contiguous float64 vector of ``length``, validated; ``name`` is for messages.

    They are in m or rad, or times the ``factor`` of the unit that they state, empty without.

    SignalError if there are none, or they are not one-dimensional, of the wrong length, not all finite, no positions in
    metres or radians; ParameterError if they have an index of times that are not ``T_s``, s, apart.
    """
    samples = as_array(values, name, factor, T_s=T_s)
    if samples.ndim != 1:
        raise SignalError(f"{name} must be one-dimensional, got shape {samples.shape}")
    if not len(samples) and length is None:
        raise SignalError(f"{name} must have at least one sample, got none")
    if length is not None and len(samples) != length:
        raise SignalError(f"{name} must have {length} samples, got {len(samples)}")
    if not np.isfinite(samples).all():
        i = int(np.flatnonzero(~np.isfinite(samples))[0])
        raise SignalError(f"{name} must be finite, got {samples[i]} at sample {i}")
    most = max(_POSITION_MAX.values())
    if np.abs(samples).max(initial=0.0) > most:
        i = int(np.argmax(np.abs(samples)))
        raise SignalError(f"{name} must be within ±{most:g} in SI units, got {samples[i]:g} at sample {i}")
    return samples


def as_measured(values: Any, name: str, length: int | None = None, *, T_s: float | None = None) -> Array:
    """Return measured positions as :func:`as_samples` does, NaN where they are missing."""
    samples = as_array(values, name, T_s=T_s)
    missing = np.isnan(samples)
    return np.where(missing, np.nan, as_samples(np.where(missing, 0.0, samples), name, length))


def check_position(name: str, value: float, when: str = "", unit: str = "m", *, may_miss: bool = False) -> None:
    """Raise SignalError if a position, NaN where it ``may_miss``, is not finite or too large, ``when`` at the end."""
    try:
        if math.isnan(value) and may_miss:
            return
    except (TypeError, OverflowError):
        raise SignalError(f"{name} must be a number, got {brief(value)}{when}") from None
    if not math.isfinite(value):
        raise SignalError(f"{name} must be finite, got {value}{when}")
    if unit not in tuple(_POSITION_MAX):
        raise SignalError(f"unit must be one of {', '.join(_POSITION_MAX)}, got {brief(unit)}")
    if abs(value) > _POSITION_MAX[unit]:
        raise SignalError(f"{name} must be within ±{_POSITION_MAX[unit]:g} {unit}, got {value:g}{when}")


def as_published(window: Array, name: str) -> Array:
    """Return a window of predictions, ``(n,)``, m, if it is bounded; ``name`` is the output's.

    SignalError if a value is not finite, or beyond :data:`PREDICTION_MAX`.
    """
    if not np.abs(window).max() <= PREDICTION_MAX:  # NaN too
        raise SignalError(
            f"{name} must stay within ±{PREDICTION_MAX:g} m: the learned recursion diverges; "
            "raise lambda, lower p or reset"
        )
    return window
