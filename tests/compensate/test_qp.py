"""The interior-point solver against Clarabel, in plans in which an iterate short of the minimum is not good enough."""

import re

import numpy as np
import pytest
from library_stream import LookAheadStream
from oracle import clarabel_minimum
from places import ROOT
from random_loops import random_loop, run
from stream import COMPENSATOR

from hybridsep.base.signals import Array
from hybridsep.compensate import qp as _qp
from hybridsep.compensate.qp import EXACT, Minimum, Tolerance, minimise

Problem = tuple[Array, Array, Array, Array, Array, float]


def problems_of(monkeypatch: pytest.MonkeyPatch, seed: int, n: int, **fixed: float) -> list[tuple[Problem, Array]]:
    """Return the bounded problems of a closed loop on the staircase drive, and what was found of them."""
    found = []

    def spy(*problem: object) -> Minimum:
        assert problem[-1] == EXACT
        minimum = minimise(*problem)  # type: ignore[arg-type]
        found.append((problem[:-1], minimum.x))
        return minimum

    monkeypatch.setattr(_qp, "minimise", spy)
    run(LookAheadStream(COMPENSATOR), random_loop(seed, n, **fixed))
    return found  # type: ignore[return-value]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "n", "fixed"),
    [
        pytest.param(34, 300, {}, id="jerk bounds side by side"),
        pytest.param(38, 1000, {}, id="limits of the trajectory", marks=pytest.mark.nightly),
        pytest.param(233, 800, {"change_max": 1e-4}, id="change of 0.1 mm", marks=pytest.mark.nightly),
    ],
)
def test_the_minimum_is_that_of_another_solver(
    monkeypatch: pytest.MonkeyPatch, seed: int, n: int, fixed: dict[str, float]
) -> None:
    """To 2 nm in every coefficient; a stop at 1e-5 of the cost left 0.3 to 3 µm, and roundings grew with it."""
    problems = problems_of(monkeypatch, seed, n, **fixed)
    assert len(problems) >= 10
    for (P, v, rows, low, high, cost), x in problems[:: max(1, len(problems) // 10)]:
        values = rows @ x
        assert np.max(np.maximum(values - high, low - values)) <= 10 * EXACT.margin
        expected = clarabel_minimum(P, v, rows, low, high, 1e-11)  # with 1e-13 rounding ends it 1 µm away
        np.testing.assert_allclose(x, expected, rtol=0, atol=2e-9)
        assert abs(0.5 * (x @ P @ x - expected @ P @ expected) - v @ (x - expected)) <= 1e-10 * cost


@pytest.mark.slow
def test_bounds_that_are_equal_or_nearly_so() -> None:
    """The mere Gram matrix of the rows is singular, and with multipliers in it P is lost in its rounding."""
    rng = np.random.default_rng(0)
    n = 30
    root = rng.normal(size=(n, n))
    P = root @ root.T / n + 1e-3 * np.eye(n)
    v = rng.normal(size=n)
    some = 1e3 * rng.normal(size=(20, n))
    rows = np.concatenate((some, some, some * (1 + 1e-12), some + 1e-6 * rng.normal(size=some.shape)))
    bound = 0.1 + rng.uniform(size=20)
    low, high = np.tile(-bound, 4), np.tile(bound, 4)
    x = minimise(P, v, rows, low, high, float(v @ np.linalg.solve(P, v))).x
    expected = clarabel_minimum(P, v, rows, low, high, 1e-11)
    assert np.max(np.abs(rows @ x) - high) <= 10 * EXACT.margin
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-7 * float(np.max(np.abs(expected))))


@pytest.mark.slow
def test_a_problem_without_active_bounds() -> None:
    P, v = np.diag([1.0, 4.0]), np.array([1.0, 2.0])
    x = minimise(P, v, np.eye(2), np.full(2, -9.0), np.full(2, 9.0), 2.0).x
    np.testing.assert_allclose(x, [1.0, 0.5], rtol=1e-9)


def test_the_cores_tolerance_has_the_same_order() -> None:
    """The generated header gives its numbers in a row."""
    header = (ROOT / "fmu_src" / "c" / "core" / "compensate" / "hsep_interior.h").read_text(encoding="utf-8")
    struct = header.partition("typedef struct {")[2].partition("} hsep_tolerance;")[0]
    assert tuple(re.findall(r"hsep_\w+ (\w+);", struct)) == Tolerance._fields
