"""A drive's limits, given or estimated from the motion of a log, and what holds and rounds its commands."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.errors import ParameterError
from ..base.metrics import largest
from ..base.settings import DRIVE_LIMIT_ENTRIES, Limits
from ..base.signals import Array
from ..logs.checks import resolution
from ..logs.units import DisplayUnits
from .replay import Recording

MARGINS = np.array([1.25, 2.0, 5.0])
"""Limits of velocity, acceleration and jerk relative to a log's largest, as in the library's machine files."""

_ROUNDING = 0.1  # most that rounding may have of the largest difference of commands, from which motion is estimated
_OVER = tuple(sorted({round(1.25**i) for i in range(40)}))  # samples that such a difference may be over
_HELD, STEPS = 0.1, 100  # quantile of the intervals between changes for which a command is held; fewer are steps

_ZERO, _VARIES = 10.0, 0.999
"""Offset of command and measurement, relative to what the error varies by in this share of the samples, from which on
limits do not count it."""

_PIECES, _SHORTEST, _FEW = 40, 100, 10  # pieces of a log; samples of a piece, at least; fewest in motion that tell
_LEAST = 1e-9  # acceleration of a piece at constant speed, relative to the log's largest: an error is divided by it
_FAR = 3.0  # largest error that counts, relative to the usual one: good logs have 2.5 at most

FOLLOWING_ERROR = 1.3
"""``following_error_max`` relative to the largest servo error without compensation: on 300 sound loops of two masses no
error without compensation was above it (``python -m benchmarks.faults``)."""

LIMITS_WORDS = (  # what the limits of :func:`estimated_limits` are
    f"estimates, {', '.join(f'{one:g}' for one in MARGINS.tolist())} times the largest velocity, acceleration and jerk "
    "of the log; replace them by your drive's, and take out estimated = true, before a compensator moves it"
)


def drive_limits(given: Mapping[str, float]) -> dict[str, float]:
    """Return the entries of ``[drive_limits]`` of options by their names; empty without any.

    What of the others is left out follows from the log. ParameterError if some of the three limits are missing.
    """
    found = {entry: one.checked(given[one.name]) for entry, one in DRIVE_LIMIT_ENTRIES.items() if one.name in given}
    names = [parameter.name for parameter in Limits.parameters().values()]
    if found and (left := [name for name in names if name not in given]):
        raise ParameterError(f"a compensator needs the drive's limits {', '.join(names)}; missing: {', '.join(left)}")
    return found


def held_for(x_d: Array) -> int:
    """Return for how many samples each command is held, or rounded to the same."""
    intervals = np.diff(np.flatnonzero(np.diff(x_d)))
    return int(np.quantile(intervals, _HELD)) if len(intervals) > STEPS else 1


def rounding_of(x_d: Array) -> float:
    """Return the step to which commands are rounded, m.

    Rounding is white noise where they move, but not at every speed, and no more than their smallest change.
    """
    rough = np.abs(np.diff(x_d, 5))[x_d[5:] != x_d[:-5]]
    noise = float(np.quantile(rough, 0.9)) / (1.645 * math.sqrt(252.0)) if len(rough) else 0.0
    return min(resolution(x_d), math.sqrt(12.0) * noise)


def _motion(x_d: Array, T_s: float) -> list[float]:
    """Return the largest velocity, acceleration and jerk of commands, ``(n,)``, without what holds and rounds them."""
    # Differences are over as many samples as a command is held for, and as make its rounding small against them
    held = held_for(x_d)
    x_d, T_s = x_d[::held], held * T_s
    rounding, found = rounding_of(x_d), []
    for order in (1, 2, 3):
        sizes = {n: largest(np.diff(x_d[: len(x_d) // n * n].reshape(-1, n), order, axis=0)) for n in _OVER}
        n = next((n for n, size in sizes.items() if 2 ** (order - 1) * rounding <= _ROUNDING * size), 1)
        found.append(sizes[n] / (n * T_s) ** order)
    return found


def _sizes(error: Array) -> Array:
    """Return the sizes of a log's servo errors, ``(n,)``, m: about their median where that is an offset."""
    median = float(np.nanmedian(error))
    varies = np.abs(error - median)
    is_offset = 0.0 < _ZERO * float(np.nanquantile(varies, _VARIES)) < abs(median)
    return np.asarray(varies if is_offset else np.abs(error))


def largest_motion(recordings: Sequence[Recording], T_s: float) -> tuple[Array, float]:
    """Return the largest velocity, acceleration and jerk of the commands, ``(3,)``, and the largest servo error, m."""
    peaks = np.array([_motion(one.x_d, T_s) for one in recordings]).reshape(-1, 3).max(axis=0, initial=0.0)
    measured = [error for error in (one.x_d - one.x for one in recordings) if np.isfinite(error).any()]
    return peaks, max((float(np.nanmax(_sizes(error))) for error in measured), default=0.0)


def usual_error(recordings: Sequence[Recording], T_s: float) -> float:
    """Return the servo error that most of a log lets expect of its fastest motion, m; infinite where little moves."""
    n = max(_SHORTEST, sum(len(one.x) for one in recordings) // _PIECES)
    known = [(one.x_d, _sizes(one.x_d - one.x)) for one in recordings if np.isfinite(one.x).any()]
    pieces = [(x_d[k : k + n], sizes[k : k + n]) for x_d, sizes in known for k in range(0, len(x_d) - n + 1, n)]
    found = [[*_motion(x_d, T_s)[:2], np.nanmax(one)] for x_d, one in pieces if np.isfinite(one).any()]
    motion, (errors,) = np.split(np.reshape(found, (-1, 3)).T, [2])
    fastest = np.maximum(motion.max(axis=1, initial=0.0, keepdims=True), np.finfo(float).tiny)
    moving = motion.any(axis=0)
    # By each alone: short moves accelerate as much as long ones, and err by their lower speed
    by_each = errors[moving] / np.maximum((motion / fastest)[:, moving], _LEAST)
    return (float(np.median(by_each, axis=1).max()) if moving.sum() >= _FEW else 0.0) or math.inf


def far_words(error: float, usual: float, shown: DisplayUnits) -> str:
    """Return in words that a log's largest servo error, m, is far above the usual; empty where it is not."""
    if error <= _FAR * usual:
        return ""
    found, counted = shown.words(error, ".4g"), shown.words(_FAR * usual, ".4g")
    return (
        f"the largest servo error, {found}, is {error / usual:.3g} times what most of the motion lets expect: a "
        f"following_error_max that follows from the log takes it for {counted}; look at it in the report"
    )


def estimated_limits(recordings: Sequence[Recording], T_s: float, usual: float = math.inf) -> dict[str, Any]:
    """Return entries of ``[drive_limits]`` from the motion of the commands, marked as estimates; empty without motion.

    They are :data:`MARGINS` times the largest velocity, acceleration and jerk; the command may change by twice the
    largest servo error, and the compensator trips above :data:`FOLLOWING_ERROR` times it, of which an error far above
    the ``usual`` one, m, as of a drive that ran away, counts as :data:`_FAR` times that.
    """
    peaks, error = largest_motion(recordings, T_s)
    bounds = (*(MARGINS * peaks).tolist(), 2.0 * error, FOLLOWING_ERROR * min(error, _FAR * usual))
    values = list(zip(DRIVE_LIMIT_ENTRIES.items(), bounds, strict=True))
    if not all(value >= (one.minimum or one.nonzero) for (_, one), value in values):
        return {}
    return {**{name: min(float(f"{value:.4g}"), one.maximum) for (name, one), value in values}, "estimated": True}
