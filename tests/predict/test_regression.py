"""The recursive regression against the ridge problem solved directly, also in extended precision.

Penalties of each weight, leverage and discounting against the stacked problem.
"""

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.base.errors import ParameterError
from hybridsep.base.signals import Array
from hybridsep.predict.regression import RidgeRegression


def problem(m: int, n: int, seed: int = 0) -> tuple[Array, Array]:
    """Return m random rows of n features and their targets."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(m, n))
    return rows, rows @ rng.normal(size=n) + 0.1 * rng.normal(size=m)


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
    assert regression.factor[-1, -1] ** 2 == pytest.approx(minimum, rel=1e-9, abs=1e-12)


def test_nothing_learned_means_zero() -> None:
    regression = RidgeRegression.init(3, 1e-3)
    np.testing.assert_array_equal(regression.weights, 0.0)
    assert regression.factor[-1, -1] == 0.0
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


LAM = 1e-40  # λ of a factor whose penalties come with each solution


def rows_of(kind: str, k: int, n: int, rng: np.random.Generator) -> Array:
    """Return k rows of n features: independent ones, or lags of a smooth position, which are nearly collinear."""
    if kind == "independent":
        return np.asarray(rng.normal(size=(k, n)))
    t = np.arange(k + n)
    smooth = np.sin(0.03 * t + rng.uniform(0, 6)) + 0.2 * np.sin(0.011 * t)
    return np.lib.stride_tricks.sliding_window_view(smooth, n)[:k] + 1e-9 * rng.normal(size=(k, n))


def exact(rows: Array, target: Array, penalties: Array) -> Array:
    """Return the weights in extended precision: in units of the priors the penalties are all 1."""
    priors = 1.0 / np.sqrt(penalties)
    return np.asarray(priors * oracle.ridge_extended(rows * priors, target, 1.0), dtype=np.float64)


def stacked_cost(w: Array, rows: Array, target: Array, penalties: Array) -> float:
    return float(np.sum((target - rows @ w) ** 2) + np.sum(penalties * w**2))


@examples(60)
@given(
    kind=st.sampled_from(["independent", "lags"]),
    n=st.integers(1, 14),
    share=st.floats(0.0, 1.0),
    batches=st.lists(st.integers(1, 30), min_size=1, max_size=4),
    exponent=st.floats(-6.0, 2.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_penalised_solves_the_stacked_system(
    kind: str, n: int, share: float, batches: list[int], exponent: float, seed: int
) -> None:
    """With all features and with only the first ones; with fewer rows than features, too."""
    rng = np.random.default_rng(seed)
    m, k = 1 + round(share * (n - 1)), sum(batches)
    rows = rows_of(kind, k, n, rng)
    target = rows @ rng.normal(size=n) + 0.1 * rng.normal(size=k)
    penalties = 10.0**exponent * rng.uniform(0.1, 10.0, m)
    regression = RidgeRegression.init(n, LAM)
    first = 0
    for batch in batches:
        regression = regression.update(rows[first : first + batch], target[first : first + batch])
        first += batch
    before = regression.factor
    solution = regression.penalised(penalties)
    stacked = np.vstack((rows[:, :m], np.diag(np.sqrt(penalties))))
    direct = np.linalg.lstsq(stacked, np.concatenate((target, np.zeros(m))), rcond=None)[0]
    truth = exact(rows[:, :m], target, penalties)
    size = np.linalg.norm(truth)
    # The error of the direct solution follows from the problem's condition: ours may be ten times as large.
    error, unavoidable = np.linalg.norm(solution.weights - truth), np.linalg.norm(direct - truth)
    assert error <= 10.0 * unavoidable + 1e-10 * size
    least = stacked_cost(truth, rows[:, :m], target, penalties)
    assert stacked_cost(solution.weights, rows[:, :m], target, penalties) == pytest.approx(least, rel=1e-9, abs=1e-20)
    direct_sum = float(np.sum((target - rows[:, :m] @ solution.weights) ** 2))
    assert solution.residual_sum == pytest.approx(direct_sum, rel=1e-8, abs=1e-13 * float(np.sum(target**2)))
    np.testing.assert_array_equal(regression.factor, before)  # it is only read
    np.testing.assert_allclose(
        np.triu(solution.triangle).T @ np.triu(solution.triangle),
        stacked.T @ stacked,
        rtol=1e-11,
        atol=1e-13 * float(np.abs(stacked.T @ stacked).max()),
    )


@examples(40)
@given(n=st.integers(1, 10), k=st.integers(1, 60), seed=st.integers(0, 2**32 - 1))
def test_leverage_is_the_variance_of_a_prediction(n: int, k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, penalties = rng.normal(size=(k, n)), rng.uniform(0.5, 2.0, n)
    regression = RidgeRegression.init(n, LAM)
    regression = regression.update(rows, rng.normal(size=k))
    phi = rng.normal(size=(7, n))
    covariance = np.linalg.inv(rows.T @ rows + np.diag(penalties))
    expected = [float(one @ covariance @ one) for one in phi]
    np.testing.assert_allclose(regression.penalised(penalties).leverage(phi), expected, rtol=1e-9)


@examples(40)
@given(weights=st.lists(st.floats(0.01, 1), min_size=1, max_size=5), lam=st.sampled_from([1e-6, 1e-2, 1]), n=st.just(5))
def test_discounted_rows_are_weighted_least_squares(weights: list[float], lam: float, n: int) -> None:
    rng = np.random.default_rng(len(weights))
    regression = RidgeRegression.init(n, lam)
    rows, target, kept = np.zeros((0, n)), np.zeros(0), 1.0
    for weight in weights:
        more, goal = rng.normal(size=(9, n)), rng.normal(size=9)
        regression = regression.discount(weight).update(more, goal)
        rows, target = np.sqrt(weight) * rows, np.sqrt(weight) * target
        rows, target, kept = np.vstack((rows, more)), np.concatenate((target, goal)), kept * weight
    direct = oracle.ridge(rows, target, lam * kept)
    np.testing.assert_allclose(regression.weights, direct, rtol=1e-9, atol=1e-12)


def test_what_is_never_excited_stays_regular_however_long_it_is_discounted() -> None:
    regression = RidgeRegression.init(3, LAM)
    for _ in range(400):
        regression = regression.discount(0.01).update(np.array([[1.0, 0.0, 0.0]]), np.array([2.0]))
    assert np.abs(np.diag(regression.factor)[:3]).min() == 1e-150
    np.testing.assert_allclose(regression.penalised(np.full(3, 1e-9)).weights, [2.0, 0.0, 0.0], atol=1e-8)
    assert np.isfinite(regression.factor).all()
    regression = regression.discount(0.0)
    np.testing.assert_array_equal(regression.weights, 0.0)
