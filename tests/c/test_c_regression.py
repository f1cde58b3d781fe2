"""The C core's regression against the direct solution in extended precision. Each test states its tolerance."""

import ctypes
import math
from typing import Any

import c_core
import numpy as np
import oracle
import pytest
import staircase_data as staircase
from c_core import TS

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel


class CRegression:
    """hsep_regression."""

    def __init__(self, n: int, lam: float) -> None:
        self.library, self.n = c_core.library("predictor"), n
        self.block = np.zeros(int(self.library.hsep_regression_size(ctypes.c_uint64(n))) // 8)
        self.library.hsep_regression_init(self._block, ctypes.c_uint64(n), ctypes.c_double(lam))

    @property
    def _block(self) -> Any:
        return self.block.ctypes.data_as(ctypes.c_void_p)

    def fold(self, rows: Array, target: Array, repetitions: int = 1) -> None:
        stacked = np.ascontiguousarray(np.column_stack((rows, target)))
        pointer = stacked.ctypes.data_as(ctypes.c_void_p)
        self.library.test_fold(self._block, pointer, ctypes.c_size_t(len(rows)), ctypes.c_size_t(repetitions))

    @property
    def weights(self) -> Array:
        w = np.empty(self.n)
        self.library.hsep_regression_solve(self._block, w.ctypes.data_as(ctypes.c_void_p))
        return w

    @property
    def n_rows(self) -> float:
        return float(self.block[1])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 9, 16, 23])
@pytest.mark.parametrize("lam", [1e-12, 1e-3, 10.0])
def test_weights_of_random_rows_are_those_of_the_direct_solution(n: int, lam: float) -> None:
    # 1e-11 relative against long double; from one row, less than features, to many.
    rng = np.random.default_rng(n)
    rows = rng.normal(size=(200, n))
    target = rows @ rng.normal(size=n) + 0.1 * rng.normal(size=200)
    regression, done = CRegression(n, lam), 0
    for m in (0, 1, 2, 30, 200):
        regression.fold(rows[done:m], target[done:m])
        done = m
        exact = oracle.ridge_extended(rows[:m], target[:m], lam).astype(float)
        scale = 1e-11 * max(float(np.linalg.norm(exact)), 1e-300)
        np.testing.assert_allclose(regression.weights, exact, rtol=0, atol=max(scale, 1e-14 / math.sqrt(lam) * (m < n)))


def test_rows_that_outweigh_all_before_them_lose_nothing() -> None:
    # Each row a million times the one before and nearly parallel to it: rotations with a cosine near 0, where the
    # cheap form of the update would be wrong. 1e-9 relative.
    rng = np.random.default_rng(1)
    n, m = 6, 60
    base = rng.normal(size=n)
    rows = (base + 1e-3 * rng.normal(size=(m, n))) * (10.0 ** np.tile([-6.0, 0.0, 6.0], m // 3))[:, None]
    target = rows @ rng.normal(size=n) * (1 + 1e-2 * rng.normal(size=m))
    regression = CRegression(n, 1e-6)
    regression.fold(rows, target)
    exact = oracle.ridge_extended(rows, target, 1e-6).astype(float)
    assert np.linalg.norm(regression.weights - exact) <= 1e-9 * np.linalg.norm(exact)


def staircase_rows(p: int, q: int, n: int) -> tuple[Array, Array]:
    """Return rows of features, (n, 2 + q + p), and their targets, (n,), of the measured staircase; eq. (5)."""
    discrete = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0).discretise(TS)
    x_pb, _ = discrete.forced_response(discrete.rest(), staircase.commanded())
    e_pb = staircase.measured(0) - x_pb
    first = 200  # the lags before it are there
    columns = [np.ones(n)] + [x_pb[first - i : first - i + n] for i in range(q + 1)]
    columns += [e_pb[first - i : first - i + n] for i in range(1, p + 1)]
    return np.column_stack(columns), e_pb[first : first + n]


@pytest.mark.slow
def test_the_weights_keep_their_digits_over_a_million_samples() -> None:
    # n = 55: 1e-9 relative against extended precision. m times the same rows are the rows times sqrt(m).
    rows, target = staircase_rows(50, 3, 5000)
    regression = CRegression(55, 1e-12)
    regression.fold(rows, target, repetitions=200)
    scale = np.sqrt(np.longdouble(200))
    exact = oracle.ridge_extended((rows * scale).astype(np.longdouble), (target * scale).astype(np.longdouble), 1e-12)
    error = np.linalg.norm((regression.weights - exact).astype(float)) / np.linalg.norm(exact.astype(float))
    assert error <= 1e-9
