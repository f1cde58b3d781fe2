"""The C core's Gram matrix, and the solutions from it, through ctypes."""

from __future__ import annotations

import ctypes
from typing import Any

import c_core
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ABREAST = 4
"""HSEP_SOLUTION_ABREAST."""

TOGETHER = 4
"""HSEP_GRAM_TOGETHER."""

WORDS = ("n_head", "n_tail", "room", "begun", "factored", "waiting", "finished", "completed", "square", "last_square")
OFFSETS = ("penalties", "weights", "factor", "left", "least", "rows", "last", "work", "abreast")
"""Of hsep_solution, the offsets behind the other words."""


def pointer(array: Array) -> Any:
    return array.ctypes.data_as(ctypes.c_void_p)


class CGram:
    """hsep_gram."""

    def __init__(self, n: int) -> None:
        self.library, self.n = c_core.library("predictor"), n
        self.library.hsep_gram_size.restype = self.library.hsep_gram_square.restype = ctypes.c_double
        self.library.hsep_gram_row.restype = ctypes.POINTER(ctypes.c_double)
        self.block = np.zeros(int(self.library.hsep_gram_size(ctypes.c_uint64(n))) // 8)
        self.library.hsep_gram_init(self._block, ctypes.c_uint64(n))

    @property
    def _block(self) -> Any:
        return pointer(self.block)

    def _put(self, row: Array) -> None:
        place = self.library.hsep_gram_row(self._block)
        for j, value in enumerate(row.tolist()):
            place[j] = value

    def fold(self, rows: Array, target: Array) -> None:
        for row in np.column_stack((rows, target)):
            self._put(row)
            self.library.hsep_gram_fold(self._block)

    def fold_over(self, rows: Array, target: Array, repetitions: int) -> None:
        stacked = np.ascontiguousarray(np.column_stack((rows, target)))
        count = ctypes.c_size_t(len(rows))
        self.library.test_fold_gram(self._block, pointer(stacked), count, ctypes.c_size_t(repetitions))

    def load(self, i: int, row: Array) -> int:
        self._put(row)
        done: int = self.library.hsep_gram_load(self._block, ctypes.c_uint64(i))
        return done

    def settle(self) -> None:
        self.library.hsep_gram_settle(self._block)

    def add(self, other: CGram, weight: float) -> None:
        self.library.hsep_gram_add(self._block, other._block, ctypes.c_double(weight))

    def discount(self, weight: float) -> None:
        self.library.hsep_gram_discount(self._block, ctypes.c_double(weight))

    @property
    def square(self) -> float:
        return float(self.library.hsep_gram_square(self._block))


class CSolution:
    """Weights of the first features with penalties, as hsep_experts.c solves for them.

    Parameters
    ----------
    gram : CGram
        Its rows, settled.
    penalties : (m,) array
        Of its first ``m`` features; where these are all, the second half of them is the head, else there is none.
    other, weight : CGram and float, optional
        Rows that are added with a weight, settled.
    later : (k, m + 1) array, optional
        Rows ``[φ | target]`` that come once the solution has begun.
    amounts : list of float
        Multiply-adds that are spent before each of them; what is left is done in the end.
    completed : bool
        Whether the factor is completed before the last of them.
    apart : bool
        Whether the last of them stays behind the factor.
    """

    def __init__(
        self,
        gram: CGram,
        penalties: Array,
        other: CGram | None = None,
        weight: float = 1.0,
        later: Array | None = None,
        amounts: list[float] | None = None,
        completed: bool = False,
        apart: bool = True,
    ) -> None:
        self.library, m = gram.library, len(penalties)
        n_head = m - m // 2 if m == gram.n else 0
        later = np.empty((0, m + 1)) if later is None else np.ascontiguousarray(later)
        sizes = [ctypes.c_uint64(n) for n in (n_head, m - n_head, len(later) + TOGETHER)]
        self.library.hsep_solution_size.restype = self.library.hsep_solution_finish.restype = ctypes.c_double
        self.library.hsep_solution_left.restype = ctypes.c_double
        self.block = np.full(int(self.library.hsep_solution_size(*sizes)) // 8, np.nan)
        self.library.hsep_solution_init(self._block, *sizes)
        self.n_head, self.m = n_head, m
        self._part("penalties", m)[:] = penalties
        if other is not None:
            other.settle()
        added = None if other is None else other._block
        self.library.hsep_solution_begin(self._block, gram._block, added, ctypes.c_double(weight))
        self.lefts = [self.left(len(later))]
        for i, row in enumerate(later):
            if completed and i + 1 == len(later):
                self.complete()
            self.add(row[None])
            if amounts is not None:
                self.library.hsep_solution_advance(self._block, ctypes.c_double(amounts[i]), ctypes.c_int(i % 2))
                self.lefts.append(self.left(len(later) - 1 - i))
        self.finish(apart=apart)

    def add(self, rows: Array) -> None:
        """Take rows ``[φ | target]``."""
        for row in np.ascontiguousarray(rows):
            self.library.hsep_solution_row(self._block, pointer(row), ctypes.c_double(row[-1]))

    def finish(self, penalties: Array | None = None, apart: bool = True) -> None:
        """Solve for the weights, with other penalties of the tail if there are."""
        if penalties is not None:
            self._part("penalties", len(penalties))[:] = penalties
        self.residual_sum = self.library.hsep_solution_finish(self._block, ctypes.c_int(apart))

    def left(self, to_come: int = 0) -> float:
        return float(self.library.hsep_solution_left(self._block, ctypes.c_uint64(to_come), ctypes.c_int(0)))

    @property
    def waiting(self) -> int:
        return int(self.block.view(np.uint64)[WORDS.index("waiting")])

    def complete(self) -> None:
        """Complete the factor, before the last row."""
        self.library.hsep_solution_complete(self._block)

    @property
    def valid(self) -> bool:
        sizes = [ctypes.c_uint64(int(word)) for word in self.block[:3].view(np.uint64)]
        return bool(self.library.hsep_solution_valid(self._block, *sizes))

    @property
    def _block(self) -> Any:
        return pointer(self.block)

    def _part(self, name: str, count: int) -> Array:
        place = int(self.block.view(np.uint64)[len(WORDS) + OFFSETS.index(name)])
        return self.block[place : place + count]

    @property
    def weights(self) -> Array:
        return self._part("weights", self.m)

    def leverage(self, rows: Array) -> Array:
        found, in_order = [], np.hstack((rows[:, self.m - self.n_head :][:, ::-1], rows[:, : self.m - self.n_head]))
        for first in range(0, len(rows), ABREAST):
            some = in_order[first : first + ABREAST]
            places = self._part("work", ABREAST * (self.m + 1)).reshape(ABREAST, self.m + 1)
            places[: len(some), : self.m] = some
            leverages = np.full(ABREAST, np.nan)
            count = ctypes.c_uint64(len(some))
            self.library.hsep_solution_leverages(self._block, count, pointer(leverages))
            found += leverages[: len(some)].tolist()
        return np.array(found)
