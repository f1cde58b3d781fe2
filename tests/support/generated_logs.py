"""Random good logs of simulated axes: kinds of drives, of commands and of encoders, each a pure function of a seed.

The statistic of the checks was chosen on seeds below 1000.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.signal import chirp, lfilter

from hybridsep import ModalModel, Mode
from hybridsep.base.signals import Array
from hybridsep.logs.log import Log

_N = 3000  # samples of a log

Numbers = np.random.Generator


def log_of(x_d: Array, x_meas: Array, T_s: float = 1e-3) -> Log:
    return Log(T_s * np.arange(len(x_d), dtype=np.float64), x_d, x_meas, T_s, Path("log.csv"))


def _moves(numbers: Numbers, f: float, T_s: float, *, share: float = 0.3, moves: int = 12) -> Array:
    """Moves between random positions, smoothed, with rests between them; ``share`` of the time in motion."""
    length = _N // moves
    levels = np.cumsum(numbers.normal(0.0, numbers.choice([0.02, 0.3, 1.0], moves)))
    parts, last = [], 0.0
    for level in levels:
        moving = max(8, round(share * length * numbers.uniform(0.6, 1.4)))
        parts += [np.linspace(last, level, min(moving, length)), np.full(max(length - moving, 0), level)]
        last = level
    x_d = np.concatenate((np.zeros(100), *parts))
    width = max(5, min(round(0.3 / (f * T_s)), 61))
    return np.convolve(np.pad(x_d, width, mode="edge"), np.full(width, 1 / width), "same")[width:-width]


def _resting(numbers: Numbers, f: float, T_s: float) -> Array:
    """A few short moves, with rests over most of the log."""
    return _moves(numbers, f, T_s, share=0.08, moves=int(numbers.integers(3, 7)))


def _sines(numbers: Numbers, f: float, T_s: float) -> Array:
    """A sum of sines below the bandwidth that never rests."""
    t = T_s * np.arange(_N)
    tones = f * numbers.uniform(0.03, 0.6, int(numbers.integers(1, 4)))
    tones = np.maximum(tones, 2.0 / t[-1])
    return np.asarray(sum(np.sin(2 * np.pi * tone * t) / tone * tones.min() for tone in tones))


def _sine_with_rests(numbers: Numbers, f: float, T_s: float) -> Array:
    """A smooth sine that begins and ends at rest, and rests for half of the log or more."""
    t = T_s * np.arange(_N)
    tone = max(f * numbers.uniform(0.05, 0.5), 4.0 / t[-1])
    first, periods = int(numbers.integers(200, 1000)), max(1, int(0.4 * t[-1] * tone))
    phase = np.clip((t - t[first]) * tone, 0.0, periods)
    return np.asarray(1.0 - np.cos(2 * np.pi * phase))


def _swept(numbers: Numbers, f: float, T_s: float) -> Array:
    """A swept sine through the bandwidth and far above it."""
    t = T_s * np.arange(_N - 400)
    first, last = f * numbers.uniform(0.03, 0.2), min(f * numbers.uniform(1.5, 5.0), 0.15 / T_s)
    sine = chirp(t, max(first, 2.0 / t[-1]), t[-1], last, phi=-90)
    return np.concatenate((np.zeros(200), sine, np.full(200, sine[-1])))


def _far_above(numbers: Numbers, f: float, T_s: float) -> Array:
    """Sines above the bandwidth, from rest or not."""
    t = T_s * np.arange(_N)
    tones = np.minimum(f * numbers.uniform(1.2, 4.0, int(numbers.integers(1, 5))), 0.1 / T_s)
    x_d = sum(np.sin(2 * np.pi * tone * t + numbers.uniform(0, 2 * np.pi)) for tone in tones)
    return np.asarray(x_d * (np.clip(t / (0.1 * t[-1]), 0.0, 1.0) if numbers.random() < 0.5 else 1.0))


def _wandering(numbers: Numbers, f: float, T_s: float) -> Array:
    """Noise through a low-pass of the bandwidth."""
    pole = np.exp(-2 * np.pi * f * T_s * numbers.uniform(0.1, 0.8))
    x = numbers.normal(size=_N)
    for _ in range(3):
        x = np.asarray(lfilter([1 - pole], [1, -pole], x))
    return np.asarray(x - x[0])


def _triangles(numbers: Numbers, f: float, T_s: float) -> Array:
    """Strokes to and fro at one speed, from rest."""
    period = max(round(numbers.uniform(3.0, 12.0) / (f * T_s)), 60)
    k = np.arange(_N - 200) % period
    return np.concatenate((np.zeros(200), 2 / period * np.minimum(k, period - k)))


COMMANDS: dict[str, Callable[[Numbers, float, float], Array]] = {
    "moves": _moves,
    "resting": _resting,
    "sines": _sines,
    "sine with rests": _sine_with_rests,
    "swept sine": _swept,
    "far above the bandwidth": _far_above,
    "wandering": _wandering,
    "triangles": _triangles,
}
"""Commands by kind, from random numbers, the drive's bandwidth, Hz, and the sampling interval, s."""


