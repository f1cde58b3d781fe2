"""Check for a column that holds the following error where the measured position was meant."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..base.signals import Array
from ..intake import fixes
from ..logs.log import Log
from .finding import ERROR, Finding, Fix
from .relation import LAG_MAX, DeadTime, fit_dead_time, line_at_best_lag
from .stretch import averaged, over_time, stretch

__all__ = ["check_following_error"]

_TRAVEL, _POSITION_LEFT = 0.5, 0.3
"""Range of the column, relative to the travel, from which it is no following error; and share of its variance that the
command must leave unexplained at least: it explains more of a position in another unit."""

_EXPLAINED, _OTHER = 0.3, 3.0
"""Share of the following error's variance that a drive may leave unexplained; and least variance that a drive of the
other sign must leave, relative to it."""


def check_following_error(log: Log) -> Iterator[Finding]:
    """Find a measured position that is the following error: small, but ``x_d − x`` is where a drive would be.

    It is nearly proportional to the velocity, as the following error of a drive without feed-forward is, but a velocity
    of the same numbers would put the axis seconds behind its command, or before it.
    """
    x_d, x, _ = averaged(log)
    travel, size = float(np.ptp(x_d)), float(np.ptp(x))
    if travel == 0.0 or not 0.0 < size < _TRAVEL * travel or line_at_best_lag(x_d, x).unexplained < _POSITION_LEFT:
        return
    drives = {sign: fit_dead_time(x_d, x_d - sign * x, None, 1.0) for sign in (1.0, -1.0)}
    left = {sign: _left(drive, x_d - sign * x, x) for sign, drive in drives.items()}
    sign = min(left, key=lambda one: left[one])
    if left[sign] > _EXPLAINED or left[-sign] < _OTHER * left[sign] or abs(drives[sign].gain - 1.0) > 0.1:
        return
    part = stretch(log)
    lag = line_at_best_lag(log.x_d[part], log.x_d[part] - sign * log.x_meas[part]).lag
    words = (
        f"this looks like the following error, not like the measured position: it spans {size / travel:.2g} of the "
        f"travel, and the command {'minus' if sign > 0 else 'plus'} it follows the command as a drive does, "
        f"{lag:.1f} samples late"
    )
    evidence = {"sign": sign, "unexplained": left[sign], "lag": lag}
    formula = "x = x_d − x" if sign > 0 else "x = x_d + x"
    fix = Fix(f"compute the measured position from it, {formula}", partial(fixes.from_error, sign=sign), meaning=True)
    picture = over_time(log, part, log.x_d[part], log.x_meas[part])
    yield Finding("following error", ERROR, words, evidence, picture, fix)


def _left(drive: DeadTime, position: Array, error: Array) -> float:
    """Return the share of the following error's variance that a drive leaves; infinite for one seconds behind."""
    if drive.lag > LAG_MAX:
        return float("inf")
    return drive.unexplained * float(np.var(position) / np.var(error))
