"""The C core's solutions with penalties against the library's and exact ones. Each test states its tolerance."""

from __future__ import annotations

import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from c_compiler import C_SOURCES, include_flags, run_compiler
from c_gram import WORDS, CGram, CSolution
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hybridsep.predict.regression import RidgeRegression

Array = NDArray[np.float64]
NO_PENALTY = 1e-40


def both(n: int, n_rows: int, seed: int) -> tuple[CGram, RidgeRegression, Array, Array]:
    rng = np.random.default_rng(seed)
    rows = np.cumsum(rng.normal(size=(n_rows, n)), axis=0)  # neighbours alike, columns of many sizes
    rows *= 10.0 ** rng.uniform(-4, 2, n)
    target = rows @ (rng.normal(size=n) / np.abs(rows).max(axis=0)) + 0.1 * rng.normal(size=n_rows)
    gram, library = CGram(n), RidgeRegression.init(n, NO_PENALTY).update(rows, target)
    gram.fold(rows, target)
    return gram, library, rows, target


def assert_same(ours: CSolution, library: RidgeRegression, penalties: Array, rows: Array) -> None:
    """1e-10 relative: weights by their part in the prediction, leverage; residual sum, and 1e-13 of the squares of the
    targets, of which it is what is left.
    """
    expected = library.penalised(penalties)
    m = len(penalties)
    parts = np.abs(rows[:, :m]).max(axis=0)
    scale = max(float(np.max(np.abs(expected.weights) * parts)), 1e-300)
    np.testing.assert_allclose(ours.weights * parts / scale, expected.weights * parts / scale, rtol=0, atol=1e-10)
    assert ours.residual_sum == pytest.approx(expected.residual_sum, rel=1e-10, abs=1e-13 * library.target_square)
    some = rows[:10, :m]
    np.testing.assert_allclose(ours.leverage(some), expected.leverage(some), rtol=1e-10)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 9, 17, 23])