def _modes(x_d: Array, T_s: float, modes: list[Mode], dead_time: int) -> Array:
    discrete = ModalModel(modes, dead_time).discretise(T_s, "zoh")
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


def _lag(numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    omega = 2 * np.pi * f
    return _modes(x_d, T_s, [Mode(f, 1.0, omega**2, omega)], int(numbers.integers(0, 3)))


def _mode(numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    omega = 2 * np.pi * f
    return _modes(x_d, T_s, [Mode(f, float(numbers.uniform(0.15, 1.2)), omega**2)], int(numbers.integers(0, 3)))


def _servo(numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    """A servo under load: of its command it reaches a share."""
    return np.asarray(x_d[0] + numbers.uniform(0.2, 1.0) * (_mode(numbers, x_d, f, T_s) - x_d[0]))


def _resonant(numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    """A servo that moves a load over a spring."""
    omega, zeta = 2 * np.pi * f, float(numbers.uniform(0.5, 1.0))
    other = 2 * np.pi * f * float(numbers.uniform(1.3, 2.5))
    share = float(numbers.uniform(0.05, 0.4))
    modes = [Mode(f, zeta, (1 - share) * omega**2), Mode(other / (2 * np.pi), 0.08, share * other**2)]
    return _modes(x_d, T_s, modes, 0)


def _fed_forward(numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    """A drive with feed-forward of the velocity, which hardly lags."""
    omega, zeta = 2 * np.pi * f, float(numbers.uniform(0.3, 0.9))
    return _modes(x_d, T_s, [Mode(f, zeta, omega**2, float(numbers.uniform(0.5, 1.0)) * 2 * zeta * omega)], 0)


def _with_play(numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    """A lag behind backlash or friction."""
    half = 0.5 * numbers.uniform(0.002, 0.05) * float(np.ptp(x_d))
    played, last = np.empty_like(x_d), float(x_d[0])
    for k, value in enumerate(x_d.tolist()):
        last = min(max(last, value - half), value + half)
        played[k] = last
    return _lag(numbers, played, f, T_s)


DRIVES: dict[str, Callable[[Numbers, Array, float, float], Array]] = {
    "lag": _lag,
    "mode": _mode,
    "servo": _servo,
    "resonant": _resonant,
    "fed forward": _fed_forward,
    "play": _with_play,
}
"""Measured positions without an encoder by kind of the drive, from random numbers, command, bandwidth and interval."""


@dataclass(frozen=True)
class GeneratedLog:
    """Log of a random axis."""

    # their kinds
    command: str
    drive: str
    log: Log

    def __str__(self) -> str:
        return f"{self.drive}, {self.command}, {self.log.unit}"


def generated_log(seed: int) -> GeneratedLog:
    """Return the good log of a seed; 48 seeds in a row have every command with every drive."""
    numbers = np.random.default_rng([21, seed])
    command = list(COMMANDS)[seed % len(COMMANDS)]
    drive = list(DRIVES)[(seed // len(COMMANDS)) % len(DRIVES)]
    T_s = float(numbers.choice([0.5e-3, 1e-3, 2e-3, 5e-3]))
    f = float(numbers.uniform(0.006, 0.05)) / T_s  # 20 to 160 samples a period
    x_d = COMMANDS[command](numbers, f, T_s)
    rotary = bool(numbers.random() < 0.3)
    travel = float(numbers.choice([0.2, 3.0, 40.0]) if rotary else numbers.choice([1e-3, 0.03, 0.4]))
    x_d = travel * x_d / float(np.ptp(x_d))
    if numbers.random() < 0.5:
        quantum = travel * 1e-6
        x_d = quantum * np.round(x_d / quantum)
    x = DRIVES[drive](numbers, x_d, f, T_s)
    x = x + numbers.choice([0.0, 1e-6, 1e-4]) * travel * numbers.normal(size=len(x))
    count = float(numbers.choice([0.0, 1e-6, 1e-4, 5e-4])) * travel
    x = count * np.round(x / count) if count else x
    return GeneratedLog(command, drive, replace(log_of(x_d, x, T_s), unit="rad" if rotary else "m", unit_stated=True))


def _resting_axis() -> Log:
    """A smooth command that dies away, and an axis 4 ms behind it whose encoder soon shows rest."""

    def command(t: Array) -> Array:
        t = np.where(t > 0.0, t, 0.0)
        return np.asarray(0.05 * np.exp(-t) * np.sin(2 * np.pi * 3.0 * t) ** 2)

    t = np.asarray(1e-2 * np.arange(2000), dtype=np.float64)
    x = np.asarray(1e-5 * np.round(command(t - 1.004) / 1e-5), dtype=np.float64)
    return log_of(command(t - 1.0), x, 1e-2)


def _reaches_a_share(share: float) -> Log:
    """A position loop without integrator against a spring."""
    numbers = np.random.default_rng(69)
    x_d = 0.8 * _moves(numbers, 4.0, 5e-3)
    x = share * _modes(x_d, 5e-3, [Mode(4.0, 0.7, (8 * np.pi) ** 2)], 1) + 1e-4 * numbers.normal(size=len(x_d))
    return replace(log_of(x_d, x, 5e-3), unit="rad", unit_stated=True)


def _robot_joint(times: float, dead_time: int) -> Log:
    """A joint of 3 Hz, driven so many times as fast and in motion from the first sample on."""
    t, numbers = 4e-3 * np.arange(3000), np.random.default_rng(75)
    x_d = sum(
        a * np.sin(2 * np.pi * 3.0 * times * f * t + phase) for a, f, phase in ((0.3, 1.0, 0.4), (0.1, 1.13, 2.0))
    )
    x = _modes(np.asarray(x_d), 4e-3, [Mode(3.0, 0.15, (6 * np.pi) ** 2)], dead_time)
    return replace(log_of(np.asarray(x_d), x + 1e-4 * numbers.normal(size=len(t)), 4e-3), unit="rad", unit_stated=True)


ACCUSED_BEFORE: dict[str, tuple[str, Callable[[], Log]]] = {
    "a smooth command, a resting axis": ("columns swapped", _resting_axis),
    **{f"a servo that reaches {share:g}": ("scale", partial(_reaches_a_share, share)) for share in (0.2, 0.45, 0.69)},
    **{
        f"a robot joint at {times:g} times its bandwidth, {late} late": ("sign", partial(_robot_joint, times, late))
        for times, late in ((1.5, 0), (1.5, 2), (2.5, 1))
    },
}
"""Good logs by name that were refused, and as what."""
