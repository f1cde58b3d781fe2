"""The C core's solutions with penalties against the library's and exact ones. Each test states its tolerance."""

import ctypes
from fractions import Fraction

import c_core
import numpy as np
import pytest
from c_core import pointer
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from stream import PREDICTOR

from hybridsep.base.signals import Array
from hybridsep.predict.regression import RidgeRegression

NO_PENALTY = 1e-40

ABREAST = 4  # HSEP_SOLUTION_ABREAST
TOGETHER = 4  # HSEP_GRAM_TOGETHER

WORDS = ("n_head", "n_tail", "room", "begun", "factored", "waiting", "finished", "square")
OFFSETS = ("penalties", "weights", "factor", "left", "least", "rows", "work", "abreast")
"""Of hsep_solution, the offsets after the other words."""


class CGram:
    """hsep_gram, whose features are backwards."""

    def __init__(self, n: int) -> None:
        self.library, self.n = c_core.library(PREDICTOR), n
        self.library.hsep_gram_size.restype = self.library.hsep_gram_square.restype = ctypes.c_double
        self.block = np.zeros(int(self.library.hsep_gram_size(ctypes.c_uint64(n))) // 8)
        self._block = pointer(self.block)
        self.library.hsep_gram_init(self._block, ctypes.c_uint64(n))

    def fold(self, rows: Array, target: Array) -> None:
        self.fold_over(rows, target, 1)

    def fold_over(self, rows: Array, target: Array, repetitions: int) -> None:
        stacked = np.ascontiguousarray(np.column_stack((rows[:, ::-1], target)))
        count = ctypes.c_size_t(len(rows))
        self.library.test_fold_gram(self._block, pointer(stacked), count, ctypes.c_size_t(repetitions))

    def settle(self) -> None:
        self.library.hsep_gram_settle(self._block)

    def add(self, other: "CGram", weight: float) -> None:
        self.library.hsep_gram_add(self._block, other._block, ctypes.c_double(weight))

    def discount(self, weight: float) -> None:
        self.library.hsep_gram_discount(self._block, ctypes.c_double(weight))

    @property
    def square(self) -> float:
        return float(self.library.hsep_gram_square(self._block))


class CSolution:
    """Weights of the first features with penalties, as hsep_experts.c solves for them: the tail's are backwards.

    ``gram``: its rows, settled; ``penalties``, (m,): of its first ``m`` features; of all, their second half is
    the head; ``other``: rows that are added with a ``weight``, settled; ``later``, (k, m + 1): rows ``[φ | target]``
    that come once it has begun; ``amounts``: multiply-adds before each of them; what is left is done in the end.
    """

    def __init__(
        self,
        gram: CGram,
        penalties: Array,
        other: CGram | None = None,
        weight: float = 1.0,
        later: Array | None = None,
        amounts: list[float] | None = None,
    ) -> None:
        self.library, m = gram.library, len(penalties)
        n_head = m - m // 2 if m == gram.n else 0
        later = np.empty((0, m + 1)) if later is None else np.ascontiguousarray(later)
        sizes = [ctypes.c_uint64(n) for n in (n_head, m - n_head, len(later) + TOGETHER)]
        self.library.hsep_solution_size.restype = self.library.hsep_solution_finish.restype = ctypes.c_double
        self.library.hsep_solution_left.restype = ctypes.c_double
        self.block = np.full(int(self.library.hsep_solution_size(*sizes)) // 8, np.nan)
        self._block = pointer(self.block)
        self.library.hsep_solution_init(self._block, *sizes)
        self.n_head, self.m = n_head, m
        self._part("penalties", m)[:] = self._tail_backwards(penalties)
        if other is not None:
            other.settle()
        added = None if other is None else other._block
        self.library.hsep_solution_begin(self._block, gram._block, added, ctypes.c_double(weight))
        self.lefts = [self.left(len(later))]
        for i, row in enumerate(later):
            self.add(row[None])
            if amounts is not None:
                self.library.hsep_solution_advance(self._block, ctypes.c_double(amounts[i]), ctypes.c_int(i % 2))
                self.lefts.append(self.left(len(later) - 1 - i))
        self.finish()

    def add(self, rows: Array) -> None:
        """Take rows ``[φ | target]``."""
        for row in np.hstack((rows[:, -2::-1], rows[:, -1:])):
            self.library.hsep_solution_row(self._block, pointer(row), ctypes.c_uint64(len(row) - 1))

    def finish(self, penalties: Array | None = None) -> None:
        """Solve for the weights, with other penalties of the tail if there are."""
        if penalties is not None:
            self._part("penalties", len(penalties))[:] = self._tail_backwards(penalties)
        self.residual_sum = self.library.hsep_solution_finish(self._block)

    def left(self, to_come: int = 0) -> float:
        return float(self.library.hsep_solution_left(self._block, ctypes.c_uint64(to_come)))

    def _part(self, name: str, count: int) -> Array:
        place = int(self.block.view(np.uint64)[len(WORDS) + OFFSETS.index(name)])
        return self.block[place : place + count]

    def _tail_backwards(self, features: Array) -> Array:
        n_tail = self.m - self.n_head
        return np.concatenate((features[:n_tail][::-1], features[n_tail:]))

    @property
    def weights(self) -> Array:
        return self._tail_backwards(self._part("weights", self.m))

    def leverage(self, rows: Array) -> Array:
        found, in_order = [], rows[:, ::-1]
        for first in range(0, len(rows), ABREAST):
            some = in_order[first : first + ABREAST]
            places = self._part("work", ABREAST * (self.m + 1)).reshape(ABREAST, self.m + 1)
            places[: len(some), : self.m] = some
            leverages = np.full(ABREAST, np.nan)
            count = ctypes.c_uint64(len(some))
            self.library.hsep_solution_leverages(self._block, count, pointer(leverages))
            found += leverages[: len(some)].tolist()
        return np.array(found)


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


@pytest.mark.parametrize("n", [1, 4, 5, 9, 23])
@pytest.mark.parametrize("n_rows", [1, 2, 3, 4, 5, 200])  # four are folded together
def test_a_solution_with_penalties_is_the_librarys(n: int, n_rows: int) -> None:
    gram, library, rows, _ = both(n, n_rows, n)
    assert gram.square == pytest.approx(library.target_square, rel=1e-14)
    gram.settle()
    assert gram.square == pytest.approx(library.target_square, rel=1e-14)
    before = gram.block.copy()
    for m in sorted({1, n // 2 or 1, n}):
        penalties = 10.0 ** np.random.default_rng(m).uniform(-3, 3, m) * np.abs(rows[:, :m]).max(axis=0) ** 2
        assert_same(CSolution(gram, penalties), library, penalties, rows)
    np.testing.assert_array_equal(gram.block, before)


@given(
    st.integers(1, 40),
    st.integers(0, 30),
    st.lists(st.floats(0.0, 4000.0), min_size=23, max_size=23),
    st.integers(0, 9),
)
@settings(max_examples=30, deadline=None)
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
    assert solution.lefts == sorted(solution.lefts, reverse=True)


@given(st.integers(1, 40), st.integers(0, 30), st.floats(-3.0, 1.0), st.integers(0, 9))
@settings(max_examples=50, deadline=None)
def test_the_last_row_may_tell_more_than_all_others(n: int, n_before: int, size: float, seed: int) -> None:
    """Squares resolve it to 1e-10, but where a programme is badly conditioned, one in forty."""
    gram, library, rows, _ = both(n, n_before + 1, seed)
    penalties = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, n) * np.abs(rows).max(axis=0) ** 2
    last = 10.0**size * np.random.default_rng(seed).normal(size=n + 1) * np.abs(np.append(rows[-1], 1.0))
    solution = CSolution(gram, penalties, later=last[None])
    library = library.update(last[None, :-1], last[-1:])
    for factor in (1.0, 1e-3, 1e3):
        changed = np.where(np.arange(n) < n // 2, factor, 1.0) * penalties
        in_factor = np.vstack((last[:-1], rows))
        assume(condition(in_factor, changed) < 1e6)
        solution.finish(changed)
        assert_same(solution, library, changed, in_factor)


def condition(rows: Array, penalties: Array) -> float:
    """Return the condition number of a Gram matrix with penalties, whose diagonal is scaled to 1."""
    gram = rows.T @ rows + np.diag(penalties)
    scale = np.sqrt(np.diag(gram))
    return float(np.linalg.cond(gram / np.outer(scale, scale)))


def test_a_last_row_without_features_counts_with_its_target() -> None:
    gram, library, rows, _ = both(9, 40, 5)
    penalties, last = np.abs(rows).max(axis=0) ** 2, np.append(np.zeros(9), 50.0)
    solution = CSolution(gram, penalties, later=last[None])
    assert_same(solution, library.update(last[None, :-1], last[-1:]), penalties, rows)


def test_no_more_rows_wait_than_there_is_room_for() -> None:
    """A state that was changed on purpose may count more of them."""
    gram, _, rows, target = both(9, 40, 5)
    later = np.column_stack((rows, target))[:3]
    solution = CSolution(gram, np.abs(rows).max(axis=0) ** 2, later=later)
    for _ in range(3):
        solution.add(later)
    before = solution.block.copy()
    solution.add(later)
    np.testing.assert_array_equal(solution.block, before)


def test_rows_of_others_are_added_with_their_weight() -> None:
    gram, library, rows, _ = both(7, 30, 1)
    other, _, other_rows, other_target = both(7, 33, 2)
    penalties = np.abs(rows).max(axis=0) ** 2
    library = library.update(0.1 * other_rows, 0.1 * other_target)
    other.settle()
    assert_same(CSolution(gram, penalties, other, 0.01), library, penalties, rows)
    gram.add(other, 0.01)
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
    # All columns are one: what distinguishes their weights is only the penalty, 1e-13 of the sums of squares. A
    # prediction and its variance are the same as with just one column: 1e-6 relative.
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
        for x, y in ((rows[:, 1], rows[:, 1]), (rows[:, 1], rows[:, 0]), (rows[:, 1], target))
    ]
    sums = gram.block[-12:-6]
    for found, expected in zip(sums[:3], exact, strict=True):
        assert abs(Fraction(float(found)) - expected) <= Fraction(3e-16) * abs(expected)
