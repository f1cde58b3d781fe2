"""Recursive ridge regression carried as a triangular factor, eq. (6).

``w(j) = argmin_w Σ_{k < j·Np} [e_pb(k) − wᵀφ(k)]² + λ‖w‖²``

Neighbouring lags of a smooth position are nearly collinear: the condition number of Φ is 1e6 to 1e12, that of the
normal equations its square, and the textbook covariance update loses the weights or reaches NaN. Here the QR factor of
all rows so far, ``[√λ·I; Φ] = Q R``, is updated by each block of rows (Golub and Van Loan, *Matrix Computations*, 4th
ed., section 6.5) with LAPACK's ``dtpqrt``: exact, of constant cost and of constant size.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import lapack

from ..base.errors import ParameterError, SignalError
from ..base.settings import check
from ..base.signals import Array, as_samples

__all__ = ["PenalisedSolution", "RidgeRegression", "fold"]

_COLUMNS_AT_ONCE = 8
"""Block size of dtpqrt, the fastest one measured for 50 to 200 features."""


_LEAST_DIAGONAL = 1e-150
"""Bound on the factor's diagonal: its square is a normal number."""


def fold(factor: Array, rows: Array, *, n_triangular: int = 0) -> None:
    """Fold rows into an upper triangle in place: ``Q R = [R; rows]``.

    Parameters
    ----------
    factor : (n, n) array, column-major
        ``R``, below whose diagonal nothing is read or written.
    rows : (m, n) array, column-major
        Used as work space.
    n_triangular : int
        Number of last rows that are upper trapezoidal themselves, which saves the work on their zeros.
    """
    block = min(_COLUMNS_AT_ONCE, factor.shape[1])
    _, _, _, info = lapack.dtpqrt(n_triangular, block, factor, rows, overwrite_a=1, overwrite_b=1)
    if info != 0:  # an illegal argument, a fault of this module
        raise AssertionError(f"dtpqrt returned info = {info}")


class PenalisedSolution(NamedTuple):
    """Weights of some features under penalties of their own.

    Attributes
    ----------
    weights : (m,) array
    triangle : (m, m) array
        ``R`` with ``RᵀR = ΦᵀΦ + diag(penalties)``.
    residual_sum : float
        ``Σ (target − wᵀφ)² + λ‖w‖²`` over the rows so far, without the penalties.
    """

    weights: Array
    triangle: Array
    residual_sum: float

    def leverage(self, rows: Array) -> Array:
        """Return ``φᵀ(RᵀR)⁻¹φ`` of rows φ, ``(k, m)``: the variance of ``wᵀφ`` relative to that of the noise."""
        solved, _ = lapack.dtrtrs(self.triangle, rows.T, trans=1)
        return np.asarray(np.einsum("ij,ij->j", solved, solved))


