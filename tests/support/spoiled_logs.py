"""Good logs of simulated and recorded axes, and the faults that make bad ones of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
import staircase_data
from places import EMPS, RECORDINGS
from random_drives.generator import random_drive

from hybridsep import load_machine, simulate, spiral
from hybridsep.base.signals import Array
from hybridsep.intake.relation import shifted
from hybridsep.logs.log import Log, read_log

__all__ = ["FAULTS", "GOOD", "good", "log_of"]

_SEED = 7
_RANDOM = (0, 3, 9, 15, 19, 26, 28, 33)


def log_of(x_d: Array, x_meas: Array, T_s: float = 1e-3) -> Log:
    return Log(T_s * np.arange(len(x_d), dtype=np.float64), x_d, x_meas, T_s, Path("log.csv"))


@cache
def _random(index: int) -> Log:
    drive = random_drive(index)
    return log_of(drive.x_d, drive.x_meas)


def _stage(axis: str) -> Log:
    machine = load_machine(f"als25010_{axis}")
    x_d = spiral()[axis == "y"]
    noise = np.random.default_rng(_SEED).normal(0.0, 1e-6, len(x_d))
    return log_of(x_d, simulate(machine.new_plant(), x_d, machine.T_s) + noise)


def _staircase() -> Log:
    return log_of(staircase_data.commanded(), staircase_data.measured(0))


GOOD: dict[str, Callable[[], Log]] = {
    "staircase": _staircase,
    **{f"stage {axis}": lambda axis=axis: _stage(axis) for axis in "xy"},  # type: ignore[misc]
    **{f"random drive {index}": lambda index=index: _random(index) for index in _RANDOM},  # type: ignore[misc]
    "EMPS": lambda: read_log(EMPS, columns={"x_d": "qg", "x": "qm"}, uniform=False),
    **{
        name: lambda name=name: read_log(RECORDINGS / name, uniform=False)  # type: ignore[misc]
        for name in (
            *(f"cnc_a_axis{axis}.csv" for axis in (1, 2, 6)),
            "cnc_a_capture.json",
            *(f"xl330_kp{gain}.csv" for gain in (100, 200, 400, 800)),
        )
    },
}
"""Twenty good logs by name."""


@lru_cache(maxsize=4)
def good(name: str) -> Log:
    return GOOD[name]()


def _random_numbers() -> np.random.Generator:
    return np.random.default_rng(_SEED)


def _fast(log: Log) -> int:
    """Return a sample in the middle of the fast motion."""
    steps = np.abs(np.diff(log.x_d))
    fast = np.flatnonzero(steps > 0.5 * steps.max())
    return int(fast[len(fast) // 2])


def _measured(change: Callable[[Array, Log], Array]) -> Callable[[Log], Log]:
    return lambda log: replace(log, x_meas=change(log.x_meas, log))


def _without(log: Log, *stretches: tuple[int, int]) -> Log:
    keep = np.ones(len(log.t), dtype=np.bool_)
    for begin, end in stretches:
        keep[begin:end] = False
    return replace(log, t=log.t[keep], x_d=log.x_d[keep], x_meas=log.x_meas[keep])


def _jittered(log: Log) -> Log:
    shifts = np.clip(_random_numbers().normal(0.0, 0.1, len(log.t)), -0.3, 0.3)
    return replace(log, t=log.t + shifts * log.T_s)


def _repeated_time(log: Log) -> Log:
    t, k = log.t.copy(), _fast(log)
    t[k] = t[k - 1]
    return replace(log, t=t)


def _held(x: Array, log: Log) -> Array:
    x, k = x.copy(), _fast(log)
    x[k : k + 50] = x[k]
    return x


def _spikes(n: int, travels: float) -> Callable[[Array, Log], Array]:
    def change(x: Array, log: Log) -> Array:
        numbers, x = _random_numbers(), x.copy()
        x[numbers.choice(np.arange(20, len(x) - 20), n, replace=False)] += travels * float(np.ptp(log.x_d))
        return x

    return change


def _clipped(x: Array, log: Log) -> Array:
    """Clip at limits that 31 % of the moving samples pass, as far as the motion has a middle."""
    moving = np.abs(np.gradient(log.x_d)) > 1e-3 * np.abs(np.diff(log.x_d)).max()
    return np.asarray(np.clip(x, *np.quantile(x[moving], [0.155, 0.845])))


def _pasted(log: Log) -> Log:
    """Paste three logs together whose axis stands 0.6 travels further on each time."""
    n = len(log.t)
    places = 0.6 * float(np.ptp(log.x_d)) * (np.arange(n) // (n // 3 + 1))
    return replace(log, x_d=log.x_d + places, x_meas=log.x_meas + places)


def _numbered_anew(log: Log) -> Log:
    """Lose 2 % of the rows, and number the times of the rest."""
    keep = _random_numbers().random(len(log.t)) > 0.02
    keep[[0, *(_fast(log) + np.array([0, 1, 2, 4, 5, 6]))]] = True
    keep[_fast(log) + 3] = False  # one in motion, at least
    return replace(log, t=log.t[: keep.sum()], x_d=log.x_d[keep], x_meas=log.x_meas[keep])


FAULTS: dict[str, tuple[str, Callable[[Log], Log]]] = {
    "flipped": ("sign", _measured(lambda x, _: -x)),
    "mm for m": ("scale", _measured(lambda x, _: 1e3 * x)),
    "deg for rad": ("scale", _measured(lambda x, _: np.degrees(x))),
    "gain of 4e-5": ("scale", _measured(lambda x, _: 4e-5 * x)),
    "gear ratio": ("scale", _measured(lambda x, _: 1.25 * x)),
    "offset of 0.25 m": ("offset", _measured(lambda x, _: x + 0.25)),
    "offset of a third": ("offset", _measured(lambda x, log: x - 0.33 * float(np.ptp(log.x_d)))),
    "10 samples late": ("delay", _measured(lambda x, _: shifted(x, 10.0))),
    "12.5 samples late": ("delay", _measured(lambda x, _: shifted(x, 12.5))),
    "8 samples early": ("delay", _measured(lambda x, _: shifted(x, -8.0))),
    "swapped": ("columns swapped", lambda log: replace(log, x_d=log.x_meas, x_meas=log.x_d)),
    "velocity measured": ("velocity for position", _measured(lambda x, log: np.gradient(x) / log.T_s)),
    "velocity commanded": ("velocity for position", lambda log: replace(log, x_d=np.gradient(log.x_d) / log.T_s)),
    "cut in motion": ("start in motion", lambda log: _without(log, (0, _fast(log)))),
    "rows lost": ("gaps", lambda log: _without(log, (_fast(log), _fast(log) + 7), (200, 240))),
    "uneven clock": ("jitter", _jittered),
    "held for 50 samples": ("stuck samples", _measured(_held)),
    "slow sensor": ("repeated samples", _measured(lambda x, _: x[np.arange(len(x)) // 4 * 4])),
    "five spikes": ("outliers", _measured(_spikes(5, 0.05))),
    "thirty large spikes": ("outliers", _measured(_spikes(30, 10.0))),
    "clipped": ("clipped", _measured(_clipped)),
    "logs pasted together": ("jumps", _pasted),
    "rows lost, times anew": ("lost rows", _numbered_anew),
    "no motion": ("too little motion", lambda log: replace(log, x_d=np.full_like(log.x_d, log.x_d[0]))),
    "time repeats": ("time order", _repeated_time),
    "mm read as m": ("unit", lambda log: replace(log, x_d=1e3 * log.x_d, x_meas=1e3 * log.x_meas)),
}
"""Faults by name: the finding that names each, and how it is made."""
