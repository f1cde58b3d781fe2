"""Recursive ridge regression carried as a triangular factor, eq. (6).

``w(j) = argmin_w Σ_{k < j·Np} [e_pb(k) − wᵀφ(k)]² + λ‖w‖²``

Neighbouring lags of a smooth position are nearly collinear: the condition number of Φ is 1e6 to 1e12, the normal
equations have its square, and the textbook covariance update loses the weights or reaches NaN. Here the QR factor of
all rows so far, ``[√λ·I; Φ] = Q R``, is updated by each block of rows (Golub and Van Loan, *Matrix Computations*, 4th
ed., section 6.5) with LAPACK's ``dtpqrt``: exact, of constant cost and of constant size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from ..base.errors import ParameterError
from ..base.settings import check
from ..base.signals import Array

_COLUMNS_AT_ONCE = 8  # block size of dtpqrt, the fastest one measured for 50 to 200 features
_LEAST_DIAGONAL = 1e-150  # bound on the factor's diagonal: its square is a normal number


def lags(series: Array, n: int) -> Array:
    """Return ``n`` values up to each sample, newest first, ``(len(series) − n + 1, n)``."""
    series = np.ascontiguousarray(series)  # so made, not by sliding_window_view, in a fiftieth of the time
    shape, step = (len(series) - n + 1, n), series.itemsize
    rows: Array = np.ndarray(shape, series.dtype, series, (n - 1) * step, (step, -step))
    return rows


def _folded(factor: Array, rows: Array, n_triangular: int = 0) -> Array:
    """Return the upper triangle ``R'`` of ``Q R' = [R; rows]``.

    ``factor``, (n, n), column-major: ``R``; ``rows``, (m, n); ``n_triangular``: number of last rows that are upper
    trapezoidal themselves, which saves the work on their zeros.
    """
    return np.asarray(lapack.dtpqrt(n_triangular, min(_COLUMNS_AT_ONCE, rows.shape[1]), factor, rows)[0])


class PenalisedSolution(NamedTuple):
    """Weights of some features under penalties of their own."""

    weights: Array  # (m,)
    triangle: Array  # (m, m): ``R`` with ``RᵀR = ΦᵀΦ + diag(penalties)``
    residual_sum: (
        float  # ``Σ (target − wᵀφ)² + λ‖w‖²`` over the rows so far, λ the factor's, without the penalties here
    )

    def leverage(self, rows: Array) -> Array:
        """Return ``φᵀ(RᵀR)⁻¹φ`` of rows φ, ``(k, m)``: the variance of ``wᵀφ`` relative to the noise's."""
        solved, _ = lapack.dtrtrs(self.triangle, rows.T, trans=1)
        return np.asarray(np.einsum("ij,ij->j", solved, solved))


@dataclass(frozen=True, eq=False)
class RidgeRegression:
    """Recursive ridge regression; eq. (6)."""

    # (n + 1, n + 1), column-major: upper triangle ``[R z; 0 ρ]`` of the rows ``[Φ | target]``, with ``√λ·I`` as its
    # first value
    factor: Array
    n_rows: float  # rows so far, weighted

    @classmethod
    def init(cls, n_features: int, lam: float) -> RidgeRegression:
        """Return the regression without rows.

        ``n_features``: length ``n`` of a row φ; ``lam``: ridge penalty λ > 0 on ‖w‖², in the unit of a row's entry
        squared (m² here). ParameterError if ``n_features < 1`` or ``lam ≤ 0``.
        """
        if n_features < 1:
            raise ParameterError(f"n_features must be ≥ 1, got {n_features}")
        factor = np.zeros((n_features + 1, n_features + 1), order="F")
        np.fill_diagonal(factor[:-1, :-1], math.sqrt(check("lambda", lam)))
        return cls(factor, 0.0)

    @property
    def n_features(self) -> int:
        """Length of a row φ."""
        return len(self.factor) - 1

    @cached_property
    def weights(self) -> Array:
        """``w = R⁻¹ z``, ``(n,)``, read-only."""
        weights, _ = lapack.dtrtrs(self.factor[:-1, :-1], self.factor[:-1, -1])
        weights.flags.writeable = False
        return np.asarray(weights)

    @property
    def target_square(self) -> float:
        """Sum of the squares of the targets, m²."""
        column = self.factor[:, -1]
        return float(column @ column)

    def update(self, *columns: Array) -> RidgeRegression:
        """Return the regression with a block of rows φ, one or more ``(m, …)``, and their targets, ``(m,)``, more."""
        return RidgeRegression(_folded(self.factor, np.column_stack(columns)), self.n_rows + len(columns[-1]))

    def add(self, other: RidgeRegression) -> RidgeRegression:
        """Return the regression with all rows of another one of the same features, its penalty with them."""
        return RidgeRegression(_folded(self.factor, other.factor, len(other.factor)), self.n_rows + other.n_rows)

    def discount(self, weight: float) -> RidgeRegression:
        """Return the regression with all rows weighed by ``weight``, 0 ≤ weight ≤ 1, in the sum of squares; λ, too.

        The factor stays regular, however long a feature is 0.
        """
        if weight == 1.0:
            return self
        factor = math.sqrt(weight) * self.factor
        diagonal = np.einsum("ii->i", factor)[:-1]
        diagonal[np.abs(diagonal) < _LEAST_DIAGONAL] = _LEAST_DIAGONAL
        return RidgeRegression(factor, weight * self.n_rows)

    def penalised(self, penalties: Array) -> PenalisedSolution:
        """Solve for the weights of the first ``m`` features, each with a penalty of its own.

        They minimise ``Σ (target − wᵀφ)² + Σ_i penalties_i w_i²`` over the rows so far: the triangle of all features
        holds the triangle of the first ones, so a QR update with ``m`` rows of penalties suffices.

        ``penalties``, (m,): positive, ``1 ≤ m ≤ n_features``; they add to λ.
        """
        m, target = len(penalties), self.factor[:, -1]
        factor, rows = np.zeros((m + 1, m + 1), order="F"), np.zeros((m, m + 1), order="F")
        factor[:m, :m], factor[:m, m] = self.factor[:m, :m], target[:m]
        np.fill_diagonal(rows, np.sqrt(penalties))
        solved = _folded(factor, rows)
        triangle = solved[:m, :m]
        weights, _ = lapack.dtrtrs(triangle, solved[:m, m])
        residuals = target.copy()
        residuals[:m] -= self.factor[:m, :m] @ weights
        return PenalisedSolution(weights, triangle, float(residuals @ residuals))
