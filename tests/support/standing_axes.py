"""Good logs of axes that stand by friction and gravity short of their command, and the same with a clipped position.

A servo under load: a position loop without an integrator, whose force may be limited, a mass, Coulomb friction and
stiction, gravity on an arm, play, a bus and a coarse encoder. Each log is a pure function of a seed. The thresholds of
``intake/clipped.py`` were chosen on seeds below 1000.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from spoiled_logs import log_of

from hybridsep.base.signals import Array
from hybridsep.logs.log import Log

__all__ = ["CLIPS", "COMMANDS", "clipped_axis", "standing_axis"]

_N = 2500
"""Samples of a log."""

_STEPS = 8
"""Steps of integration in a sample."""

Numbers = np.random.Generator


def _circle(numbers: Numbers, n: int) -> Array:
    """Sines of one amplitude and several speeds, with a dwell between them: all turn at the same place."""
    parts = [np.zeros(100)]
    while sum(map(len, parts)) < n:
        period, turns = int(numbers.integers(250, 700)), int(numbers.integers(1, 4))
        parts += [np.sin(2 * np.pi * np.arange(turns * period) / period), np.zeros(int(numbers.integers(0, 150)))]
    return np.concatenate(parts)[:n]


def _waypoints(numbers: Numbers, n: int) -> Array:
    """Smooth moves between random places, with a dwell at each."""
    return _moves(numbers, n, numbers.uniform(-1.0, 1.0, 60), numbers.uniform(0.3, 0.8))


def _pick_and_place(numbers: Numbers, n: int) -> Array:
    """Smooth moves between the same three places, with a dwell at each."""
    return _moves(numbers, n, np.resize([1.0, -0.2, -1.0, -0.2], 60), numbers.uniform(0.3, 0.7), (80, 200))


def _staircase(numbers: Numbers, n: int) -> Array:
    """Steps up and down, with a dwell on each."""
    levels = np.concatenate((np.linspace(0, 1, 6), np.linspace(1, -1, 11), np.linspace(-1, 0, 6)))
    return _moves(numbers, n, np.resize(levels, 60), 0.1, (50, 110))


def _ramps(numbers: Numbers, n: int) -> Array:
    """Strokes to and fro at one speed, some with a dwell at the turning points."""
    period, dwell = int(numbers.integers(300, 800)), numbers.choice([0.0, 0.3, 0.6])
    k = np.arange(n) % period / period
    return np.asarray(np.clip(np.where(k < 0.5, 4 * k - 1, 3 - 4 * k) / (1 - dwell), -1.0, 1.0))


def _multisine(numbers: Numbers, n: int) -> Array:
    """A sum of slow sines."""
    k, periods = np.arange(n), numbers.uniform(150, 900, 4)
    phases = numbers.uniform(0, 2 * np.pi, 4)
    return np.asarray(
        sum(np.sin(2 * np.pi * k / period + phase) for period, phase in zip(periods, phases, strict=True))
    )


def _moves(numbers: Numbers, n: int, places: Array, share: float, lengths: tuple[int, int] = (120, 320)) -> Array:
    """Smooth moves from place to place, each of a length of its own, of which ``share`` is in motion."""
    parts, last = [np.zeros(100)], 0.0
    for place in places.tolist():
        length = int(numbers.integers(*lengths))
        moving = max(4, round(share * length))
        s = np.arange(1, moving + 1) / moving
        parts += [last + (place - last) * (3 * s**2 - 2 * s**3), np.full(length - moving, place)]
        last = place
    return np.concatenate(parts)[:n]


COMMANDS: dict[str, Callable[[Numbers, int], Array]] = {
    "circle": _circle,
    "waypoints": _waypoints,
    "pick and place": _pick_and_place,
    "staircase": _staircase,
    "ramps": _ramps,
    "multisine": _multisine,
}
"""Commands by kind, from random numbers and the number of samples."""


def _arm(numbers: Numbers, x_d: Array, most: float) -> Array:
    """Return the positions of a servo under load; ``most`` is the largest stiction, in the amplitude.

    Lengths are in the command's amplitude, forces in the loop's stiffness times it, times in samples.
    """
    omega = float(numbers.uniform(0.08, 0.35))
    damping = 2.0 * float(numbers.uniform(0.5, 1.2)) * omega
    static = most * float(numbers.uniform(0.1, 1.0))
    coulomb = static * float(numbers.uniform(0.4, 0.95))
    load = float(numbers.choice([0.0, 0.03, 0.1])) * float(numbers.uniform(-1.0, 1.0))
    lever = float(numbers.uniform(0.3, 1.5))
    strongest = static + abs(load) + float(numbers.choice([math.inf, 0.4]))
    half_play = float(numbers.choice([0.0, 0.0, 0.01])) * float(numbers.uniform(0.2, 1.0))
    h, x, v, found = 1.0 / _STEPS, float(x_d[0]), 0.0, []
    seen = x
    for command in x_d.tolist():
        seen = min(max(seen, x - half_play), x + half_play)
        found.append(seen)
        for _ in range(_STEPS):
            force = min(max(command - x, -strongest), strongest) - load * math.cos(lever * x)
            if v == 0.0 and abs(force) <= static:
                break  # for the rest of the sample
            friction = math.copysign(coulomb, v if v != 0.0 else force)
            after = v + h * (omega**2 * (force - friction) - damping * v)
            v = 0.0 if after * v < 0.0 else after
            x += h * v
    return np.array(found)


def _log(numbers: Numbers, x_d: Array, x: Array) -> Log:
    """Return the log of an encoder of a late bus, in m or rad."""
    late, scale = int(numbers.integers(0, 6)), float(numbers.choice([0.02, 0.3, 0.5]))
    x = np.concatenate((np.full(late, x[0]), x[: len(x) - late]))
    count = float(numbers.choice([1e-4, 1e-3, 4e-3]))
    noise = float(numbers.choice([0.0, 0.0, 0.3])) * count
    x = count * np.rint((x + noise * numbers.normal(size=len(x))) / count)
    log = log_of(scale * x_d, scale * x, float(numbers.choice([1e-3, 5e-3, 20e-3])))
    return replace(log, unit="m" if scale < 0.1 else "rad", unit_stated=True)


def _axis(seed: int, most: float) -> Log:
    numbers = np.random.default_rng([35, seed])
    x_d = list(COMMANDS.values())[seed % len(COMMANDS)](numbers, _N)
    x_d = x_d / float(np.abs(x_d).max())
    return _log(numbers, x_d, _arm(numbers, x_d, most))


def standing_axis(seed: int) -> Log:
    """Return the good log of a seed; its stiction is at most a tenth of the amplitude."""
    return _axis(seed, 0.1)


CLIPS = ("both ends", "the upper end", "the lower end")
"""Where a position is clipped, by the seed: at both ends where the command comes to one too rarely."""

_RARELY = ("waypoints", "staircase", "multisine")


def clipped_axis(seed: int) -> Log:
    """Return the log of a seed with its position clipped where the motion passes 55 to 80 % of its half travel.

    Its stiction is at most 2 % of the amplitude: what the axis misses by friction is less than what is clipped.
    """
    log, numbers = _axis(seed, 0.02), np.random.default_rng([36, seed])
    x, share = log.x_meas, float(numbers.uniform(0.55, 0.8))
    middle, half = 0.5 * float(x.max() + x.min()), 0.5 * float(np.ptp(x))
    rarely = list(COMMANDS)[seed % len(COMMANDS)] in _RARELY
    where = CLIPS[0 if rarely else (seed // len(COMMANDS)) % len(CLIPS)]
    low = middle - share * half if where != "the upper end" else -math.inf
    high = middle + share * half if where != "the lower end" else math.inf
    return replace(log, x_meas=np.clip(x, low, high))
