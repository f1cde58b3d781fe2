"""One expert's prediction against its formulas written out: free run, variance, shrinkage, bounds."""

import numpy as np
import pytest

from hybridsep.base.signals import Array
from hybridsep.predict.averaging.constants import CONSTANTS
from hybridsep.predict.averaging.experts import ExpertErrors, ExpertPrediction, SolvedExpert, solve
from hybridsep.predict.regression import RidgeRegression

N_STATIC, N = 3, 40
SHARES = np.array([1.0, 0.5, 0.2])
LAG_PRIORS = np.sqrt([1.0, CONSTANTS.last_lag**0.5])


def learned(static: Array, lags: Array, target: Array) -> RidgeRegression:
    return RidgeRegression.init(N_STATIC + 2, 1e-40).update(np.hstack((static, lags)), target)


def solved(
    p: int,
    evidence: RidgeRegression,
    noise: float,
    correlation: float = 1.0,
    *,
    scales: Array = SHARES,
    first: float = 1.0,
    least: float = 1e-9,
) -> SolvedExpert:
    variance = ExpertErrors(noise, correlation).variance(evidence.target_square, first, least)
    return solve(evidence, variance, scales, p)


def written_out(
    static: Array, lags: Array, target: Array, rows: Array, past: Array, variance: float, p: int, largest_square: float
) -> tuple[Array, Array]:
    """Return the free run and the shrunk prediction, sample by sample."""
    priors = np.concatenate((SHARES, LAG_PRIORS[:p]))
    phi = np.hstack((static, lags[:, :p]))
    covariance = variance * np.linalg.inv(phi.T @ phi + variance * np.diag(1.0 / priors**2))
    w = covariance @ phi.T @ target / variance
    e, own, response = list(past[::-1]), [], [1.0]
    for k in range(len(rows)):
        row = np.concatenate((rows[k], [e[-1 - i] for i in range(p)]))
        own.append(float(row @ covariance @ row))
        e.append(float(row @ w))
        response.append(sum(w[N_STATIC + i] * response[-1 - i] for i in range(min(p, len(response)))))
    free = np.array(e[len(past) :])
    tau_2 = np.array([sum(response[k - j] ** 2 * own[j] for j in range(k + 1)) for k in range(len(rows))])
    return free, free * largest_square / (largest_square + tau_2)


@pytest.mark.parametrize("largest_square", [1e-3, 0.3, 100.0])
@pytest.mark.parametrize("correlation", [1.0, 4.0])
@pytest.mark.parametrize("p", [0, 2])
@pytest.mark.parametrize("k", [2, 300])
def test_prediction_is_the_formulas(p: int, k: int, correlation: float, largest_square: float) -> None:
    rng = np.random.default_rng(k + p)
    static, lags = rng.normal(size=(k, N_STATIC)), 0.3 * rng.normal(size=(k, 2))
    target = static @ [0.5, -0.3, 0.1] + lags @ [0.7, 0.1] + 0.05 * rng.normal(size=k)
    rows, past = rng.normal(size=(N, N_STATIC)), np.array([0.2, -0.1])
    one = solved(p, learned(static, lags, target), 0.05**2, correlation)
    found = one.predict(rows, past, largest_square, 100.0)
    free, shrunk = written_out(static, lags, target, rows, past, correlation * 0.05**2, p, largest_square)
    np.testing.assert_allclose(found.unshrunk, free, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.e_h, shrunk, rtol=0, atol=1e-12)
    assert (np.abs(found.e_h) < np.abs(found.unshrunk)).all()
    again = one.predict(rows + 1.0, past, largest_square, 100.0, held=found)
    np.testing.assert_array_equal(again.shrinkage, found.shrinkage)


def test_predictions_are_bounded() -> None:
    evidence = learned(np.ones((50, N_STATIC)), np.zeros((50, 2)), np.full(50, 9.0))
    found = solved(0, evidence, 1e-6).predict(np.ones((N, N_STATIC)), np.zeros(2), 81.0, 5.0)
    assert found.unshrunk[0] > 8.9
    np.testing.assert_allclose(found.e_h, 5.0, rtol=1e-5)
    np.testing.assert_allclose(found.shrinkage * np.clip(found.unshrunk, -5.0, 5.0), found.e_h)


def test_noise_that_is_not_known_is_the_first_one_and_none_is_below_the_least() -> None:
    evidence = learned(np.ones((50, N_STATIC)), np.zeros((50, 2)), np.ones(50))
    assert solved(2, evidence, 0.0, first=0.25).variance == 0.25
    assert solved(2, evidence, 0.5, first=0.25).variance == 0.5
    assert solved(2, evidence, 0.5, 3.0, first=0.25, least=1.0).variance == 3.0


def test_what_was_never_told_apart_is_shrunk_by_its_prior() -> None:
    """Two features that were always equal turn against each other, as friction and an offset at a first reversal."""
    same = np.hstack((np.ones((500, 2)), np.zeros((500, 1))))
    evidence = learned(same, np.zeros((500, 2)), np.ones(500))
    one = solved(0, evidence, 1e-8, least=0.0)
    seen, unseen = one.predict(np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]), np.zeros(0), 1.0, 1.2).e_h
    assert seen == pytest.approx(1.0, abs=1e-6)
    # Weights 0.8 and 0.2; the variance of their difference is 4 · 1² · 0.5² / (1² + 0.5²) = 0.8.
    assert unseen == pytest.approx(0.6 / (1.0 + 0.8), rel=1e-6)


def test_a_recursion_that_diverges_predicts_nothing() -> None:
    lags = np.column_stack((np.logspace(-6, -2, 100), np.zeros(100)))
    evidence = learned(np.zeros((100, N_STATIC)), lags, 1e4 * lags[:, 0])  # a pole at 1e4
    rows, past = np.ones((200, N_STATIC)), np.array([1.0, 1.0])
    found = solved(2, evidence, 1e-6, least=0.0).predict(rows, past, 1.0, 1.2)
    assert np.isfinite(found.e_h).all()
    assert np.abs(found.unshrunk).max() <= 10.0 * 1.2
    assert np.abs(found.e_h[20:]).max() < 1e-4


def judged(one: ExpertErrors, errors: Array, noise_variance: float, given: float = 0.0) -> ExpertErrors:
    nothing = np.zeros(len(errors))
    prediction = ExpertPrediction(nothing, nothing, nothing + 1.0, nothing, noise_variance)
    return one.judge(prediction, errors, np.ones(len(errors), dtype=np.bool_), given)


def test_correlation_follows_errors_that_are_alike() -> None:
    rng, white, alike = np.random.default_rng(0), ExpertErrors(1.0), ExpertErrors(1.0)
    for _ in range(300):
        white = judged(white, rng.normal(size=100), 1.0)
    for _ in range(300):
        alike = judged(alike, rng.normal(size=100) + rng.normal(), 1.0)
    assert 1.0 <= white.correlation < 3.0
    assert 20.0 < alike.correlation <= CONSTANTS.correlation_max  # n · 1² / 1², and the noise
    for _ in range(100):
        alike = judged(alike, np.ones(100), 1e-12)
    assert alike.correlation == CONSTANTS.correlation_max


def test_a_given_noise_is_kept() -> None:
    assert judged(ExpertErrors(), np.zeros(10), 0.3, given=0.04).noise_variance == 0.04
