"""The change of the command as a sum of cubic B-splines, and what a plan of them costs.

``δ(k) = Σ_j c_j B(k/spacing − j)`` on a uniform knot grid that runs on from window to window. ``B`` is non-zero over
four knot intervals, so the three splines that began before a plan still act in it, with coefficients that are already
decided. The last spline ends four samples before the plan does: what follows the plan is ``x_d`` itself, in position
and in its first three differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from ..base.signals import Array

__all__ = ["N_DECIDED", "PlanCost", "SplineBasis", "direct_samples"]

N_DECIDED = 3
"""Cubic splines that began before a plan and still act in it."""

_END = 3
"""Samples at the end of a plan that stay without change, for the third difference."""


@dataclass(frozen=True)
class PlanCost:
    """``½ cᵀ P c − vᵀ c``, half the plan's sum of squares but for a constant.

    Attributes
    ----------
    P : (n, n) array
    v : (n,) array, m
    """

    P: Array
    v: Array


class SplineBasis:
    """Splines of one plan.

    Parameters
    ----------
    preview : int
        Samples of the plan.
    spacing : int
        Samples between knots.
    """

    def __init__(self, preview: int, spacing: int) -> None:
        width = 4 * spacing
        self.preview, self.spacing = preview, spacing
        self.n_free = (preview - width - _END) // spacing + 1
        spline = np.asarray(BSpline.basis_element(np.arange(5))(np.arange(width) / spacing))
        # Splines at −3, −2, −1 spacings, of which the plan sees the rest, and the free ones
        tails = [_padded(spline[i * spacing :], preview) for i in (3, 2, 1)]
        self._spline = _padded(spline, preview)
        self.values: Array = np.column_stack((*tails, _shifts(self._spline, self.n_free, spacing)))
        extended = np.concatenate((np.zeros((3, self.values.shape[1])), self.values))
        # Differences over the plan; the three samples before it enter by `before`
        self.third: Array = np.diff(extended, 3, axis=0)

    def filtered(self, g: Array) -> Array:
        """Return the free splines behind the filter with impulse response ``g``, ``(preview, n_free)``."""
        # Linear and time-invariant: one spline is filtered, the others are its shifts.
        return _shifts(np.asarray(lfilter(g, [1.0], self._spline)), self.n_free, self.spacing)

    def cost(
        self, g: Array, free: Array, x_d: Array, decided: Array, before: Array, jerk_weight: float, ridge: float = 1e-12
    ) -> PlanCost:
        """Return ``‖x_d − G (x_d + δ) − free‖² + jerk_weight·‖D³ δ‖²`` over the free coefficients.

        Parameters
        ----------
        g, free : (preview,) arrays
            First column of ``G``, and the free response, m; eq. (3).
        x_d : (preview,) array, m
            Commanded positions.
        decided : (3,) array, m
            Coefficients that are already decided.
        before : (3,) array, m
            The last three values of δ.
        jerk_weight : float
            Weight of the third differences.
        ridge : float
            Added to the diagonal, relative to its largest entry.
        """
        delta = self.values[:, :N_DECIDED] @ decided
        # Eq. (3) with what cannot be changed any more: x_d − G (x_d + δ_decided) − free
        target = x_d - free - np.asarray(lfilter(g, [1.0], x_d + delta))
        third_decided = np.diff(np.concatenate((before, delta)), 3)
        W, D = self.filtered(g), self.third[:, N_DECIDED:]
        P = W.T @ W + jerk_weight * (D.T @ D)
        P[np.diag_indices_from(P)] += ridge * np.max(np.diag(P))
        return PlanCost(P, W.T @ target - jerk_weight * (D.T @ third_decided))


def direct_samples(g: ArrayLike, free: ArrayLike, x_d: ArrayLike, before: ArrayLike, jerk_weight: float) -> Array:
    """Return the best change δ with every sample free: the form that splines of small spacing approach.

    The minimum of ``‖x_d − G (x_d + δ) − free‖² + jerk_weight·‖D³ δ‖²`` by least squares on the full matrices.

    Parameters
    ----------
    g, free, x_d : (n,) array_like
        First column of ``G``, free response and commanded positions, as in eq. (3).
    before : (3,) array_like, m
        The last three values of δ.
    jerk_weight : float
        Weight of the third differences, > 0.

    Returns
    -------
    delta : (n,) array, m
    """
    column, command = np.asarray(g, dtype=np.float64), np.asarray(x_d, dtype=np.float64)
    n = len(command)
    G = toeplitz(column, np.zeros(n))
    third = np.diff(np.eye(n + 3), 3, axis=0)
    weight = np.sqrt(jerk_weight)
    A = np.concatenate((G, weight * third[:, 3:]))
    b = np.concatenate((command - G @ command - np.asarray(free), -weight * (third[:, :3] @ np.asarray(before))))
    delta, *_ = np.linalg.lstsq(A, b, rcond=None)
    return np.asarray(delta)


def _padded(samples: Array, n: int) -> Array:
    return np.concatenate((samples, np.zeros(n - len(samples))))


def _shifts(samples: Array, n: int, spacing: int) -> Array:
    """Return ``samples`` delayed by 0, spacing, 2·spacing … as ``n`` columns of the same length."""
    length = len(samples)
    windows = sliding_window_view(np.concatenate((np.zeros(length), samples)), length)
    return np.ascontiguousarray(windows[length - spacing * np.arange(n)].T)
