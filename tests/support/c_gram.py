"""The C core's Gram matrix through ctypes."""

from __future__ import annotations

import ctypes
from typing import Any

import c_core
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ABREAST = 4
"""HSEP_GRAM_ABREAST."""


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
    """Weights of the first features with penalties, as hsep_expert.c solves for them."""

    def __init__(self, gram: CGram, penalties: Array, other: CGram | None = None, weight: float = 1.0) -> None:
        self.library, m = gram.library, len(penalties)
        self.weights, self.factor = np.empty(m), np.full((m + 1) * (m + 2) // 2, np.nan)
        self.library.hsep_gram_solve.restype = ctypes.c_double
        self.residual_sum = self.library.hsep_gram_solve(
            gram._block,
            None if other is None else other._block,
            ctypes.c_double(weight),
            pointer(penalties),
            ctypes.c_uint64(m),
            pointer(self.factor),
            pointer(np.full(m + 1, np.nan)),
            pointer(self.weights),
        )

    def leverage(self, rows: Array) -> Array:
        found = []
        for first in range(0, len(rows), ABREAST):
            some = rows[first : first + ABREAST]
            side_by_side = np.ascontiguousarray(np.vstack((some, np.zeros((ABREAST - len(some), rows.shape[1])))).T)
            leverages = np.full(ABREAST, np.nan)
            self.library.hsep_gram_leverages(
                pointer(self.factor), ctypes.c_uint64(rows.shape[1]), pointer(side_by_side), pointer(leverages)
            )
            found += leverages[: len(some)].tolist()
        return np.array(found)
