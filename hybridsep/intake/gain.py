"""Checks of the measured position's gain over the commanded one: its sign and its scale."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from ..base.signals import Array
from ..intake import fixes
from ..logs.log import Log
from .drives import NO_BETTER, drive_explaining
from .finding import ERROR, NOTE, Finding, Fix
from .relation import LAG_MAX, DeadTime, Line, fit_dead_time, line_at_best_lag
from .stretch import against_command, averaged, stretch

__all__ = ["check_scale", "check_sign", "runs_against"]

_EXPLAINED, _OPPOSITE = 0.15, 4.0
"""Share of the variance that a mode may leave unexplained if its gain's sign is to count; and least variance that a
mode of the opposite sign must leave, relative to it: where the right sign leaves so little, the wrong one leaves at
least five times as much over swept sines of drives of 10 to 60 Hz, eight times over random drives."""

_LOOSE = 0.7
"""Share of the variance that is left where the measured position hardly follows the command."""

_LEFT_BY_DRIVE = 0.3
"""The same for a drive far above its bandwidth, which does not follow either: friction causes what it leaves there."""

_LATE = 4.0
"""Dead time, in samples, with which its search begins."""

_LEFT_BY_MODE, _GAIN_OTHER = 0.25, 0.2
"""The mode's static gain counts if the mode leaves less than this share of the variance that a line leaves, and their
gains differ by this much, relatively: along a swept sine no lag is right for all frequencies."""

_GAINS = (0.15, 5.0)
"""Gains outside which no position loop is: a small servo under load was recorded at 0.25."""

_GAIN_CLOSE, _LEFT_CLOSE = 0.15, 3e-3
"""Largest distance from 1 of the gain of an axis that follows its command within this share of the variance. An axis
that moves further than its command is in another unit; one that moves less far may be a servo under load."""

_KNOWN_GAINS = {
    1e3: "measured in mm, commanded in m",
    1e-3: "measured in m, commanded in mm",
    1e6: "measured in µm, commanded in m",
    1e-6: "measured in m, commanded in µm",
    180 / math.pi: "measured in deg, commanded in rad",
    math.pi / 180: "measured in rad, commanded in deg",
    1 / 0.0254: "measured in inches, commanded in m",
    25.4: "measured in mm, commanded in inches",
    1 / 25.4: "measured in inches, commanded in mm",
    2 * math.pi: "measured in rad, commanded in revolutions",
    1 / (2 * math.pi): "measured in revolutions, commanded in rad",
    360.0: "measured in deg, commanded in revolutions",
    1 / 360.0: "measured in revolutions, commanded in deg",
}
"""Gains that two units make, and which."""

_KNOWN_WITHIN = 0.03
"""Relative distance from a known gain within which it is meant."""


def runs_against(x_d: Array, x: Array) -> DeadTime | None:
    """Return the mode of negative static gain that explains the motion of a flipped position; None if it is not one.

    The regression at the best lag cannot judge it: above a drive's bandwidth a correct position is late by half a
    period, so a flipped position looks like a late one. A mode has the phase of its static gain at low frequencies.
    Where a drive of positive gain explains the motion, driven far above its bandwidth for example, nothing is wrong
    with the sign.

    Parameters
    ----------
    x_d, x : (n,) array
        Commanded and measured positions.
    """
    same, against = _modes(x_d, x)
    if not _explains(against) or same.unexplained < _OPPOSITE * against.unexplained:
        return None
    return None if drive_explaining(x_d, x).unexplained < NO_BETTER * against.unexplained else against


def _modes(x_d: Array, x: Array) -> tuple[DeadTime, DeadTime]:
    """Return the best modes of positive and of negative gain; with a dead time where there is none without it."""
    return _modes_of(x_d.tobytes(), x.tobytes())


@lru_cache(maxsize=4)
def _modes_of(commanded: bytes, measured: bytes) -> tuple[DeadTime, DeadTime]:
    """Fit them once for all checks of a log, whose largest part it is."""
    x_d, x = np.frombuffer(commanded), np.frombuffer(measured)
    same, against = (fit_dead_time(x_d, x, None, sign) for sign in (1.0, -1.0))
    if min(same.unexplained, against.unexplained) > _EXPLAINED:
        same, against = (fit_dead_time(x_d, x, _LATE, sign) for sign in (1.0, -1.0))
    return same, against


def check_sign(log: Log) -> Iterator[Finding]:
    """Find a measured position that moves opposite to the command."""
    x_d, x, width = averaged(log)
    mode = runs_against(x_d, x)
    if mode is None:
        return
    at_lag = line_at_best_lag(x_d, x)
    # The mode knows the sign; how large the gain is, the line knows as well where it explains the motion.
    fit = at_lag if at_lag.gain < 0.0 and not _mode_counts(mode, at_lag) else _as_line(mode, x_d, x)
    fit = replace(fit, lag=width * fit.lag)
    words = (
        f"the measured position moves opposite to the command (gain {fit.gain:.4g}): its sign is flipped, or the axis "
        "counts the other way"
    )
    change = partial(fixes.scaled, factor=-1.0, column="x_meas")
    fix = Fix("reverse the measured position's sign", change, meaning=True)
    yield Finding("sign", ERROR, words, _numbers(fit), against_command(log, stretch(log), fit), fix)


def _relation(log: Log) -> tuple[Line, bool]:
    """Return gain and lag of the measured position, and whether they are a mode's, as a line does not explain it."""
    x_d, x, width = averaged(log)
    at_lag = line_at_best_lag(x_d, x)
    mode, _ = _modes(x_d, x)
    dynamic = _mode_counts(mode, at_lag)
    fit = _as_line(mode, x_d, x) if dynamic else at_lag
    return replace(fit, lag=width * fit.lag), dynamic


