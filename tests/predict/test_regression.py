"""The recursive regression against the ridge problem solved directly, also in extended precision."""

from typing import Any

import numpy as np
import oracle
import pytest
import staircase_data as staircase
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.base.errors import ParameterError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.regression import RidgeRegression


def problem(m: int, n: int, seed: int = 0) -> tuple[Array, Array]:
    """Return m random rows of n features and their targets."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(m, n))
    return rows, rows @ rng.normal(size=n) + 0.1 * rng.normal(size=m)


def relative_error(w: Array, exact: Any) -> float:
    return float(np.linalg.norm((w - exact).astype(float)) / np.linalg.norm(exact.astype(float)))


@examples(80)
@given(
    n=st.integers(1, 12),
    batches=st.lists(st.integers(1, 30), min_size=1, max_size=8),
    lam=st.sampled_from([1e-6, 1e-2, 1.0, 100.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_batches_of_any_size_give_the_direct_solution(n: int, batches: list[int], lam: float, seed: int) -> None:
    rows, target = problem(sum(batches), n, seed)
    regression = RidgeRegression.init(n, lam)
    first = 0
    for m in batches:
        regression = regression.update(rows[first : first + m], target[first : first + m])
        first += m
        exact = oracle.ridge_extended(rows[:first], target[:first], lam)
        np.testing.assert_allclose(regression.weights, exact.astype(float), rtol=1e-9, atol=1e-11)
    assert regression.n_rows == first
    # Eq. (6): what is minimised, at its minimum
    w = exact.astype(float)
    minimum = np.sum((target - rows @ w) ** 2) + lam * np.sum(w**2)
    assert regression.residual_sum == pytest.approx(minimum, rel=1e-9, abs=1e-12)


def test_the_factor_is_triangular_and_squares_to_the_normal_equations() -> None:
    rows, target = problem(25, 4)
    regression = RidgeRegression.init(4, 0.5)
    regression = regression.update(rows, target)
    factor = regression.factor
    np.testing.assert_array_equal(factor, np.triu(factor))
    stacked = np.column_stack((rows, target))
    expected = stacked.T @ stacked + 0.5 * np.diag([1.0, 1, 1, 1, 0])
    np.testing.assert_allclose(factor.T @ factor, expected, rtol=1e-12, atol=1e-12)


def test_nothing_learned_means_zero() -> None:
    regression = RidgeRegression.init(3, 1e-3)
    np.testing.assert_array_equal(regression.weights, 0.0)
    assert regression.residual_sum == 0.0
    regression = regression.update(np.empty((0, 3)), np.empty(0))
    np.testing.assert_array_equal(regression.weights, 0.0)
    assert regression.n_rows == 0


def test_a_regression_of_nothing_is_refused() -> None:
    with pytest.raises(ParameterError, match="n_features must be ≥ 1, got 0"):
        RidgeRegression.init(0, 1.0)


def test_weights_cannot_be_written() -> None:
    regression = RidgeRegression.init(3, 1e-3)
    for _ in range(2):
        with pytest.raises(ValueError, match="read-only"):
            regression.weights[0] = 1.0
        regression = regression.update(*problem(5, 3))


@pytest.mark.slow
def test_weights_after_the_staircase_against_extended_precision() -> None:
    p, q, n, lam = 50, 3, 6000, 1e-12
    x_d, x = staircase.commanded()[:n], staircase.measured(0)[:n]
    predictor = HybridPredictor(
        ModalModel.spring_mass_damper(staircase.M, staircase.C, staircase.K),
        PredictorSettings(averaging=False, p=p, q=q, lam=lam),
    )
    x_pb: list[float] = []
    for first in range(0, n, predictor.Np):
        x_pb += predictor.predict(x_d[first : first + predictor.Np]).x_pb.tolist()
        predictor.update(x[first : first + predictor.Np])
    e_pb = x - np.array(x_pb)
    rows = np.array([oracle.features(x_pb, e_pb.tolist(), k, p, q) for k in range(n)])
    exact = oracle.ridge_extended(rows, e_pb, lam)
    assert predictor.regression.n_features == rows.shape[1] == 2 + q + p
    assert relative_error(predictor.weights, exact) < 1e-9
