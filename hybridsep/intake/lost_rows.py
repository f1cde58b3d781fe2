"""Check for rows that are missing although the times are evenly spaced: they were numbered anew."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array
from ..intake import fixes
from ..logs.log import Log
from .finding import ERROR, Finding, Fix, Picture

__all__ = ["check_lost_rows"]

_ALIKE = 0.35
"""Largest relative difference between the local step and the steps beside it."""

_WHOLE = 0.15
"""Largest distance of a step from a whole multiple, two or more, of the local step."""

_MOST = 4
"""Most rows lost together that a step is tested for."""

_RESOLVED, _ONE_SIZE, _MOVING = 8.0, 0.4, 0.1
"""Local step, in the command's smallest change of a step, from which it is judged, or below the inverse of the second
one, where all steps are of one size; and the same in the fastest motion's."""

_BETWEEN, _CHANCE = (1.5, 2.5), 3.0
"""Multiples that show how many are whole by chance, as a command changes its speed, and how many times as many, and
as three more, must be whole."""

_EXACT, _EXACT_SIGMAS = 0.03, 20.0
"""Distance from a whole number, and standard errors of what the measured position does of it, from which fewer than
three will do, where none is between whole numbers."""

_MEASURED, _SIGMAS = 0.5, 5.0
"""What the measured position must do of the multiple, in the mean, and in its standard errors: it has lost the same
rows, whereas an axis does not follow an uneven command within a sample."""


def check_lost_rows(log: Log, bridged: int = 1) -> Iterator[Finding]:
    """Find steps of both positions, within a smooth motion, that are whole multiples of the steps around them.

    Parameters
    ----------
    log : Log
        Without missing measurements.
    bridged : int
        0 if the fix must not leave measurements missing; it interpolates them then.
    """
    multiple, judged = _multiples(log.x_d)
    if len(log.starts) > 1:
        judged[np.array(log.starts[1:]) - 1] = False
    whole = np.round(multiple)
    lost = judged & (whole >= 2) & (whole <= _MOST + 1) & (np.abs(multiple - whole) < _WHOLE)
    between = judged & ~lost & (multiple > _BETWEEN[0]) & (multiple < _BETWEEN[1])
    n = int(lost.sum())
    by_chance = float(between.sum()) * 2 * _WHOLE / (_BETWEEN[1] - _BETWEEN[0] - 2 * _WHOLE)
    if not n:
        return
    follows, error = _followed(log, multiple, lost, judged & (np.abs(multiple - 1.0) < _WHOLE))
    many = n >= 3 + _CHANCE * by_chance and follows > max(_MEASURED, _SIGMAS * error)
    exact = float(np.abs(multiple - whole)[lost].max()) < _EXACT and abs(follows - 1.0) < 2 * _WHOLE
    if not (many or (exact and by_chance == 0.0 and follows > _EXACT_SIGMAS * error)):
        return
    before = np.flatnonzero(lost) + 1
    rows = (whole[lost] - 1).astype(np.intp)
    share = n / max(int(judged.sum()), 1)
    words = (
        f"{rows.sum()} rows are missing, and the times were numbered anew: in {n} sample{'s' if n > 1 else ''} "
        f"({100 * share:.2g} % of the smooth motion) both positions go two steps at once, or more; the first is before "
        "sample "
        f"{before[0] + 1}, t = {log.t[before[0]]:.6g} s; as many are missing at rest, where nothing shows it"
    )
    evidence = {"n": float(n), "n_lost": float(rows.sum()), "share": share, "measured": follows}
    change = partial(fixes.inserted, starts=before, lost=rows, missing=bridged > 0)
    fix = Fix("insert them, the command interpolated, and number the times again", change)
    t = log.t - log.t[0]
    factor, unit = log.shown.position
    lines = {"step of the command": (t[1:], factor * np.diff(log.x_d))}
    picture = Picture("Steps between samples", "time [s]", f"step [{unit}]", lines, t[before])
    yield Finding("lost rows", ERROR, words, evidence, picture, fix)


def _local(steps: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the cubic through the four steps around each, and whether the two beside it are like it."""
    padded = np.pad(steps, 2, mode="edge")
    local = (-padded[:-4] + 4 * padded[1:-3] + 4 * padded[3:-1] - padded[4:]) / 6
    off = np.maximum(np.abs(padded[1:-3] - local), np.abs(padded[3:-1] - local))
    return local, np.asarray(off < _ALIKE * np.abs(local))


def _multiples(x_d: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return each step in the local one, and where that is judged: in a smooth motion, (n − 1,)."""
    steps = np.diff(x_d)
    local, alike = _local(steps)
    size, largest = np.abs(local), float(np.quantile(np.abs(steps), 0.99))
    changes = np.abs(np.diff(steps))
    count = float(changes[changes > 1e-9 * largest].min(initial=np.inf))
    judged = alike & (size > _MOVING * largest) & ((size > _RESOLVED * count) | (count > _ONE_SIZE * size))
    return np.divide(steps, local, out=np.ones(len(steps)), where=judged), judged


def _followed(log: Log, multiple: Array, lost: NDArray[np.bool_], other: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the share of the multiples that the measured position makes in the mean, and its standard error."""
    steps, direction = np.diff(log.x_meas), np.sign(np.diff(log.x_d))
    padded = np.pad(steps, 2, mode="edge")
    local = (padded[:-4] + padded[1:-3] + padded[3:-1] + padded[4:]) / 4  # a cubic would add to the noise
    excess, weight = (steps - local) * direction, local * direction * (multiple - 1.0)
    total = float(weight[lost].sum())
    if total <= 0.0:
        return 0.0, 0.0
    spread = float(np.sqrt(np.mean(excess[other] ** 2))) if other.any() else 0.0
    return float(excess[lost].sum()) / total, spread * float(np.sqrt(lost.sum())) / total
