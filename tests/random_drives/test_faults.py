"""Faults of a position sensor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.random_drives.faults import FAULTS, JITTER, OFFSET_STEP

Array = NDArray[np.float64]

N = 6000
T_S = 1e-3
SEEDS = range(20)


@pytest.fixture(scope="module")
def x_meas() -> Array:
    t = np.arange(N) * T_S
    noise = np.random.default_rng(0).standard_normal(N)
    return np.asarray(0.1 + 0.01 * np.sin(2 * np.pi * t) + 1e-6 * noise)


def changed(x_meas: Array, fault: str, seed: int) -> tuple[Array, NDArray[np.intp], int]:
    """Return the faulty measurement, indices of changed samples, and the index of the last faulty one."""
    before = x_meas.copy()
    faulty, last = FAULTS[fault](x_meas, T_S, np.random.default_rng(seed))
    assert np.array_equal(x_meas, before)
    assert faulty.shape == x_meas.shape
    return faulty, np.flatnonzero(~(faulty == x_meas)), last


@pytest.mark.parametrize("fault", FAULTS)
def test_fixed_by_the_seed(x_meas: Array, fault: str) -> None:
    first, second = changed(x_meas, fault, 3), changed(x_meas, fault, 3)
    assert np.array_equal(first[0], second[0], equal_nan=True)
    assert first[2] == second[2]


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if fault not in (OFFSET_STEP, JITTER)])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_last_faulty_sample(x_meas: Array, fault: str, seed: int) -> None:
    _, at, last = changed(x_meas, fault, seed)
    assert at[-1] == last
    assert last < 0.6 * N  # there is a time after it


@pytest.mark.parametrize("seed", SEEDS)
def test_outliers(x_meas: Array, seed: int) -> None:
    faulty, at, _ = changed(x_meas, "outliers of 10 µm to 1 m", seed)
    assert 1 <= len(at) <= 5
    sizes = np.abs(faulty - x_meas)[at]
    assert sizes.min() >= 0.999e-5
    assert sizes.max() <= 1.0001


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("fault", "n", "reading"),
    [("reads 0 for 50 ms", 50, 0.0), ("reads 0 for 0.5 s", 500, 0.0), ("missing for 0.1 s", 100, np.nan)],
)
def test_another_reading(x_meas: Array, fault: str, n: int, reading: float, seed: int) -> None:
    faulty, at, _ = changed(x_meas, fault, seed)
    assert at[-1] - at[0] == len(at) - 1 == n - 1
    np.testing.assert_array_equal(faulty[at], reading)


@pytest.mark.parametrize("seed", SEEDS)
def test_stuck(x_meas: Array, seed: int) -> None:
    faulty, at, last = changed(x_meas, "stuck for 0.5 s", seed)
    assert len(at) == 500
    assert np.ptp(faulty[last - 500 : last + 1]) == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_offset_step(x_meas: Array, seed: int) -> None:
    faulty, at, last = changed(x_meas, OFFSET_STEP, seed)
    assert np.array_equal(at, np.arange(last, N))
    offset = (faulty - x_meas)[last:]
    assert np.ptp(offset) < 1e-15
    assert 0.999e-5 <= abs(offset[0]) <= 1.001e-2


def test_missing(x_meas: Array) -> None:
    faulty, at, last = changed(x_meas, "1 % missing", 0)
    assert np.isnan(faulty[at]).all()
    assert len(at) == 0.01 * N / 2  # of the first half
    assert last < N / 2


def test_jitter(x_meas: Array) -> None:
    t = np.asarray(np.arange(N) * T_S, dtype=np.float64)
    faulty, _, last = changed(t, JITTER, 0)  # a position that is the time
    assert last == N - 1
    assert np.std((faulty - t)[1:-1]) == pytest.approx(0.05 * T_S, rel=0.05)
