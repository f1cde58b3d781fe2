"""One candidate's prediction against its formulas written out: free run, variance, shrinkage, bounds."""

from __future__ import annotations

import numpy as np
import pytest

from hybridsep.base.signals import Array
from hybridsep.predict.regression import RidgeRegression
from hybridsep.predict.trust.candidates import CORRELATION_MAX, Candidate, ResidualScale

N_STATIC, N = 3, 40
EFFECTS = np.array([1.0, 0.5, 0.2])
LAG_PRIORS = np.array([1.0, 0.3])


def learned(static: Array, lags: Array, target: Array) -> RidgeRegression:
    regression = RidgeRegression(N_STATIC + 2, 1e-40)
    regression.update(np.hstack((static, lags)), target)
    return regression


def written_out(
    static: Array, lags: Array, target: Array, rows: Array, past: Array, variance: float, p: int, scale: ResidualScale
) -> tuple[Array, Array]:
    """Return the free run and the shrunk prediction, sample by sample."""
    priors = np.concatenate((EFFECTS, LAG_PRIORS[:p]))
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
    spread = np.array([sum(response[k - j] ** 2 * own[j] for j in range(k + 1)) for k in range(len(rows))])
    v = np.empty(len(rows))
    for k in range(len(rows)):
        beyond = min(float(np.mean(free[: k + 1] ** 2 - spread[: k + 1])), scale.largest_square)
        v[k] = max(scale.recent, beyond * min(1.0, scale.largest / float(np.abs(free[: k + 1]).max())) ** 2)
    return free, free * v / (v + 2.0 * spread)


@pytest.mark.parametrize(
    "scale", [ResidualScale(0.2, 0.3, 100.0), ResidualScale(0.01, 0.3, 0.8), ResidualScale(0.01, 100.0, 100.0)]
)
@pytest.mark.parametrize("correlation_max", [1.0, 4.0])
@pytest.mark.parametrize("p", [0, 2])
@pytest.mark.parametrize("k", [2, 300])
def test_prediction_is_the_formulas(p: int, k: int, correlation_max: float, scale: ResidualScale) -> None:
    rng = np.random.default_rng(k + p)
    static, lags = rng.normal(size=(k, N_STATIC)), 0.3 * rng.normal(size=(k, 2))
    target = static @ [0.5, -0.3, 0.1] + lags @ [0.7, 0.1] + 0.05 * rng.normal(size=k)
    rows, past = rng.normal(size=(N, N_STATIC)), np.array([0.2, -0.1])
    candidate = Candidate(N_STATIC, LAG_PRIORS[:p], correlation_max, 100)
    candidate.noise_variance, candidate.correlation = 0.05**2, 5.0
    found = candidate.solve(learned(static, lags, target), EFFECTS, 1e-9).predict(rows, past[:p], scale)
    free, shrunk = written_out(static, lags, target, rows, past, correlation_max * 0.05**2, p, scale)
    np.testing.assert_allclose(found.unshrunk, free, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.e_h, shrunk, rtol=0, atol=1e-12)
    assert (np.abs(found.e_h) < np.abs(found.unshrunk)).all()


def test_what_was_never_told_apart_is_shrunk_by_its_prior() -> None:
    """Two features that were always equal turn against each other, as friction and an offset at a first reversal."""
    same = np.hstack((np.ones((500, 2)), np.zeros((500, 1))))
    candidate = Candidate(N_STATIC, LAG_PRIORS[:0], 1e4, 100)
    candidate.noise_variance, candidate.correlation = 1e-8, 1.0
    regression, scale = learned(same, np.zeros((500, 2)), np.ones(500)), ResidualScale(1.0, 1.0, 1.0)
    solved = candidate.solve(regression, EFFECTS, 0.0)
    seen, unseen = solved.predict(np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]), np.zeros(0), scale).e_h
    assert seen == pytest.approx(1.0, abs=1e-6)
    # Weights 0.8 and 0.2; the variance of their difference is 4 · 1² · 0.5² / (1² + 0.5²) = 0.8.
    assert unseen == pytest.approx(0.6 / (1.0 + 2.0 * 0.8), rel=1e-6)


def test_where_a_motion_begins_again_a_rest_before_it_does_not_count() -> None:
    """The recent residual is small, but what is predicted has been seen, and is far beyond its own variance."""
    rng = np.random.default_rng(3)
    static = rng.normal(size=(500, N_STATIC))
    candidate = Candidate(N_STATIC, LAG_PRIORS[:0], 1e4, 100)
    candidate.noise_variance, candidate.correlation = 0.1, 1.0
    solved = candidate.solve(learned(static, np.zeros((500, 2)), static @ [1.0, 0.5, 0.2]), EFFECTS, 0.0)
    rows, rest = rng.normal(size=(N, N_STATIC)), 1e-5
    seen = solved.predict(rows, np.zeros(0), ResidualScale(rest, 2.0, 5.0))
    assert np.abs(seen.e_h / seen.unshrunk - 1.0).max() < 0.05
    # A thousandth of it is all that was seen so far: it is not believed.
    unseen = solved.predict(rows, np.zeros(0), ResidualScale(rest, 2e-6, 5e-3))
    assert np.abs(unseen.e_h / unseen.unshrunk).mean() < 0.05


def test_a_recursion_that_diverges_predicts_nothing() -> None:
    lags = np.column_stack((np.logspace(-6, -2, 100), np.zeros(100)))
    regression = learned(np.zeros((100, N_STATIC)), lags, 1e4 * lags[:, 0])  # a pole at 1e4
    candidate = Candidate(N_STATIC, np.full(2, 1e6), 1e4, 100)
    candidate.noise_variance = 1e-6
    rows, past = np.ones((200, N_STATIC)), np.array([1.0, 1.0])
    scale = ResidualScale(1.0, 1.0, 1.0)
    found = candidate.solve(regression, EFFECTS, 0.0).predict(rows, past, scale)
    assert np.isfinite(found.e_h).all()
    assert np.abs(found.unshrunk).max() <= 10.0 * scale.largest
    assert np.abs(found.e_h[20:]).max() < 1e-4


def test_correlation_follows_errors_that_are_alike() -> None:
    rng = np.random.default_rng(0)
    white, alike = (Candidate(N_STATIC, LAG_PRIORS, 1e4, 100) for _ in range(2))
    for candidate, common in ((white, 0.0), (alike, 1.0)):
        candidate.noise_variance = 1.0
        for _ in range(300):
            candidate.judge(np.zeros(100), rng.normal(size=100) + common * rng.normal())
    assert 1.0 <= white.correlation < 3.0
    assert 30.0 < alike.correlation < 300.0  # n · 1² / 1², and the noise
    alike.noise_variance = 0.0
    for _ in range(100):
        alike.judge(np.zeros(100), np.ones(100))
    assert alike.correlation == pytest.approx(CORRELATION_MAX, rel=1e-3)
    assert alike.correlation <= CORRELATION_MAX
