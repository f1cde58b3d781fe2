"""Checks of the measured position against the commanded one: the same, swap, velocity, offset, delay."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..base.signals import Array
from ..intake import fixes
from ..logs.log import Log
from .drives import NO_BETTER, drive_explaining
from .finding import ERROR, NOTE, WARNING, Finding, Fix
from .relation import LAG_MAX, fit_dead_time, line, line_at_best_lag, noise_std, shifted
from .stretch import against_command, averaged, over_time, stretch

if TYPE_CHECKING:
    from ..machines.machine import Machine

__all__ = [
    "check_delay",
    "check_offset",
    "check_same",
    "check_swapped",
    "check_velocity",
]

_NOISIER = 3.0
"""Ratio of the columns' noise from which the noisier one is the measured one."""

_LATE_COMMAND = -1.0
"""Lag of the measured position, samples, up to which the command is the later column."""

_PERHAPS_LATE_COMMAND = 0.5
"""Lag, samples, up to which it may be the later column."""

_LEFT_BY_DRIVE = 0.3
"""Share of the variance that a drive may leave if it is to explain one column by the other."""

_NOISY = -0.5
"""Correlation of neighbouring fifth differences above which the signal is a motion; in white noise it is -5/6."""

_VELOCITY_SHARE = 0.5
"""Share of the variance that a velocity must explain at least."""

_VELOCITY_LEFT = 0.3
"""Largest part that it leaves unexplained, relative to the part that the position leaves."""

_OFFSET_TRAVEL = 0.02
"""Offset, relative to the travel, from which it is no servo error."""

_OFFSET_SPREAD = 6.0
"""The same, relative to the spread of the error around it."""

_OFFSET_REST = 2.0
"""Offset, relative to the travel that the gain leaves out, below which an axis at rest may have it."""

_DELAY_MIN = 3.0
"""Dead time, in samples, below which a drive may have it."""


class _DelayRule(NamedTuple):
    """What a dead time must do to be noted.

    Attributes
    ----------
    gain : float
        It divides the squared residual of one mode by this at least.
    lags : float
        It is this many times the mode's lag at least.
    left : float
        It leaves at most this share of the squared residual of a mere lag: further modes look like a dead time, too.
    """

    gain: float
    lags: float
    left: float


_DELAYS = (_DelayRule(4.5, 0.4, 1.0), _DelayRule(2.0, 1.1, 0.2), _DelayRule(1.1, 2.5, 1.0))
"""One of them must hold."""

_LEAD_MIN = 3.5
"""Lead, in samples, below which modes in antiphase may show it."""


class _LeadRule(NamedTuple):
    """What a response before its cause must do to be noted.

    Attributes
    ----------
    gain : float
        It divides the squared residual by this at least.
    lag : float
        The whole response's lag is below this, samples.
    """

    gain: float
    lag: float


_LEADS = (_LeadRule(50.0, -1.0), _LeadRule(8.0, -2.5))
"""One of them must hold."""

_MODEL_DELAY = 0.4
"""Delay against a known model, in samples, from which it is noted."""

_MODEL_SHARE = 0.4
"""The same, relative to the model's own lag."""

_MODEL_GAIN = 10.0
"""Factor by which its correction must reduce the squared error."""


def check_same(log: Log) -> Iterator[Finding]:
    """Find a measured position that is the commanded one in every sample; no axis follows like that."""
    if not np.array_equal(log.x_d, log.x_meas):
        return
    words = (
        "the measured position is the commanded one in every sample: one column is read for both, or the axis was "
        "simulated; name the measured position's column (--x)"
    )
    part = stretch(log)
    yield Finding("same column", ERROR, words, {}, over_time(log, part, log.x_d[part], log.x_meas[part]), None)


