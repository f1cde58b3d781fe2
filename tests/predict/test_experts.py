"""One expert's prediction against its formulas written out; the stack of experts against its optimality conditions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from hybridsep.base.signals import Array
from hybridsep.predict.averaging.constants import CONSTANTS
from hybridsep.predict.averaging.experts import EXPERTS, ExpertErrors, ExpertPrediction, SolvedExpert, solve
from hybridsep.predict.averaging.stacking import Stack, simplex_minimum
from hybridsep.predict.regression import RidgeRegression

N_STATIC, N = 3, 40
SHARES = np.array([1.0, 0.5, 0.2])


def learned(static: Array, lags: Array, target: Array) -> RidgeRegression:
    return RidgeRegression.init(N_STATIC + 2, 1e-40).update(np.hstack((static, lags)), target)


def solved(
    p: int,
    evidence: RidgeRegression,
    noise: float,
    correlation: float = 1.0,
    *,
    first: float = 1.0,
    least: float = 1e-9,
) -> SolvedExpert:
    return solve(evidence, ExpertErrors(noise, correlation).variance(evidence.target_square, first, least), SHARES, p)


def written_out(
    static: Array, lags: Array, target: Array, rows: Array, past: Array, variance: float, p: int, largest_square: float
) -> tuple[Array, Array]:
    """Return the free run and the shrunk prediction, sample by sample."""
    priors = np.concatenate((SHARES, np.sqrt([1.0, CONSTANTS.last_lag**0.5])[:p]))
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


# Their stack --------------------------------------------------------------------------------------------------------


FIRST = np.array([one.first_weight for one in EXPERTS])
N_EXPERTS = len(EXPERTS)
NP = 50


@given(
    n=st.integers(1, 4),
    rank=st.integers(1, 4),
    ridge=st.sampled_from([1e-6, 1e-3, 1.0]),
    scale=st.sampled_from([1e-12, 1.0, 1e6]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_minimum_meets_its_optimality_conditions(n: int, rank: int, ridge: float, scale: float, seed: int) -> None:
    """Karush, Kuhn and Tucker's: they are sufficient, as the problem is convex."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(rank, n))
    H, linear = scale * (A.T @ A + ridge * np.eye(n)), scale * rng.normal(size=n) * rng.choice([0.1, 1.0, 10.0])
    found = simplex_minimum(H, linear)
    np.testing.assert_allclose(simplex_minimum(H, linear, rng.random(n) < 0.5), found, rtol=0, atol=1e-6)
    assert (found >= 0.0).all()
    # Of an all but singular H the minimum without Σπ ≤ 1 is far away, and the way back from it is rounded.
    assert found.sum() <= 1.0 + 1e-9 + 1e-15 * np.abs(np.linalg.solve(H, linear)).sum()
    gradient = (H @ found - linear) / scale
    active = found > 0.0
    # The multiplier of Σπ ≤ 1 is the descent that is left on the support.
    multiplier = -float(gradient[active].mean()) if found.sum() > 1.0 - 1e-8 and active.any() else 0.0
    assert multiplier >= -1e-7
    np.testing.assert_allclose(gradient[active] + multiplier, 0.0, atol=1e-7)
    assert (gradient[~active] + multiplier >= -1e-7).all()


def test_a_singular_problem_has_a_minimum() -> None:
    assert simplex_minimum(np.full((2, 2), 2.0), np.array([1.0, 1.0])).sum() == pytest.approx(0.5)
    np.testing.assert_array_equal(simplex_minimum(np.zeros((2, 2)), np.array([-1.0, -1.0])), 0.0)


def experts(three: Array) -> Array:
    """Return the predictions of all experts, of which all after the first three predict 0."""
    return np.concatenate((three, np.zeros((N_EXPERTS - 3, three.shape[1]))))


def replayed(stack: Stack, errors: tuple[float, float, float], n_windows: int, seed: int = 0) -> Stack:
    """Return it with windows of a target of RMS 1 and experts off it by independent errors of given RMS."""
    rng = np.random.default_rng(seed)
    for _ in range(n_windows):
        target = rng.normal(size=NP)
        predicted = np.array([target + size * rng.normal(size=NP) for size in errors])
        stack = stack.update(experts(predicted), target, 0.0)
    return stack


