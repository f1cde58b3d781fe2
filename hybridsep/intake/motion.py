"""Checks of what a log shows of the axis: enough motion, a start at rest, enough samples a period, a plausible unit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array
from ..intake import fixes
from ..logs.log import Log
from ..logs.units import UNIT_OPTIONS
from .finding import ERROR, HOPELESS, NOTE, WARNING, Finding, Fix, Picture
from .relation import noise_std

if TYPE_CHECKING:
    from ..machines.machine import Machine
    from ..model.physics import Mode

__all__ = ["check_motion", "check_rate", "check_start", "check_unit", "moves", "starts_in_motion"]

_SAMPLES_MIN = 200
"""Samples below which nothing can be learned and judged: two windows of the default length."""

_MOVING_MIN = 30
"""Samples in motion below which dynamics cannot be seen."""

_NOISE_TIMES = 3.0
"""Travel of the mean of 25 samples, in standard deviations of the noise, below which noise is all there is."""

_START = 0.25
"""Velocity between the first samples, relative to the largest, from which a start is in motion; EMPS has 0.12."""

_FIRST = 10
"""Samples whose mean velocity must say so as well: at rest a command may flicker by one count."""

_LARGEST = {"travel": (20.0, "m"), "velocity": (20.0, "m/s"), "acceleration": (500.0, "m/s²")}
"""Largest travel and motion of a feed axis; a log with more was read in too large a unit."""

_PER_PERIOD = 4.0
"""Samples a period of the fastest mode below which its motion is not resolved."""

_DECAYED = 0.05
"""Share of a mode's motion that is left after one sample, below which it does not oscillate between samples."""


def moves(log: Log) -> NDArray[np.bool_]:
    """Return which samples of a command move, (n − 1,); the steps between segments do not."""
    steps = np.abs(np.diff(log.x_d))
    steps[np.array(log.starts[1:], dtype=np.intp) - 1] = 0.0
    return np.asarray(steps > 1e-3 * steps.max(initial=0.0))


def check_motion(log: Log) -> Iterator[Finding]:
    """Find a log with too little motion to learn from."""
    travel, noise = float(np.ptp(log.x_d)), noise_std(log.x_meas)
    moving, n = int(moves(log).sum()), len(log.t)
    reasons = []
    if travel == 0.0:
        reasons.append("the command never moves")
    elif np.ptp(_mean(log.x_meas)) < _NOISE_TIMES * noise:
        reasons.append(f"the measured position is noise, of a deviation of {log.shown.words(noise)}")
    elif moving < _MOVING_MIN:
        reasons.append(f"the command moves in {moving} samples only")
    if np.isnan(log.x_meas).all():
        reasons.append("every measured position is missing")
    elif travel > 0.0 and np.ptp(log.x_meas) == 0.0:
        reasons.append("the measured position never changes")
    if n < _SAMPLES_MIN:
        reasons.append(f"there are {n} samples, fewer than {_SAMPLES_MIN}")
    if not reasons:
        return
    words = f"{' and '.join(reasons)}: this log cannot determine a model; record moves over the travel that is used"
    evidence = {"travel": travel, "noise": noise, "n_moving": float(moving), "n": float(n)}
    yield Finding(HOPELESS, WARNING, words, evidence, _positions(log, "Command and measurement"))


def _mean(x: Array) -> Array:
    """Return the mean of 25 neighbours."""
    return np.asarray(np.convolve(x, np.full(25, 0.04), "valid") if len(x) > 25 else x)


def starts_in_motion(x_d: Array) -> bool:
    """Return whether a command, (n,), moves from its first sample on, and not only flickers at rest."""
    n = min(_FIRST, len(x_d) - 1)
    if n < 1:
        return False
    steps, means = np.abs(np.diff(x_d)), np.abs(x_d[n:] - x_d[:-n])
    return bool(steps[0] > _START * steps.max() and means[0] > _START * means.max())


def check_start(log: Log) -> Iterator[Finding]:
    """Find a log that begins in motion, in a state that must be estimated."""
    if not starts_in_motion(log.x_d):
        return
    largest = float(np.abs(np.diff(log.x_d)).max())
    first = float(abs(log.x_d[1] - log.x_d[0]))
    factor, unit = log.shown.position
    words = (
        f"the log begins in motion, at {factor * first / log.T_s:.3g} {unit}/s of {factor * largest / log.T_s:.3g} at "
        "most; the state in which the axis begins is estimated from its first samples"
    )
    rest = _first_rest(log.x_d, largest)
    fix = None
    if rest is not None:
        fix = Fix(f"leave out the first {rest} samples, up to the first rest", partial(fixes.begin_at, first=rest))
    evidence = {"velocity": first / log.T_s, "largest": largest / log.T_s}
    yield Finding("start in motion", WARNING, words, evidence, _positions(log, "Start", min(len(log.t), 500)), fix)


