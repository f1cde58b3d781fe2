"""Random commands of an axis as an interpolator makes them, at any sampling interval.

From point to point the velocity is piecewise constant, filtered by two moving averages, as controls do it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from random_drives.drive import Draws
from scipy.signal import lfilter

from hybridsep.base.signals import Array


@dataclass(frozen=True)
class Dynamics:
    """Bounds of a command: velocity, m/s, acceleration, m/s², and the time that the latter takes to build up, s."""

    velocity: float
    acceleration: float
    jerk_time: float

    @classmethod
    def draw(cls, draws: Draws, fastest: float) -> "Dynamics":
        """Return random bounds up to a velocity, m/s."""
        return cls(fastest * draws.log_uniform(0.1, 1.0), draws.log_uniform(0.5, 8.0), draws.log_uniform(0.005, 0.06))

    def filtered(self, velocity: Array, T_s: float) -> Array:
        """Return a velocity, (n,), m/s, whose changes keep the bounds."""
        for time in (self.velocity / self.acceleration, self.jerk_time):
            n = max(1, round(time / T_s))
            velocity = lfilter(np.full(n, 1.0 / n), 1.0, velocity)
        return velocity


def random_command(draws: Draws, fastest: float, T_s: float, duration: float) -> tuple[str, Array]:
    """Return the kind of a command and its positions, ``(n,)``, m, at rest at first."""
    kind = draws.choice(tuple(KINDS))
    n, rest = round(duration / T_s), round(draws.uniform(0.02, 0.2) / T_s)
    start = draws.uniform(-0.3, 0.3) if draws.chance(0.5) else 0.0
    moved = KINDS[kind](draws, Dynamics.draw(draws, fastest), n - rest, T_s)
    return kind, start + np.concatenate((np.zeros(rest), moved - moved[0]))


def _moves(draws: Draws, bounds: Dynamics, n: int, T_s: float, rests: tuple[float, float] = (0.0, 0.4)) -> Array:
    """Return moves about a position, each followed by a rest of a random time, s."""
    stroke = draws.log_uniform(0.002, 0.3) * min(1.0, bounds.velocity)
    velocity, k, here = np.zeros(n), 0, 0.0
    ramps = bounds.velocity / bounds.acceleration + bounds.jerk_time
    while k < n:
        target = stroke * draws.uniform(-1.0, 1.0)
        length = max(1, round(abs(target - here) / bounds.velocity / T_s))
        velocity[k : k + length] = (target - here) / (length * T_s)
        k, here = k + length + round((ramps + draws.uniform(*rests)) / T_s), target
    return np.cumsum(bounds.filtered(velocity, T_s)) * T_s


def _segments(draws: Draws, bounds: Dynamics, n: int, T_s: float) -> Array:
    """Return one axis of a contour of short straight segments at a constant feed, which turns or winds on."""
    longest, angle = draws.log_uniform(3e-4, 5e-3), draws.uniform(0.0, 2 * np.pi)
    winding, roughness = draws.normal(1)[0] * 0.3, draws.log_uniform(0.05, 0.6)
    velocity, k = np.zeros(n), 0
    while k < n:
        length = max(1, round(longest * draws.uniform(0.1, 1.0) / bounds.velocity / T_s))
        velocity[k : k + length] = bounds.velocity * np.cos(angle)
        k, angle = k + length, angle + winding + roughness * draws.normal(1)[0]
    return np.cumsum(bounds.filtered(velocity, T_s)) * T_s


def _oscillation(
    draws: Draws, bounds: Dynamics, n: int, T_s: float, slow: float, fast: float, growing: bool = False
) -> Array:
    """Return an oscillation from one frequency, Hz, to another, faded in, or growing until the end."""
    t = np.arange(n) * T_s
    part = t / t[-1]
    omega = 2 * np.pi * slow * (fast / slow) ** part
    amplitude = draws.log_uniform(0.001, 0.1) * (part if growing else 1.0)
    within = np.minimum(np.minimum(amplitude, bounds.velocity / omega), bounds.acceleration / omega**2)
    fade = np.sin(np.pi / 2 * np.minimum(t / 0.3, 1.0)) ** 2
    return np.asarray(fade * within * np.sin(np.cumsum(omega) * T_s + draws.choice((0.0, np.pi / 2))))


def _sine(draws: Draws, bounds: Dynamics, n: int, T_s: float) -> Array:
    f = draws.log_uniform(0.4, 10.0)
    return _oscillation(draws, bounds, n, T_s, f, f)


def _sweep(draws: Draws, bounds: Dynamics, n: int, T_s: float) -> Array:
    slow, fast = draws.log_uniform(0.3, 2.0), draws.log_uniform(4.0, 30.0)
    return _oscillation(draws, bounds, n, T_s, *((slow, fast) if draws.chance(0.7) else (fast, slow)))


def _circle(draws: Draws, bounds: Dynamics, n: int, T_s: float) -> Array:
    """Return one axis of a circle, or of a spiral at a feed that is nearly constant."""
    f = draws.log_uniform(0.4, 4.0)
    if draws.chance(0.5):
        return _oscillation(draws, bounds, n, T_s, f, f * draws.uniform(0.9, 1.1))
    return _oscillation(draws, bounds, n, T_s, f, f * draws.log_uniform(0.4, 1.0), growing=True)


KINDS: dict[str, Callable[[Draws, Dynamics, int, float], Array]] = {
    "moves": _moves,
    "rests": partial(_moves, rests=(0.5, 1.5)),  # few moves
    "segments": _segments,
    "sine": _sine,
    "sweep": _sweep,
    "circle": _circle,
}
