"""Stack of experts: the minimum over the simplex against its optimality conditions, and what it prefers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from hybridsep.base.signals import Array
from hybridsep.predict.averaging.constants import CONSTANTS
from hybridsep.predict.averaging.experts import EXPERTS
from hybridsep.predict.averaging.stacking import Stack, simplex_minimum

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
    twice = np.full((2, 2), 2.0)
    found = simplex_minimum(twice, np.array([1.0, 1.0]))
    assert found.sum() == pytest.approx(0.5)
    np.testing.assert_array_equal(simplex_minimum(np.zeros((2, 2)), np.array([-1.0, -1.0])), 0.0)


def experts(three: Array) -> Array:
    """Return the predictions of all experts, of which those behind the first three predict 0."""
    return np.concatenate((three, np.zeros((N_EXPERTS - 3, three.shape[1]))))


def replayed(stack: Stack, errors: tuple[float, float, float], n_windows: int, seed: int = 0) -> Stack:
    """Return it with windows of a target of RMS 1 and experts off it by independent errors of given RMS."""
    rng = np.random.default_rng(seed)
    for _ in range(n_windows):
        target = rng.normal(size=NP)
        predicted = np.array([target + size * rng.normal(size=NP) for size in errors])
        stack = stack.update(experts(predicted), target, 0.0)
    return stack


def test_its_weights_are_the_formula() -> None:
    """Two windows by a general solver of the whole problem, with ``s²`` of the best expert."""
    rng = np.random.default_rng(5)
    windows = [(experts(rng.normal(size=(3, NP))), rng.normal(size=NP)) for _ in range(2)]
    stack = Stack.init()
    for predicted, measured in windows:
        stack = stack.update(predicted, measured, 0.0)
    fades = (CONSTANTS.gamma, 1.0)
    squares = [0.0] * (N_EXPERTS + 1)
    for fade, (predicted, measured) in zip(fades, windows, strict=True):
        for i, one in enumerate((*predicted, np.zeros(NP))):
            squares[i] += fade * float(np.sum((measured - one) ** 2))
    s_2 = min(squares) / (NP * sum(fades))

    def cost(pi: Array) -> float:
        misfit = sum(f * float(np.sum((e - pi @ F) ** 2)) for f, (F, e) in zip(fades, windows, strict=True))
        return misfit + CONSTANTS.kappa * s_2 * NP * float(np.sum((pi - FIRST) ** 2))

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
    stack = Stack.init()
    stack = stack.update(np.zeros((N_EXPERTS, NP)), np.zeros(NP), 0.0)
    np.testing.assert_allclose(stack.weights, FIRST, atol=1e-12)


def test_physics_is_preferred_to_experts_that_know_nothing() -> None:
    stack, rng = Stack.init(), np.random.default_rng(2)
    for _ in range(60):
        stack = stack.update(experts(rng.normal(size=(3, NP))), rng.normal(size=NP), 0.0)
    assert stack.weights[:3].sum() < 0.1


def test_errors_below_the_least_mean_square_move_the_weights_little() -> None:
    stack = Stack.init()
    stack = stack.update(experts(np.full((3, NP), 1e-3)), np.full(NP, -1e-3), 1.0)
    np.testing.assert_allclose(stack.weights, FIRST, atol=1e-4)


def test_first_weights_are_an_average() -> None:
    assert FIRST.min() >= 0.0
    assert FIRST.sum() == pytest.approx(1.0)


def test_an_expert_with_the_evidence_of_another_is_as_good() -> None:
    stack = Stack.init()
    stack = replayed(stack, (3.0, 0.1, 3.0), 30)
    stack = stack.copy(EXPERTS[1], EXPERTS[0])
    np.testing.assert_allclose(stack.gram, stack.gram.T)
    assert stack.gram[0, 1] == stack.gram[0, 0] == stack.gram[1, 1]
    stack = stack.update(np.zeros((N_EXPERTS, NP)), np.zeros(NP), 0.0)
    assert stack.weights[1] - stack.weights[0] == pytest.approx(FIRST[1] - FIRST[0])  # what alone tells them apart
    stack = stack.forget(EXPERTS[0])
    stack = stack.update(np.zeros((N_EXPERTS, NP)), np.zeros(NP), 0.0)
    assert stack.weights[0] < 1e-9
