"""The guard of the C core against that of the library, sample by sample."""

from __future__ import annotations

import ctypes

import c_core
import numpy as np
import pytest
from numpy.typing import NDArray

from hybridsep.predict.guard import SensorGuard

Array = NDArray[np.float64]

NEIGHBOURS = 2


class Guard(ctypes.Structure):
    """hsep_guard."""

    _fields_ = (
        *((name, ctypes.c_uint64) for name in ("patience", "gap", "jumps", "holding")),
        *(
            (name, ctypes.c_double)
            for name in (
                "stuck",
                "vibration",
                "first",
                "last",
                "value",
                "repeats",
                "low",
                "high",
                "step",
                "spread",
                "pace",
                "x_pb",
            )
        ),
        ("before", ctypes.c_double * NEIGHBOURS),
    )

    @classmethod
    def begin(cls, patience: int) -> Guard:
        guard = cls()
        c_core.library("predictor").hsep_guard_init(ctypes.byref(guard), ctypes.c_uint64(patience))
        return guard

    def accepts(self, x: Array, x_pb: Array, largest: float) -> NDArray[np.bool_]:
        work, accepted = np.empty(len(x)), np.empty(len(x))
        newest_first = [np.ascontiguousarray(array[::-1]) for array in (x, x_pb)]
        c_core.library("predictor").hsep_guard_accept(
            ctypes.byref(self),
            *(array.ctypes.data_as(ctypes.c_void_p) for array in newest_first),
            ctypes.c_uint64(len(x)),
            ctypes.c_double(largest),
            work.ctypes.data_as(ctypes.c_void_p),
            accepted.ctypes.data_as(ctypes.c_void_p),
        )
        return accepted[::-1] > 0.0


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
    guard, core = SensorGuard(2 * n), Guard.begin(2 * n)
    rejected = 0
    for i in range(0, 40 * n, n):
        expected = guard.accepts(x[i : i + n], x_pb[i : i + n], 1e-4)
        assert core.accepts(x[i : i + n], x_pb[i : i + n], 1e-4).tolist() == expected.tolist()
        rejected += n - int(expected.sum())
    assert 0 < rejected < 20 * n
    assert (core.gap, core.jumps, core.repeats) == (guard.gap, guard.jumps, guard.held.repeats)
    assert (core.holding, core.stuck, core.first) == (guard.holding, guard.stuck, guard.first)
    assert (core.step, core.pace) == (guard.held.step, guard.pace)
    assert core.spread == pytest.approx(guard.spread, rel=1e-12)
    assert core.vibration == pytest.approx(guard.vibration, rel=1e-12)