class RidgeRegression:
    """Recursive ridge regression; eq. (6).

    Parameters
    ----------
    n_features : int
        Length ``n`` of a row φ.
    lam : float
        Ridge penalty λ > 0 on ‖w‖², in the unit of a row's entry squared (m² here).

    Raises
    ------
    ParameterError
        If ``n_features < 1`` or ``lam ≤ 0``.
    """

    def __init__(self, n_features: int, lam: float) -> None:
        if n_features < 1:
            raise ParameterError(f"n_features must be ≥ 1, got {n_features}")
        self.n_features = n_features
        self.lam = check("lambda", lam)
        self.n_samples = 0
        # [R z; 0 ρ]: the factor of the rows [Φ | e_pb], with √λ·I as its first value.
        self._factor = np.zeros((n_features + 1, n_features + 1), order="F")
        np.fill_diagonal(self._factor[:-1, :-1], math.sqrt(self.lam))
        self._weights: Array | None = None

    @property
    def factor(self) -> Array:
        """A copy of the triangular factor ``[R z; 0 ρ]`` of the rows ``[Φ | target]``, ``(n+1, n+1)``."""
        return np.triu(self._factor)

    @property
    def weights(self) -> Array:
        """``w = R⁻¹ z``, ``(n,)``, read-only; solved on first access after an update."""
        if self._weights is None:
            n = self.n_features
            self._weights, _ = lapack.dtrtrs(self._factor[:n, :n], self._factor[:n, n])
            self._weights.flags.writeable = False
        return self._weights

    @property
    def residual_sum(self) -> float:
        """``Σ (target − wᵀφ)² + λ‖w‖²`` at the optimum, m²."""
        return float(self._factor[-1, -1] ** 2)

    @property
    def target_square(self) -> float:
        """Sum of the squares of the targets, m²."""
        column = self._factor[:, -1]
        return float(column @ column)

    def update(self, rows: ArrayLike, target: ArrayLike) -> None:
        """Update with a block of rows.

        Parameters
        ----------
        rows : (m, n) array_like
            Features φ, one row per sample.
        target : (m,) array_like
            Regressand, approximated by ``wᵀφ``.

        Raises
        ------
        SignalError
            If the shapes do not fit or a value is not finite; the regression is unchanged then.
        """
        phi = np.asarray(rows, dtype=np.float64)
        if phi.ndim != 2 or phi.shape[1] != self.n_features:
            raise SignalError(f"rows must have shape (m, {self.n_features}), got {phi.shape}")
        values = as_samples(target, "target", len(phi))
        if not np.isfinite(phi).all():
            raise SignalError("rows must be finite")
        stacked = np.empty((len(phi), self.n_features + 1), order="F")
        stacked[:, :-1] = phi
        stacked[:, -1] = values
        self.update_stacked(stacked)

    def update_stacked(self, stacked: Array) -> None:
        """Update with rows ``[Φ | target]`` that are known to be finite; they are overwritten.

        Parameters
        ----------
        stacked : (m, n + 1) array, column-major
            Used as work space.
        """
        fold(self._factor, stacked)
        self.n_samples += len(stacked)
        self._weights = None

    def update_from(self, other: RidgeRegression) -> None:
        """Update with all rows of another regression of the same features, its penalty with them."""
        rows = np.asfortranarray(other.factor)
        fold(self._factor, rows, n_triangular=len(rows))
        self.n_samples += other.n_samples
        self._weights = None

    def discount(self, weight: float) -> None:
        """Weigh all rows so far by ``weight``, 0 ≤ weight ≤ 1, in the sum of squares; λ with them.

        The factor stays regular, however long a feature is 0.
        """
        self._factor *= math.sqrt(weight)
        diagonal = np.einsum("ii->i", self._factor)[:-1]
        diagonal[np.abs(diagonal) < _LEAST_DIAGONAL] = _LEAST_DIAGONAL
        self._weights = None

    def penalised(self, penalties: Array) -> PenalisedSolution:
        """Solve for the weights of the first ``m`` features, each with a penalty of its own.

        They minimise ``Σ (target − wᵀφ)² + Σ_i penalties_i w_i²`` over the rows so far: the triangle of all features
        holds that of the first ones, so a QR update with ``m`` rows of penalties suffices.

        Parameters
        ----------
        penalties : (m,) array
            Positive, ``1 ≤ m ≤ n_features``; they add to λ.
        """
        n, m = self.n_features, len(penalties)
        factor = np.zeros((m + 1, m + 1), order="F")
        factor[:m, :m], factor[:m, m] = self._factor[:m, :m], self._factor[:m, n]
        rows = np.zeros((m, m + 1), order="F")
        np.fill_diagonal(rows, np.sqrt(penalties))
        fold(factor, rows)
        triangle = factor[:m, :m]
        weights, _ = lapack.dtrtrs(triangle, factor[:m, m])
        residuals = self._factor[:, n].copy()
        residuals[:m] -= self._factor[:m, :m] @ weights
        return PenalisedSolution(weights, triangle, float(residuals @ residuals))

    def restore(self, factor: Array, n_samples: int) -> None:
        """Restore a :attr:`factor` and its number of rows.

        Raises
        ------
        SignalError
            If the factor has another size, is not finite or singular; nothing is changed then.
        """
        if factor.shape != self._factor.shape:
            raise SignalError(f"the factor must have shape {self._factor.shape}, got {factor.shape}")
        if not (np.isfinite(factor).all() and np.diag(factor)[:-1].all()):
            raise SignalError("the factor must be finite, with no 0 on its diagonal")
        self._factor = np.array(np.triu(factor), dtype=np.float64, order="F")
        self.n_samples = int(n_samples)
        self._weights = None