def check_swapped(log: Log) -> Iterator[Finding]:
    """Find a commanded position that is noisy and late where the measured one is smooth: the columns are swapped.

    All three signs must be there, as an exchange makes nonsense of a good log: noise, lateness, and a drive that
    explains the exchanged columns and not the given ones. Noise alone is only noted.
    """
    part = stretch(log)
    x_d, x = log.x_d[part], log.x_meas[part]
    noise = noise_std(x_d) / max(float(np.ptp(x_d)), 1e-300), noise_std(x) / max(float(np.ptp(x)), 1e-300)
    if not (noise[0] > _NOISIER * noise[1] and noise[0] > 1e-9 and _is_noise(x_d) and np.ptp(x) > 0.0):
        return
    lag = line_at_best_lag(x_d, x).lag
    if lag > _PERHAPS_LATE_COMMAND:
        return
    means, means_x, _ = averaged(log)
    given, exchanged = (drive_explaining(*each).unexplained for each in ((means, means_x), (means_x, means)))
    if min(given, exchanged) > _LEFT_BY_DRIVE or given * NO_BETTER < exchanged:
        return
    evidence = {"lag": lag, "noise_x_d": noise[0], "noise_x": noise[1]}
    noisier = f"({noise[0]:.1e} of its travel against {noise[1]:.1e})"
    if lag > _LATE_COMMAND or given < NO_BETTER * exchanged:
        words = (
            f"x_d is noisier than x {noisier}, and not clearly ahead of it ({lag:.1f} samples): the columns may be "
            "swapped; they are taken as they are"
        )
        yield Finding("columns swapped", NOTE, words, evidence, over_time(log, part, x_d, x))
        return
    words = (
        f"x_d follows x, {-lag:.1f} samples later, and is the noisier one {noisier}, and a drive explains it by x, not "
        "x by it: the columns are swapped"
    )
    fix = Fix("exchange the commanded and the measured position", fixes.swapped, meaning=True)
    yield Finding("columns swapped", ERROR, words, evidence, over_time(log, part, x_d, x), fix)


def check_velocity(log: Log) -> Iterator[Finding]:
    """Find a column that holds a velocity where a position was meant."""
    part = stretch(log)
    x_d, x = log.x_d[part], _smooth(log.x_meas[part])
    position = line_at_best_lag(x_d, x).unexplained
    for column, cause, effect, sense in (
        ("x_meas", np.gradient(x_d) / log.T_s, x, "measured"),
        ("x_d", np.gradient(x) / log.T_s, x_d, "commanded"),
    ):
        fit = line_at_best_lag(cause, effect)
        explained = 1.0 - fit.unexplained
        if explained < _VELOCITY_SHARE or fit.unexplained > _VELOCITY_LEFT * position:
            continue
        drive = drive_explaining(*averaged(log)[:2])
        if drive.lag <= LAG_MAX and drive.unexplained < NO_BETTER * fit.unexplained:
            continue
        # The derivative of noise biases its gain, the integral does not.
        travelled = log.T_s * np.cumsum(effect if column == "x_meas" else x_d)
        whole = line_at_best_lag(travelled, x_d if column == "x_meas" else x)
        factor = whole.gain if whole.gain != 0.0 else 1.0 / fit.gain
        near = min((1.0, 1e-3, 1e3, 60.0, 0.06, 1 / 60), key=lambda known: abs(math.log(abs(factor) / known)))
        factor = math.copysign(near, factor) if abs(math.log(abs(factor) / near)) < 0.1 else factor
        words = (
            f"the {sense} position is a velocity: the other column's derivative explains {100 * explained:.1f} % of "
            f"it, the position itself {100 * (1 - position):.1f} %"
        )
        evidence = {"explained": explained, "explained_by_position": 1 - position, "factor": factor}
        change = partial(fixes.integrated, column=column, factor=factor)
        fix = Fix(f"integrate the {sense} velocity, or better name a column of positions", change, meaning=True)
        picture = over_time(log, part, fit.gain * cause + fit.offset, effect, ("derivative of the other", sense))
        yield Finding("velocity for position", ERROR, words, evidence, picture, fix)
        return


def check_offset(log: Log) -> Iterator[Finding]:
    """Find a measured position that counts from another zero."""
    part = stretch(log)
    x_d, x = log.x_d[part], log.x_meas[part]
    fit = line_at_best_lag(x_d, x)
    error = x - shifted(x_d, fit.lag)
    offset = float(np.median(error))
    spread = float(np.quantile(np.abs(error - offset), 0.9))
    travel = float(np.ptp(x_d))
    if abs(offset) < _OFFSET_TRAVEL * travel or abs(offset) < _OFFSET_SPREAD * spread:
        return
    # An axis that reaches a share of its command is as far from it wherever it rests.
    if abs(offset) < _OFFSET_REST * abs(1.0 - fit.gain) * travel:
        return
    factor, unit = log.shown.position
    words = (
        f"the measured position is {factor * offset:+.6g} {unit} away from the commanded one throughout, "
        f"{abs(offset) / travel:.2g} of the travel, while the error varies by {factor * spread:.2g} {unit}: it counts "
        "from another zero"
    )
    evidence = {"offset": offset, "spread": spread, "travel": travel}
    fix = Fix(
        f"subtract {factor * offset:.6g} {unit} from the measured position",
        partial(fixes.offset_removed, offset=offset),
        meaning=True,
    )
    yield Finding("offset", ERROR, words, evidence, against_command(log, part, fit), fix)


