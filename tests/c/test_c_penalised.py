"""The C core's solutions with penalties against the library's and the direct one. Each test states its tolerance."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from c_regression import CRegression
from numpy.typing import NDArray

from hybridsep.predict.regression import RidgeRegression

Array = NDArray[np.float64]
NO_PENALTY = 1e-40


class CSolution:
    """Weights of the first features of a regression with penalties, as hsep_expert.c solves for them."""

    def __init__(self, regression: CRegression, penalties: Array) -> None:
        library, m = regression.library, len(penalties)
        library.hsep_penalised_solve.restype = library.hsep_penalised_leverage.restype = ctypes.c_double
        self.solved, self.weights = CRegression(m, 1.0), np.empty(m)
        library.hsep_block_fold_size.restype = ctypes.c_double
        work = np.empty(int(library.hsep_block_fold_size(*2 * [ctypes.c_uint64(regression.n)])))
        self.residual_sum = library.hsep_penalised_solve(
            regression._block,
            penalties.ctypes.data_as(ctypes.c_void_p),
            self.solved._block,
            self.weights.ctypes.data_as(ctypes.c_void_p),
            work.ctypes.data_as(ctypes.c_void_p),
        )

    def leverage(self, rows: Array, *, wide: bool = False) -> Array:
        library, place = self.solved.library, self.solved.library.hsep_regression_row(self.solved._block)
        found = []
        for row in rows.tolist():
            for j, value in enumerate(row):
                place[j] = value
            found.append(library.hsep_penalised_leverage(self.solved._block, int(wide)))
        return np.array(found)


def both(n: int, n_rows: int, seed: int) -> tuple[CRegression, RidgeRegression, Array, Array]:
    rng = np.random.default_rng(seed)
    rows = np.cumsum(rng.normal(size=(n_rows, n)), axis=0)  # neighbours alike, columns of many sizes
    rows *= 10.0 ** rng.uniform(-4, 2, n)
    target = rows @ (rng.normal(size=n) / np.abs(rows).max(axis=0)) + 0.1 * rng.normal(size=n_rows)
    regression, library = CRegression(n, NO_PENALTY), RidgeRegression(n, NO_PENALTY)
    regression.fold(rows, target)
    library.update(rows, target)
    return regression, library, rows, target


def assert_same(regression: CRegression, library: RidgeRegression, penalties: Array, rows: Array) -> None:
    """1e-11 relative: weights by their part in the prediction, residual sum and leverage."""
    ours, expected = CSolution(regression, penalties), library.penalised(penalties)
    m = len(penalties)
    parts = np.abs(rows[:, :m]).max(axis=0)
    scale = max(float(np.max(np.abs(expected.weights) * parts)), 1e-300)
    np.testing.assert_allclose(ours.weights * parts / scale, expected.weights * parts / scale, rtol=0, atol=1e-11)
    assert ours.residual_sum == pytest.approx(expected.residual_sum, rel=1e-11)
    some = rows[:10, :m]
    np.testing.assert_allclose(ours.leverage(some), expected.leverage(some), rtol=1e-11)
    np.testing.assert_array_equal(ours.leverage(some, wide=bool(regression.library.test_wide())), ours.leverage(some))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 9, 23])
@pytest.mark.parametrize("n_rows", [1, 3, 200])
def test_a_solution_with_penalties_is_the_librarys(n: int, n_rows: int) -> None:
    regression, library, rows, _ = both(n, n_rows, n)
    before = regression.block.copy()
    for m in sorted({1, n // 2 or 1, n}):
        penalties = 10.0 ** np.random.default_rng(m).uniform(-3, 3, m) * np.abs(rows[:, :m]).max(axis=0) ** 2
        assert_same(regression, library, penalties, rows)
    np.testing.assert_array_equal(regression.block, before)


def test_a_solution_with_penalties_is_the_direct_one() -> None:
    # 1e-9 relative against the normal equations, which are well conditioned here.
    regression = CRegression(6, NO_PENALTY)
    rng = np.random.default_rng(3)
    rows, target, penalties = rng.normal(size=(50, 6)), rng.normal(size=50), 10.0 ** rng.uniform(-2, 2, 4)
    regression.fold(rows, target)
    found, first = CSolution(regression, penalties), rows[:, :4]
    gram = first.T @ first + np.diag(penalties)
    expected = np.linalg.solve(gram, first.T @ target)
    np.testing.assert_allclose(found.weights, expected, rtol=1e-9)
    assert found.residual_sum == pytest.approx(float(np.sum((target - first @ expected) ** 2)), rel=1e-9)
    np.testing.assert_allclose(
        found.leverage(first), np.einsum("ij,jk,ik->i", first, np.linalg.inv(gram), first), rtol=1e-9
    )


def test_before_any_row_the_weights_are_0() -> None:
    solution = CSolution(CRegression(5, NO_PENALTY), np.full(5, 2.0))
    assert not solution.weights.any()
    assert solution.residual_sum == 0.0
    np.testing.assert_allclose(solution.leverage(np.eye(5)), 0.5, rtol=1e-15)


def test_discounted_rows_weigh_as_in_the_library() -> None:
    regression, library, rows, target = both(9, 40, 5)
    for weight in (0.5, 1e-3, 1.0):
        regression.library.hsep_regression_discount(regression._block, ctypes.c_double(weight))
        library.discount(weight)
        regression.fold(rows[:7], target[:7])
        library.update(rows[:7], target[:7])
        assert_same(regression, library, 1e-2 * np.abs(rows).max(axis=0) ** 2, rows)


def test_rows_may_be_forgotten_altogether() -> None:
    regression, _, rows, target = both(9, 40, 5)
    for weight in (1e-200, 1e-300, 0.0):
        regression.library.hsep_regression_discount(regression._block, ctypes.c_double(weight))
    regression.fold(rows, target)
    fresh = RidgeRegression(9, NO_PENALTY)
    fresh.update(rows, target)
    assert_same(regression, fresh, np.abs(rows).max(axis=0) ** 2, rows)