def _first_rest(x_d: Array, largest: float) -> int | None:
    """Return the sample from which the command rests for 20 samples, within the first half; None if it never does."""
    resting = np.abs(np.diff(x_d)) <= 1e-3 * largest
    sums = np.convolve(resting, np.ones(20), "valid")
    found = np.flatnonzero(sums >= 20)
    # The drive settles in what is left of the rest.
    return int(found[0]) if len(found) and found[0] < len(x_d) // 2 else None


def check_unit(log: Log) -> Iterator[Finding]:
    """Find positions that no axis has in metres, where nothing states their unit."""
    if log.unit != "m" or log.unit_stated:
        return
    evidence = {"travel": float(np.ptp(log.x_d)), **_fastest(log)}
    beyond = [name for name, (largest, _) in _LARGEST.items() if evidence[name] > largest]
    if not beyond:
        return
    shown = " and ".join(f"{_LARGEST[name][1]} of {name}".join((f"{evidence[name]:.4g} ", "")) for name in beyond)
    words = (
        f"read in m there are {shown}, more than a feed axis has: the positions are rather in mm (--unit mm), µm "
        "(--unit um), or deg of a rotary axis (--unit deg)"
    )
    fix = Fix("read both positions as mm", partial(fixes.scaled, factor=1e-3), meaning=True, options=UNIT_OPTIONS)
    yield Finding("unit", ERROR, words, {**evidence, "factor": 1e-3}, _positions(log, "Positions as read"), fix)


def _fastest(log: Log) -> dict[str, float]:
    """Return velocity and acceleration that the command exceeds in 1 % of its motion, over ten samples each."""
    velocity, acceleration = [0.0], [0.0]
    for segment in log.segments():
        speed = (segment.x_d[10:] - segment.x_d[:-10]) / (10 * log.T_s)
        speed = speed[speed != 0.0]
        if len(speed) > 10:
            velocity.append(float(np.quantile(np.abs(speed), 0.99)))
            acceleration.append(float(np.quantile(np.abs(speed[10:] - speed[:-10]), 0.99)) / (10 * log.T_s))
    return {"velocity": max(velocity), "acceleration": max(acceleration)}


def check_rate(log: Log, machine: Machine) -> Iterator[Finding]:
    """Find a sampling interval that does not resolve the machine's fastest oscillation, or is not the machine's.

    A mode that does not oscillate between samples needs none: a lag may be written as one mode, however fast, of a
    large damping ratio.
    """
    modes = machine.model.modes
    oscillating = [mode for mode in modes if _oscillates(mode, log.T_s)]
    fastest = max(mode.f_n for mode in oscillating or modes)
    per_period = 1.0 / (fastest * log.T_s)
    evidence = {"f_n": fastest, "samples_per_period": per_period, "T_s": log.T_s, "machine_T_s": machine.T_s}
    t = np.arange(0.0, 2.0 / fastest, log.T_s)
    fine = np.linspace(0.0, 2.0 / fastest, 200)
    lines = {
        "fastest mode": (fine, np.sin(2 * math.pi * fastest * fine)),
        "as sampled": (t, np.sin(2 * math.pi * fastest * t)),
    }
    picture = Picture("Fastest mode of the machine, and its samples", "time [s]", "", lines)
    if oscillating and per_period < _PER_PERIOD:
        words = (
            f"the log has {per_period:.2g} samples a period of the machine's mode at {fastest:.4g} Hz, which needs "
            f"{_PER_PERIOD:g} at least; record faster, or leave that mode out of the model"
        )
        yield Finding("sampling rate", ERROR, words, evidence, picture)
    elif abs(log.T_s - machine.T_s) > 0.01 * machine.T_s:
        words = f"the log is sampled every {log.T_s:.6g} s, the machine file says T_s = {machine.T_s:.6g} s"
        severity = NOTE if log.T_s < machine.T_s else ERROR
        fix = Fix(f"resample at {machine.T_s:g} s", partial(_at_interval, T_s=machine.T_s))
        yield Finding("sampling rate", severity, words, evidence, picture, fix)


def _oscillates(mode: Mode, T_s: float) -> bool:
    """Return whether a mode oscillates, and for longer than a sample."""
    return mode.zeta < 1.0 and math.exp(-2 * math.pi * mode.zeta * mode.f_n * T_s) > _DECAYED


def _at_interval(log: Log, T_s: float) -> Log:
    return fixes.resampled(replace(log, T_s=T_s))


def _positions(log: Log, title: str, n: int | None = None) -> Picture:
    t = (log.t - log.t[0])[:n]
    factor, unit = log.shown.position
    lines = {"commanded": (t, factor * log.x_d[:n]), "measured": (t, factor * log.x_meas[:n])}
    return Picture(title, "time [s]", f"position [{unit}]", lines)
