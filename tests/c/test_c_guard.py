"""The guard of the C core against that of the library, sample by sample."""

from __future__ import annotations

import ctypes

import c_core
import numpy as np
import pytest
from numpy.typing import NDArray

from hybridsep.predict.trust.constants import CONSTANTS
from hybridsep.predict.trust.guard import SensorGuard

Array = NDArray[np.float64]

NEIGHBOURS = 2
T_S = 0.02
"""s; the patience with an axis that stands is 30 samples then, or two windows."""


class Doubt(ctypes.Structure):
    """hsep_doubt."""

    _fields_ = (("kind", ctypes.c_int), ("value", ctypes.c_double))


class Guard(ctypes.Structure):
    """hsep_guard."""

    _fields_ = (
        *((name, ctypes.c_uint64) for name in ("patience", "patience_standing", "gap", "doubtful", "holding")),
        *(
            (name, ctypes.c_double)
            for name in (
                "vibration",
                "stood",
                "measured",
                "before_run",
                "last",
                "value",
                "repeats",
                "low",
                "high",
                "step",
                "spread",
                "pace",
                "last_x_pb",
            )
        ),
        ("before", ctypes.c_double * NEIGHBOURS),
    )

    @classmethod
    def begin(cls, Np: int) -> Guard:
        guard = cls()
        c_core.library("predictor").hsep_guard_init(ctypes.byref(guard), ctypes.c_uint64(Np), ctypes.c_double(T_S))
        return guard

    def accepts(self, x: Array, x_pb: Array, largest: float) -> NDArray[np.bool_]:
        work, accepted, self.suspect = np.empty(len(x)), np.empty(len(x)), np.empty(len(x))
        newest_first = [np.ascontiguousarray(array[::-1]) for array in (x, x_pb)]
        c_core.library("predictor").hsep_guard_accept(
            ctypes.byref(self),
            *(array.ctypes.data_as(ctypes.c_void_p) for array in newest_first),
            ctypes.c_uint64(len(x)),
            ctypes.c_double(largest),
            work.ctypes.data_as(ctypes.c_void_p),
            accepted.ctypes.data_as(ctypes.c_void_p),
            self.suspect.ctypes.data_as(ctypes.c_void_p),
        )
        return accepted[::-1] > 0.0

    def doubted(self, x_pb: Array, largest: float) -> list[float] | None:
        doubt = c_core.library("predictor").hsep_guard_doubt
        doubt.restype = Doubt
        found = doubt(ctypes.byref(self), ctypes.c_double(largest))
        values: dict[int, list[float] | None] = {
            0: None,
            1: (found.value - x_pb).tolist(),
            2: [found.value] * len(x_pb),
        }
        return values[found.kind]


@pytest.mark.parametrize("seed", range(20))
def test_core_and_library_accept_the_same_samples(seed: int) -> None:
    chance = np.random.default_rng(seed)
    n = int(chance.choice([1, 2, 3, 7, 50]))
    x_pb = 0.01 * np.sin(np.arange(40 * n) * 0.4 / n) * (np.arange(40 * n) > 5 * n)
    x = x_pb + 1e-4 * np.sin(np.arange(40 * n) * 1.1 / n) + chance.normal(0.0, 2e-6, 40 * n)
    if seed % 3 == 0:
        x = 1e-5 * np.rint(x / 1e-5)
    x[chance.random(40 * n) < 0.02] = np.nan
    x[chance.random(40 * n) < 0.02] += 1e-3
    x[11 * n : 14 * n] = x[11 * n - 1]
    x[20 * n :] += 3e-4
    if seed % 2:  # the axis itself stands still at times
        for k in range(25 * n, 40 * n):
            x[k] = x[k - 1] if abs(x_pb[k] - x[k - 1]) < 2e-3 else x_pb[k] - 2e-3 * np.sign(x_pb[k] - x[k - 1])
    if seed % 5 == 0:  # it rings
        x[28 * n : 36 * n] += 2e-4 * np.sin(np.arange(8 * n) * 17.0 / n)
    guard, core = SensorGuard(n, T_S, CONSTANTS), Guard.begin(n)
    rejected = 0
    for i in range(0, 40 * n, n):
        expected = guard.accepts(x[i : i + n], x_pb[i : i + n], 1e-4)
        assert core.accepts(x[i : i + n], x_pb[i : i + n], 1e-4).tolist() == expected.tolist()
        assert (core.suspect[::-1] > 0.0).tolist() == guard.suspect.tolist()
        rejected += n - int(expected.sum())
        doubted = guard.doubted(x_pb[i : i + n], 1e-6)
        assert core.doubted(x_pb[i : i + n], 1e-6) == (None if doubted is None else doubted.tolist())
    assert 0 < rejected < 20 * n
    assert (core.patience, core.patience_standing) == (guard.patience, guard.patience_standing)
    assert (core.gap, core.doubtful, core.repeats) == (guard.gap, guard.doubtful, guard.held.repeats)
    assert (core.holding, core.stood) == (guard.holding, guard.stood)
    assert (core.measured, core.before_run) == (guard.measured, guard.before_run)
    assert (core.step, core.pace) == (guard.held.step, guard.pace)
    assert core.spread == pytest.approx(guard.spread, rel=1e-12)
    assert core.vibration == pytest.approx(guard.vibration, rel=1e-12)


@pytest.mark.parametrize("fault", ["held", "another level", "missing"])
def test_core_and_library_doubt_alike(fault: str) -> None:
    n = 20
    x_pb = 1e-3 * np.sin(0.05 * np.arange(12 * n))
    x = x_pb + np.random.default_rng(1).normal(0.0, 1e-7, 12 * n)
    x[95:] = {"held": np.full(145, x[94]), "another level": x[95:] + 1e-2, "missing": np.full(145, np.nan)}[fault]
    guard, core, told = SensorGuard(n, T_S, CONSTANTS), Guard.begin(n), []
    for i in range(0, 12 * n, n):
        assert core.accepts(x[i : i + n], x_pb[i : i + n], 1e-6).tolist() == (
            guard.accepts(x[i : i + n], x_pb[i : i + n], 1e-6).tolist()
        )
        doubted = guard.doubted(x_pb[i : i + n], 1e-6)
        assert core.doubted(x_pb[i : i + n], 1e-6) == (None if doubted is None else doubted.tolist())
        told.append(None if doubted is None else float(doubted[-1]))
    in_doubt = {"held": [4, 5, 6, 7, 8, 9, 10, 11], "another level": [4, 5], "missing": []}[fault]
    assert [i for i, one in enumerate(told) if one is not None] == in_doubt
    for i in in_doubt:
        expected = x[-1] - x_pb[20 * i + 19] if fault == "held" else 1e-2
        assert told[i] == pytest.approx(expected, abs=1e-6)
