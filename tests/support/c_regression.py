"""The C core's regression through ctypes."""

from __future__ import annotations

import ctypes
from typing import Any

import c_core
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class CRegression:
    """hsep_regression."""

    def __init__(self, n: int, lam: float) -> None:
        self.library, self.n = c_core.library("predictor"), n
        self.block = np.zeros(int(self.library.hsep_regression_size(ctypes.c_uint64(n))) // 8)
        self.library.hsep_regression_init(self._block, ctypes.c_uint64(n), ctypes.c_double(lam))

    @property
    def _block(self) -> Any:
        return self.block.ctypes.data_as(ctypes.c_void_p)

    def fold(self, rows: Array, target: Array, repetitions: int = 1) -> None:
        stacked = np.ascontiguousarray(np.column_stack((rows, target)))
        pointer = stacked.ctypes.data_as(ctypes.c_void_p)
        self.library.test_fold(self._block, pointer, ctypes.c_size_t(len(rows)), ctypes.c_size_t(repetitions))

    def load(self, i: int, row: Array) -> int:
        place = self.library.hsep_regression_row(self._block)
        for j, value in enumerate(row.tolist()):
            place[j] = value
        done: int = self.library.hsep_regression_load(self._block, ctypes.c_uint64(i))
        return done

    @property
    def weights(self) -> Array:
        w = np.empty(self.n)
        self.library.hsep_regression_solve(self._block, w.ctypes.data_as(ctypes.c_void_p))
        return w

    @property
    def residual_sum(self) -> float:
        return float(self.block[3])

    @property
    def n_rows(self) -> float:
        return float(self.block[2])
