"""The C core's sample clock against the library's, and the rule over many samples of rounded times."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from c_core import library

from hybridsep.base.clock import SampleClock

T_S = 1 / 3000  # s


class CClock(ctypes.Structure):
    _fields_ = (
        ("T_s", ctypes.c_double),
        ("k", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("since", "carry", "end")),
    )


class CStep(ctypes.Structure):
    _fields_ = (
        ("after", CClock),
        ("n_samples", ctypes.c_int64),
        ("n_latched", ctypes.c_int64),
        ("first", ctypes.c_double),
        ("inside", ctypes.c_int),
        ("moved", ctypes.c_double),
        ("noticed", ctypes.c_int),
    )


def counted(clock: CClock, t: float, h: float) -> CStep:
    step = CStep()
    assert library("predictor").hsep_clock_count(
        ctypes.byref(clock), ctypes.c_double(t), ctypes.c_double(h), ctypes.byref(step)
    )
    return step


@pytest.mark.parametrize("start", [0.0, 1e9])
def test_the_core_counts_as_the_library_does(start: float) -> None:
    rng = np.random.default_rng(3)
    ours, clock = CClock(), SampleClock.begin(start, T_S)
    assert library("predictor").hsep_clock_init(ctypes.byref(ours), ctypes.c_double(start), ctypes.c_double(T_S))
    t = start
    for h in T_S * rng.choice([0.03, 0.04, 0.97, 1.0, 1.0001, 1.049, 1.051, 2.96, 12.2, 300.0], 5000) + 1e-10:
        step, expected = counted(ours, t, float(h)), clock.stepped(t, float(h))
        ours, clock, t = step.after, expected.after, t + float(h)
        got = [ours.T_s, ours.k, ours.since, ours.carry, ours.end]
        assert got == clock.state()
        assert (step.n_samples, step.n_latched, step.first, step.moved) == (
            expected.n_samples,
            expected.n_latched,
            expected.first,
            expected.moved,
        )
        assert bool(step.noticed) == bool(expected.warning)


@pytest.mark.parametrize("step", [333_333e-9, float(np.float32(T_S)), 0.1 + T_S - 0.1])
def test_rounded_steps_neither_lose_nor_double_a_sample(step: float) -> None:
    """Whole nanoseconds, single precision and differences of times over 10⁶ samples, in steps of ten."""
    clock = SampleClock.begin(0.0, T_S)
    for _ in range(100_000):
        after = clock.stepped(clock.end, 10 * step)
        assert (after.n_samples, after.n_latched, after.first) == (10, 10, 0.0)
        clock = after.after
    assert (clock.k, clock.latched) == (1_000_000, False)


@pytest.mark.parametrize("T_s", [1e-3, 5e-4, 1.25e-4])
def test_times_in_single_precision_up_to_100_s(T_s: float) -> None:
    for begin in (0.0, 10.0, 99.0):
        times = (begin + np.arange(3000) * T_s).astype(np.float32).astype(float)
        clock = SampleClock.begin(times[0], T_s)
        for t, h in zip(times[:-1].tolist(), np.diff(times).tolist(), strict=True):
            after = clock.stepped(t, h)
            assert (after.n_samples, after.n_latched, after.first) == (1, 1, 0.0)
            clock = after.after
