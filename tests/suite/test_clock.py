"""The rule of the sample clock over many samples of rounded times, beside what ``test_timing.py`` asserts of all."""

import numpy as np
import pytest

from hybridsep.base.clock import SampleClock

T_S = 1 / 3000  # s


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