def _mode_counts(mode: DeadTime, at_lag: Line) -> bool:
    better = _explains(mode) and mode.unexplained < _LEFT_BY_MODE * at_lag.unexplained
    return better and (at_lag.unexplained > _LOOSE or abs(mode.gain - at_lag.gain) > _GAIN_OTHER * abs(mode.gain))


def _explains(mode: DeadTime) -> bool:
    """Return whether a mode explains the motion; one that lags by seconds explains a drift."""
    return mode.unexplained <= _EXPLAINED and mode.lag <= LAG_MAX


def _as_line(mode: DeadTime, x_d: Array, x: Array) -> Line:
    return Line(mode.dead_time + mode.lag, mode.gain, float(x.mean() - mode.gain * x_d.mean()), mode.unexplained)


def check_scale(log: Log) -> Iterator[Finding]:
    """Find a measured position in another unit than the commanded one.

    A servo that reaches less far than its command is only noted: load and a small gain of the loop do that.
    """
    fit, dynamic = _relation(log)
    part = stretch(log)
    gain = abs(fit.gain)
    follows = fit.unexplained < _LOOSE
    close = not dynamic and fit.unexplained < _LEFT_CLOSE
    if follows and _GAINS[0] <= gain <= _GAINS[1] and not (close and abs(gain - 1) > _GAIN_CLOSE):
        return
    drive = drive_explaining(*averaged(log)[:2])
    if drive.lag <= LAG_MAX and drive.unexplained < (NO_BETTER * fit.unexplained if follows else _LEFT_BY_DRIVE):
        if close and abs(drive.gain - 1) > _GAIN_CLOSE:
            words = (
                f"the axis reaches {drive.gain:.2g} of its command, as a servo under load or with a small gain does; "
                "where it should reach all of it, the measured position is in another unit"
            )
            picture = against_command(log, part, fit)
            yield Finding("scale", NOTE, words, {**_numbers(fit), "gain": drive.gain}, picture)
        return
    if not follows or gain == 0.0:
        words = f"the measured position hardly follows the command (gain {fit.gain:.3g}): is it another axis, or unit?"
        yield Finding("scale", ERROR, words, _numbers(fit), against_command(log, part, fit))
        return
    known = min(_KNOWN_GAINS, key=lambda value: abs(math.log(gain / value)))
    meant = abs(math.log(gain / known)) < _KNOWN_WITHIN
    factor = 1.0 / (known if meant else gain)
    reason = _KNOWN_GAINS[known] if meant else "a wrong unit, gear ratio or encoder resolution"
    words = f"the measured position is {gain:.6g} times the commanded one: {reason}"
    change = partial(fixes.scaled, factor=factor, column="x_meas")
    fix = Fix(f"multiply the measured position by {factor:.6g}", change, meaning=True)
    yield Finding("scale", ERROR, words, {**_numbers(fit), "factor": factor}, against_command(log, part, fit), fix)


def _numbers(fit: Line) -> dict[str, float]:
    return {"gain": fit.gain, "lag": fit.lag, "unexplained": fit.unexplained}