@pytest.mark.parametrize("like", [None, np.linspace(0.0, 0.3, N_EXPERTS)])
def test_its_weights_are_the_formula(like: Array | None) -> None:
    """Two windows by a general solver of the whole problem, with ``s²`` of the best expert; of plans, too."""
    prior, kappa = (FIRST, CONSTANTS.kappa) if like is None else (like, CONSTANTS.kappa_of_plans)
    rng = np.random.default_rng(5)
    windows = [(experts(rng.normal(size=(3, NP))), rng.normal(size=NP)) for _ in range(2)]
    stack = Stack.init()
    for predicted, measured in windows:
        stack = stack.update(predicted, measured, 0.0, like)
    fades = (1.0 - CONSTANTS.renewal, 1.0)
    squares = [0.0] * (N_EXPERTS + 1)
    for fade, (predicted, measured) in zip(fades, windows, strict=True):
        for i, one in enumerate((*predicted, np.zeros(NP))):
            squares[i] += fade * float(np.sum((measured - one) ** 2))
    s_2 = min(squares) / (NP * sum(fades))

    def cost(pi: Array) -> float:
        misfit = sum(f * float(np.sum((e - pi @ F) ** 2)) for f, (F, e) in zip(fades, windows, strict=True))
        return misfit + kappa * s_2 * NP * float(np.sum((pi - prior) ** 2))

    found = minimize(
        cost,
        np.full(N_EXPERTS, 0.1),
        method="SLSQP",
        bounds=[(0.0, 1.0)] * N_EXPERTS,
        constraints={"type": "ineq", "fun": lambda pi: 1.0 - pi.sum()},
        options={"ftol": 1e-14},
    )
    np.testing.assert_allclose(stack.weights, found.x, atol=1e-5)


def test_the_better_expert_is_preferred_and_evidence_fades() -> None:
    stack = Stack.init()
    np.testing.assert_array_equal(stack.weights, FIRST)
    stack = replayed(stack, (3.0, 0.02, 3.0), 60)
    assert stack.weights[1] > 0.95
    # The other one is better from now on: after ten times the memory nothing is left of what was.
    stack = replayed(stack, (3.0, 3.0, 0.02), 200, seed=1)
    assert stack.weights[2] > 0.95
    assert stack.weights.sum() <= 1.0 + 1e-12


def test_without_evidence_the_weights_are_the_first_ones() -> None:
    stack = Stack.init().update(np.zeros((N_EXPERTS, NP)), np.zeros(NP), 0.0)
    np.testing.assert_allclose(stack.weights, FIRST, atol=1e-12)


def test_physics_is_preferred_to_experts_that_know_nothing() -> None:
    stack, rng = Stack.init(), np.random.default_rng(2)
    for _ in range(60):
        stack = stack.update(experts(rng.normal(size=(3, NP))), rng.normal(size=NP), 0.0)
    assert stack.weights[:3].sum() < 0.1


def test_errors_below_the_least_mean_square_move_the_weights_little() -> None:
    stack = Stack.init().update(experts(np.full((3, NP), 1e-3)), np.full(NP, -1e-3), 1.0)
    np.testing.assert_allclose(stack.weights, FIRST, atol=1e-4)


def test_first_weights_are_an_average() -> None:
    assert FIRST.min() >= 0.0
    assert FIRST.sum() == pytest.approx(1.0)


def test_an_expert_with_the_evidence_of_another_is_as_good() -> None:
    stack = replayed(Stack.init(), (3.0, 0.1, 3.0), 30).copy(EXPERTS[1], EXPERTS[0])
    np.testing.assert_allclose(stack.gram, stack.gram.T)
    assert stack.gram[0, 1] == stack.gram[0, 0] == stack.gram[1, 1]
    stack = stack.update(np.zeros((N_EXPERTS, NP)), np.zeros(NP), 0.0)
    assert stack.weights[1] - stack.weights[0] == pytest.approx(FIRST[1] - FIRST[0])  # what only tells them apart
    stack = stack.forget(EXPERTS[0]).update(np.zeros((N_EXPERTS, NP)), np.zeros(NP), 0.0)
    assert stack.weights[0] < 1e-9