@pytest.mark.parametrize("n_rows", [1, 3, 200])
def test_a_solution_with_penalties_is_the_librarys(n: int, n_rows: int) -> None:
    gram, library, rows, _ = both(n, n_rows, n)
    gram.settle()
    before = gram.block.copy()
    for m in sorted({1, n // 2 or 1, n}):
        penalties = 10.0 ** np.random.default_rng(m).uniform(-3, 3, m) * np.abs(rows[:, :m]).max(axis=0) ** 2
        assert_same(CSolution(gram, penalties), library, penalties, rows)
    np.testing.assert_array_equal(gram.block, before)


@pytest.mark.parametrize("n_rows", [1, 2, 3, 4, 5])
def test_rows_that_wait_count(n_rows: int) -> None:
    gram, library, rows, _ = both(6, n_rows, 1)
    assert gram.square == pytest.approx(library.target_square, rel=1e-14)
    gram.settle()
    assert gram.square == pytest.approx(library.target_square, rel=1e-14)
    penalties = np.abs(rows).max(axis=0) ** 2
    assert_same(CSolution(gram, penalties), library, penalties, rows)


@given(
    st.integers(1, 40),
    st.integers(0, 30),
    st.lists(st.floats(0.0, 4000.0), min_size=23, max_size=23),
    st.integers(0, 9),
)
@settings(max_examples=60, deadline=None)
def test_rows_may_come_while_a_solution_is_made(n: int, n_before: int, amounts: list[float], seed: int) -> None:
    """However much work is done before each row: as with all rows from the beginning."""
    n_rows = n_before + len(amounts)
    _, library, rows, target = both(n, n_rows, seed)
    gram = CGram(n)
    gram.fold(rows[:n_before], target[:n_before])
    later = np.column_stack((rows, target))[n_before:]
    penalties = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, n) * np.abs(rows).max(axis=0) ** 2
    solution = CSolution(gram, penalties, later=later, amounts=amounts)
    assert_same(solution, library, penalties, rows)
    assert_same(CSolution(gram, penalties, later=later, amounts=amounts, apart=False), library, penalties, rows)
    assert solution.lefts == sorted(solution.lefts, reverse=True)
    assert solution.waiting == 1
    assert solution.valid


@given(
    st.integers(1, 40),
    st.integers(0, 30),
    st.floats(-3.0, 3.0),
    st.sampled_from([(False, False), (False, True), (True, True)]),
    st.integers(0, 9),
)
@settings(max_examples=100, deadline=None)
def test_the_last_row_may_tell_more_than_all_others(
    n: int, n_before: int, size: float, when: tuple[bool, bool], seed: int
) -> None:
    """It stays behind the factor, which is completed before or then, or enters it as far as squares resolve it.

    Of sizes and penalties that are drawn, one programme in forty is so badly conditioned that squares do not resolve it
    to 1e-10.
    """
    completed, apart = when
    size = size if apart else min(size, 1.0)
    gram, library, rows, _ = both(n, n_before + 1, seed)
    penalties = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, n) * np.abs(rows).max(axis=0) ** 2
    last = 10.0**size * np.random.default_rng(seed).normal(size=n + 1) * np.abs(np.append(rows[-1], 1.0))
    solution = CSolution(gram, penalties, later=last[None], completed=completed, apart=apart)
    library = library.update_stacked(np.array(last[None], order="F"))
    for factor in (1.0, 1e-3, 1e3):
        changed = np.where(np.arange(n) < n // 2, factor, 1.0) * penalties
        in_factor = rows if apart else np.vstack((last[:-1], rows))
        assume(condition(in_factor, changed) < 1e6)
        solution.finish(changed)
        assert_same(solution, library, changed, np.vstack((last[:-1], rows)))


def condition(rows: Array, penalties: Array) -> float:
    """Return the condition number of a Gram matrix with penalties, whose diagonal is scaled to 1."""
    gram = rows.T @ rows + np.diag(penalties)
    scale = np.sqrt(np.diag(gram))
    return float(np.linalg.cond(gram / np.outer(scale, scale)))


@pytest.mark.parametrize("apart", [False, True])
def test_a_last_row_without_features_counts_with_its_target(apart: bool) -> None:
    gram, library, rows, _ = both(9, 40, 5)
    penalties, last = np.abs(rows).max(axis=0) ** 2, np.append(np.zeros(9), 50.0)
    solution = CSolution(gram, penalties, later=last[None], apart=apart)
    assert_same(solution, library.update_stacked(np.array(last[None], order="F")), penalties, rows)


def test_the_tails_penalties_may_change() -> None:
    gram, library, rows, _ = both(9, 40, 5)
    penalties = np.abs(rows).max(axis=0) ** 2
    solution = CSolution(gram, penalties)
    for factor in (1e-3, 1e3, 1.0):
        changed = np.where(np.arange(9) < 4, factor, 1.0) * penalties
        solution.finish(changed)
        assert_same(solution, library, changed, rows)


def test_no_more_rows_wait_than_there_is_room_for() -> None:
    """A state that was changed on purpose may count more of them."""
    gram, _, rows, target = both(9, 40, 5)
    later = np.column_stack((rows, target))[:3]
    solution = CSolution(gram, np.abs(rows).max(axis=0) ** 2, later=later)
    solution.add(later)
    solution.add(later)
    before = solution.block.copy()
    solution.add(later)
    np.testing.assert_array_equal(solution.block, before)


def test_a_solution_of_other_sizes_or_out_of_range_is_not_valid() -> None:
    gram, _, rows, _ = both(9, 40, 5)
    solution = CSolution(gram, np.abs(rows).max(axis=0) ** 2)
    assert solution.valid
    for name, value in (("factored", 6), ("waiting", 5), ("begun", 2), ("finished", 2), ("completed", 2), ("room", 0)):
        words, word = solution.block.view(np.uint64), WORDS.index(name)
        before, words[word] = int(words[word]), value
        assert not solution.valid
        words[word] = before
    assert solution.valid


def test_rows_of_others_are_added_with_their_weight() -> None:
    gram, library, rows, _ = both(7, 30, 1)
    other, _, other_rows, other_target = both(7, 33, 2)
    penalties = np.abs(rows).max(axis=0) ** 2
    library = library.update(0.1 * other_rows, 0.1 * other_target)
    other.settle()
    assert_same(CSolution(gram, penalties, other, 0.01), library, penalties, rows)
    gram.add(other, 0.01)
    assert_same(CSolution(gram, penalties), library, penalties, rows)


def test_a_solution_with_penalties_is_the_direct_one() -> None:
    # 1e-9 relative against the normal equations, which are well conditioned here.
    gram = CGram(6)
    rng = np.random.default_rng(3)
    rows, target, penalties = rng.normal(size=(50, 6)), rng.normal(size=50), 10.0 ** rng.uniform(-2, 2, 4)
    gram.fold(rows, target)
    found, first = CSolution(gram, penalties), rows[:, :4]
    matrix = first.T @ first + np.diag(penalties)
    expected = np.linalg.solve(matrix, first.T @ target)
    np.testing.assert_allclose(found.weights, expected, rtol=1e-9)
    assert found.residual_sum == pytest.approx(float(np.sum((target - first @ expected) ** 2)), rel=1e-9)
    np.testing.assert_allclose(
        found.leverage(first), np.einsum("ij,jk,ik->i", first, np.linalg.inv(matrix), first), rtol=1e-9
    )


def test_before_any_row_the_weights_are_0() -> None:
    solution = CSolution(CGram(5), np.full(5, 2.0))
    assert not solution.weights.any()
    assert solution.residual_sum == pytest.approx(0.0, abs=1e-39)
    np.testing.assert_allclose(solution.leverage(np.eye(5)), 0.5, rtol=1e-15)


def test_a_loaded_factor_is_worth_its_rows() -> None:
    _, library, rows, _ = both(9, 40, 5)
    gram = CGram(9)
    for i, row in enumerate(library.factor):
        assert gram.load(i, row[i:])
    penalties = np.abs(rows).max(axis=0) ** 2
    assert_same(CSolution(gram, penalties), library, penalties, rows)


@pytest.mark.parametrize("row", [[np.nan, 1.0, 1.0], [np.inf, 1.0, 1.0], [1.0, np.nan, 1.0], [0.0, 1.0, 1.0]])
def test_a_damaged_factor_is_refused(row: list[float]) -> None:
    assert not CGram(2).load(0, np.array(row))


def test_discounted_rows_weigh_as_in_the_library() -> None:
    gram, library, rows, target = both(9, 40, 5)
    for weight in (0.5, 1e-3, 1.0):
        gram.discount(weight)
        gram.fold(rows[:7], target[:7])
        library = library.discount(weight).update(rows[:7], target[:7])
        penalties = 1e-2 * np.abs(rows).max(axis=0) ** 2
        assert_same(CSolution(gram, penalties), library, penalties, rows)


def test_rows_may_be_forgotten_altogether() -> None:
    gram, _, rows, target = both(9, 40, 5)
    for weight in (1e-200, 1e-300, 0.0):
        gram.discount(weight)
    gram.fold(rows, target)
    fresh = RidgeRegression.init(9, NO_PENALTY).update(rows, target)
    penalties = np.abs(rows).max(axis=0) ** 2
    assert_same(CSolution(gram, penalties), fresh, penalties, rows)


def test_no_pivot_is_below_its_penalty_where_rows_are_alike() -> None:
    # All columns are one: what distinguishes their weights is the penalty alone, 1e-13 of the sums of squares. A
    # prediction and its variance are the same as with one column alone: 1e-6 relative.
    n, rng = 40, np.random.default_rng(0)
    column = rng.normal(size=1000)
    rows, target = np.tile(column[:, None], n), 3.0 * column
    gram = CGram(n)
    gram.fold(rows, target)
    solution = CSolution(gram, np.full(n, 1e-13 * float(column @ column)))
    assert rows[0] @ solution.weights == pytest.approx(target[0], rel=1e-6)
    assert solution.leverage(rows[:1])[0] == pytest.approx(column[0] ** 2 / float(column @ column), rel=1e-6)


def test_digits_do_not_wear_off() -> None:
    # 10^6 rows, against exact sums: half a unit in the last place by the last addition, and a few by four
    # products. Sums that do not carry what rounding takes are off by 5e-13.
    n_rows, repetitions = 200, 5000
    rng = np.random.default_rng(1)
    rows, target = 1.0 + rng.random((n_rows, 2)), rng.random(n_rows)
    gram = CGram(2)
    gram.fold_over(rows, target, repetitions)
    gram.settle()
    exact = [
        repetitions * sum((Fraction(a) * Fraction(b) for a, b in zip(x.tolist(), y.tolist(), strict=True)), Fraction(0))
        for x, y in ((rows[:, 0], rows[:, 0]), (rows[:, 0], rows[:, 1]), (rows[:, 0], target))
    ]
    sums = gram.block[-12:-6]
    for found, expected in zip(sums[:3], exact, strict=True):
        assert abs(Fraction(float(found)) - expected) <= Fraction(3e-16) * abs(expected)


@pytest.mark.slow
def test_vectors_change_no_bit(tmp_path: Path) -> None:
    numeric = C_SOURCES / "core" / "numeric"
    sources = [
        Path(__file__).with_name("lanes.c"),
        *(numeric / f"hsep_{name}.c" for name in ("gram", "solution", "cholesky")),
    ]
    shown = []
    for flags in (["-O3"], ["-O3", "-DHSEP_NO_VECTORS"], ["-O1", "-DHSEP_NO_VECTORS"]):
        program = tmp_path / "lanes"
        run_compiler([*flags, *include_flags(), *sources, "-lm", "-o", program])
        done = subprocess.run([program], check=True, capture_output=True, text=True)
        *bits, last = done.stdout.split()
        shown.append((bits, int(last)))
    assert [lanes for _, lanes in shown] == [2, 1, 1]
    assert shown[0][0] == shown[1][0] == shown[2][0]
