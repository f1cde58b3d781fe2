"""Blend of candidates: the minimum over the simplex against its optimality conditions, and what it prefers."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybridsep.predict.trust.blend import Blend, simplex_minimum

FIRST, LATER = (0.0, 0.5, 0.5), (0.5, 0.0, 0.5)
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
    assert found.sum() <= 1.0 + 1e-9
    gradient = (H @ found - linear) / scale
    active = found > 0.0
    # The multiplier of Σπ ≤ 1 is the descent that is left on the support.
    multiplier = -float(gradient[active].mean()) if found.sum() > 1.0 - 1e-8 and active.any() else 0.0
    assert multiplier >= -1e-7
    np.testing.assert_allclose(gradient[active] + multiplier, 0.0, atol=1e-7)
    assert (gradient[~active] + multiplier >= -1e-7).all()


@pytest.mark.parametrize("seed", range(5))
def test_no_point_of_a_grid_is_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, linear = rng.normal(size=(5, 3)), rng.normal(size=3)
    H = A.T @ A
    found = simplex_minimum(H, linear)
    steps = np.linspace(0.0, 1.0, 21)
    grid = np.array([point for point in product(steps, repeat=3) if sum(point) <= 1.0 + 1e-12])
    costs = 0.5 * np.einsum("ki,ij,kj->k", grid, H, grid) - grid @ linear
    assert 0.5 * found @ H @ found - linear @ found <= costs.min() + 1e-12


def test_a_singular_problem_has_a_minimum() -> None:
    twice = np.full((2, 2), 2.0)
    found = simplex_minimum(twice, np.array([1.0, 1.0]))
    assert found.sum() == pytest.approx(0.5)
    np.testing.assert_array_equal(simplex_minimum(np.zeros((2, 2)), np.array([-1.0, -1.0])), 0.0)


def replayed(
    blend: Blend, errors: tuple[float, float, float], n_windows: int, seed: int = 0, n_rows: float = 1e6
) -> None:
    """Update with windows of a target of RMS 1 and candidates off it by independent errors of given RMS."""
    rng = np.random.default_rng(seed)
    for _ in range(n_windows):
        target = rng.normal(size=50)
        blend.update(np.array([target + size * rng.normal(size=50) for size in errors]), target, 1.0, n_rows)


def test_the_better_candidate_is_preferred_and_evidence_fades() -> None:
    blend = Blend(FIRST, LATER, NP)
    np.testing.assert_array_equal(blend.weights, FIRST)
    replayed(blend, (3.0, 0.02, 3.0), 60)
    assert blend.weights[1] > 0.95
    # The other one is better from now on: after six times the memory nothing is left of what was.
    replayed(blend, (3.0, 3.0, 0.02), 200, seed=1)
    assert blend.weights[2] > 0.95
    assert blend.weights.sum() <= 1.0 + 1e-12


def test_evidence_of_the_time_when_little_was_known_fades_sooner() -> None:
    weights = []
    for n_rows in (1e6, 5 * NP):
        blend = Blend(FIRST, FIRST, NP)
        replayed(blend, (3.0, 0.1, 1.0), 10, n_rows=n_rows)
        replayed(blend, (3.0, 1.0, 0.1), 8, seed=1, n_rows=n_rows)
        weights.append(blend.weights[2])
    assert weights[0] < 0.5 < 0.75 < weights[1]


def test_without_evidence_the_weights_go_from_the_first_to_the_later_ones() -> None:
    blend = Blend(FIRST, LATER, NP)
    for n_windows, later in ((0.0, 0.0), (15.0, 0.5), (1e6, 1.0)):
        blend.update(np.zeros((3, NP)), np.zeros(NP), 1.0, n_windows * NP)
        np.testing.assert_allclose(blend.weights, (1.0 - later) * np.array(FIRST) + later * np.array(LATER), atol=1e-4)


def test_physics_is_preferred_to_candidates_that_know_nothing() -> None:
    blend, rng = Blend(FIRST, LATER, NP), np.random.default_rng(2)
    for _ in range(60):
        blend.update(rng.normal(size=(3, 50)), rng.normal(size=50), 1.0, 0.0)
    assert blend.weights.sum() < 0.1


def test_one_window_of_little_evidence_moves_the_weights_little() -> None:
    blend = Blend(FIRST, LATER, NP)
    blend.update(np.full((3, 50), 1e-3), np.full(50, -1e-3), 1.0, 0.0)
    np.testing.assert_allclose(blend.weights, FIRST, atol=1e-4)


def test_the_first_weights_count_for_less_the_more_was_learned() -> None:
    """A candidate whose errors are far smaller than the residuals were at first."""
    early, late = Blend(FIRST, FIRST, NP), Blend(FIRST, FIRST, NP)
    rng = np.random.default_rng(4)
    for i in range(20):
        target = 0.1 * rng.normal(size=NP)
        candidates = target + np.array([[0.3], [0.2], [0.01]]) * rng.normal(size=(3, NP))
        early.update(candidates, target, 1.0, 0.0)
        late.update(candidates, target, 1.0, (i + 1) * NP)
    assert early.weights[2] < 0.65 < 0.75 < late.weights[2]


def test_without_a_scale_nothing_is_known() -> None:
    blend = Blend(FIRST, LATER, NP)
    blend.update(np.zeros((3, 50)), np.zeros(50), 0.0, 0.0)
    np.testing.assert_array_equal(blend.weights, FIRST)
