"""Random good logs of simulated axes: kinds of drives, of commands and of encoders, each a pure function of a seed."""

from collections.abc import Callable
from dataclasses import replace
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


def _tones(numbers: Numbers, f: float, T_s: float, low: float, high: float) -> Array:
    """A sum of one to four sines, relative to the bandwidth, from rest or not."""
    t = T_s * np.arange(_N)
    tones = np.clip(f * numbers.uniform(low, high, int(numbers.integers(1, 5))), 2.0 / t[-1], 0.1 / T_s)
    x_d = sum(np.sin(2 * np.pi * tone * t + numbers.uniform(0, 2 * np.pi)) / tone * tones.min() for tone in tones)
    return np.asarray(x_d * (np.clip(t / (0.1 * t[-1]), 0.0, 1.0) if numbers.random() < 0.5 else 1.0))


def _swept(numbers: Numbers, f: float, T_s: float) -> Array:
    """A swept sine through the bandwidth and far above it, which rests before and behind."""
    t = T_s * np.arange(_N - 400)
    first, last = f * numbers.uniform(0.03, 0.2), min(f * numbers.uniform(1.5, 5.0), 0.15 / T_s)
    return np.pad(chirp(t, max(first, 2.0 / t[-1]), t[-1], last, phi=-90), 200, mode="edge")


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
    return np.pad(2 / period * np.minimum(k, period - k), (200, 0))


COMMANDS: tuple[Callable[[Numbers, float, float], Array], ...] = (
    _moves,
    partial(_moves, share=0.08, moves=4),  # mostly at rest
    partial(_tones, low=0.03, high=0.6),
    partial(_tones, low=1.2, high=4.0),  # above the bandwidth
    _swept,
    _wandering,
    _triangles,
)
"""Commands from random numbers, the drive's bandwidth, Hz, and the sampling interval, s."""

DRIVES = ("lag", "mode", "load on a spring", "fed forward", "under load", "play")


def _modes(x_d: Array, T_s: float, modes: list[Mode], dead_time: int) -> Array:
    discrete = ModalModel(modes, dead_time).discretise(T_s, "zoh")
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


def _driven(drive: str, numbers: Numbers, x_d: Array, f: float, T_s: float) -> Array:
    """Return the measured positions without an encoder."""
    omega, zeta, u = 2 * np.pi * f, float(numbers.uniform(0.15, 1.2)), float(numbers.uniform())
    modes = [Mode(f, zeta, omega**2)]
    if drive in ("lag", "play"):
        modes = [Mode(f, 1.0, omega**2, omega)]
    elif drive == "fed forward":
        modes = [Mode(f, max(zeta, 0.3), omega**2, (1 + u) * max(zeta, 0.3) * omega)]
    elif drive == "load on a spring":
        share, other = 0.05 + 0.35 * u, omega * float(numbers.uniform(1.3, 2.5))
        modes = [Mode(f, max(zeta, 0.5), (1 - share) * omega**2), Mode(other / (2 * np.pi), 0.08, share * other**2)]
    if drive == "play":
        half, last = 0.5 * (0.002 + 0.048 * u) * float(np.ptp(x_d)), float(x_d[0])
        x_d = x_d.copy()
        for k, value in enumerate(x_d.tolist()):
            x_d[k] = last = min(max(last, value - half), value + half)
    x = _modes(x_d, T_s, modes, int(numbers.integers(0, 3)))
    return x_d[0] + (0.2 + 0.8 * u) * (x - x_d[0]) if drive == "under load" else x


def generated_log(seed: int) -> Log:
    """Return the good log of a seed; 42 seeds in a row have every command with every drive."""
    numbers = np.random.default_rng([21, seed])
    T_s = float(numbers.choice([0.5e-3, 1e-3, 2e-3, 5e-3]))
    f = float(numbers.uniform(0.006, 0.05)) / T_s  # 20 to 160 samples a period
    x_d = COMMANDS[seed % len(COMMANDS)](numbers, f, T_s)
    rotary = bool(numbers.random() < 0.3)
    travel = float(numbers.choice([0.2, 3.0, 40.0]) if rotary else numbers.choice([1e-3, 0.03, 0.4]))
    x_d = travel * x_d / float(np.ptp(x_d))
    if numbers.random() < 0.5:
        x_d = 1e-6 * travel * np.round(x_d / (1e-6 * travel))
    x = _driven(DRIVES[seed // len(COMMANDS) % len(DRIVES)], numbers, x_d, f, T_s)
    x = x + numbers.choice([0.0, 1e-6, 1e-4]) * travel * numbers.normal(size=len(x))
    count = float(numbers.choice([0.0, 1e-6, 1e-4, 5e-4])) * travel
    x = count * np.round(x / count) if count else x
    return replace(log_of(x_d, x, T_s), unit="rad" if rotary else "m", unit_stated=True)


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


ACCUSED_BEFORE: dict[str, Callable[[], Log]] = {
    "a smooth command, a resting axis": _resting_axis,
    **{f"a servo that reaches {share:g}": partial(_reaches_a_share, share) for share in (0.2, 0.45, 0.69)},
    **{
        f"a robot joint at {times:g} times its bandwidth, {late} late": partial(_robot_joint, times, late)
        for times, late in ((1.5, 0), (1.5, 2), (2.5, 1))
    },
}
"""Good logs by name that were refused: as swapped, for their scale, for their sign."""