def check_delay(log: Log, machine: Machine | None = None) -> Iterator[Finding]:
    """Find a measured position that is recorded too late or too early, by whole samples and fractions."""
    part = stretch(log)
    x_d, x = log.x_d[part], log.x_meas[part]
    found = _delay_of_model(log, part, machine) if machine is not None else _delay_of_mode(x_d, x)
    if found is None:
        return
    delay, evidence, against = found
    samples = f"{abs(delay):.1f} samples ({1e3 * abs(delay) * log.T_s:.3g} ms)"
    picture = over_time(log, part, x_d, x)
    if delay > 0 and machine is None:
        words = (
            f"the measured position lags {samples} beyond what one mode explains: dead time of the drive, a late "
            "encoder, or another mode, which the log alone cannot tell apart; an identified model takes it in, and "
            "measurement_delay stays 0 with it, unless the encoder is known to be late"
        )
        yield Finding("delay", NOTE, words, evidence, picture)
        return
    late = "late" if delay > 0 else "early"
    words = f"the measured position is recorded {samples} too {late} against {against}"
    # A whole number of samples leaves the measurement as it is.
    whole = round(delay) if abs(delay - round(delay)) < 0.15 else delay
    shift = f"shift the measured position by {-whole:+.3g} samples"
    if delay > 0:
        shift += (
            f"; where the controller gets it as late, say so to the predictor: measurement_delay = {round(delay)}, "
            "which replaces as much of the model's dead_time (never both)"
        )
    fix = Fix(shift, partial(fixes.shifted_back, delay=float(whole)), meaning=True)
    severity = ERROR if delay < 0 else WARNING
    yield Finding("delay", severity, words, evidence, picture, fix)


def _delay_of_mode(x_d: Array, x: Array) -> tuple[float, dict[str, float], str] | None:
    """Return the dead time beyond what one mode explains, and its evidence; None if it is as a drive's."""
    total = line_at_best_lag(x_d, x)
    if total.unexplained > 0.5:
        return None
    free, none = fit_dead_time(x_d, x, total.lag), fit_dead_time(x_d, x, None)
    gain = none.unexplained / max(free.unexplained, 1e-300)
    delay = free.dead_time
    left = free.unexplained / max(total.unexplained, 1e-300)
    late = delay >= _DELAY_MIN and any(
        gain >= rule.gain and delay >= rule.lags * free.lag and left <= rule.left for rule in _DELAYS
    )
    early = delay <= -_LEAD_MIN and any(gain >= rule.gain and total.lag <= rule.lag for rule in _LEADS)
    if not (late or early):
        return None
    evidence = {"delay": delay, "lag": total.lag, "gain": gain}
    return delay, evidence, "the motion that a drive without dead time makes of the command"


def _delay_of_model(log: Log, part: slice, machine: Machine | None) -> tuple[float, dict[str, float], str] | None:
    """Return the delay against the machine's model, and its evidence; None if correcting it gains little."""
    assert machine is not None
    discrete = machine.model.discretise(log.T_s, machine.physics.input_hold)
    start = log.x_d[part][0]
    x_pb = start + discrete.forced_response(discrete.rest(), log.x_d[part] - start)[0]
    x = log.x_meas[part]
    fit, now = line_at_best_lag(x_pb, x), line(x_pb, x)
    gain = now.unexplained / max(fit.unexplained, 1e-300)
    own = line_at_best_lag(log.x_d[part], x_pb).lag
    if abs(fit.lag) < max(_MODEL_DELAY, _MODEL_SHARE * abs(own)) or gain < _MODEL_GAIN or fit.unexplained > 0.5:
        return None
    return fit.lag, {"delay": fit.lag, "gain": gain}, f"the model of {machine.name}"


def _smooth(x: Array) -> Array:
    """Return the mean of fifteen neighbours."""
    return np.asarray(np.convolve(np.pad(x, 7, mode="edge"), np.full(15, 1 / 15), "valid"))


def _is_noise(x: Array) -> bool:
    """Return whether a signal is noise and no motion, by its fifth differences."""
    steps = np.diff(x, 5)
    return bool(steps[1:] @ steps[:-1] < _NOISY * float(steps @ steps))
