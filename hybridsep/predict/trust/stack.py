"""Stack of experts: the convex sum of their predictions that would have erred least so far."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ...base.signals import Array
from .constants import TrustConstants

__all__ = ["Stack", "simplex_minimum"]

_LEAST_SQUARE = 1e-300
"""Mean square, m², that counts as 0."""


class Stack:
    """Weights ``π ≥ 0``, ``Σπ ≤ 1`` of experts; the remainder is the prediction 0, the physics model's.

    ``π = argmin ‖e − F π‖² + κ s² n ‖π − π₀‖²`` over the windows so far, their evidence fading by ``γ`` a window, with
    the mean square ``s²`` of the best expert and ``n`` samples of a window: without evidence ``π = π₀``.

    Parameters
    ----------
    first : sequence of float
        ``π₀``.
    constants : TrustConstants

    Attributes
    ----------
    weights : (n_experts,) array
        ``π``.
    gram, cross : (n_experts, n_experts) and (n_experts,) array, m²
        ``FᵀF`` and ``Fᵀe`` so far.
    evidence : (2,) array
        ``eᵀe`` so far, m², and samples.
    """

    def __init__(self, first: tuple[float, ...], constants: TrustConstants) -> None:
        self.first, self.constants = np.array(first), constants
        self.restart()

    def restart(self) -> None:
        """Begin without evidence."""
        n = len(self.first)
        self.weights, self.gram, self.cross = self.first.copy(), np.zeros((n, n)), np.zeros(n)
        self.evidence = np.zeros(2)

    def update(self, predicted: Array, measured: Array, least: float) -> None:
        """Update the weights with a measured window.

        Parameters
        ----------
        predicted : (n_experts, n) array, m
            Predictions made before the window was measured.
        measured : (n,) array, m
        least : float, m²
            Least mean square that errors are judged by.
        """
        gamma, n = self.constants.gamma, len(measured)
        self.gram = gamma * self.gram + predicted @ predicted.T
        self.cross = gamma * self.cross + predicted @ measured
        self.evidence = gamma * self.evidence + np.array([measured @ measured, n])
        total, rows = self.evidence.tolist()
        errors = total - 2.0 * self.cross + np.diag(self.gram)
        best = max(min(float(errors.min()), total) / rows, least, _LEAST_SQUARE)
        ridge = self.constants.kappa * best * n
        self.weights = simplex_minimum(self.gram + ridge * np.eye(len(self.first)), self.cross + ridge * self.first)

    def copy(self, expert: int, to: int) -> None:
        """Give an expert the evidence of another, as if it had predicted the same so far."""
        order = np.arange(len(self.first))
        order[to] = expert
        self.gram, self.cross = self.gram[np.ix_(order, order)], self.cross[order]

    def forget(self, expert: int) -> None:
        """Forget an expert that predicts no more."""
        self.gram[expert], self.gram[:, expert], self.cross[expert], self.weights[expert] = 0.0, 0.0, 0.0, 0.0


def simplex_minimum(hessian: Array, linear: Array) -> Array:
    """Return the ``π ≥ 0``, ``Σπ ≤ 1`` that minimises ``½ πᵀHπ − lᵀπ``, ``(n,)``, by its active set.

    Parameters
    ----------
    hessian : (n, n) array
        Positive definite; ``n`` is small: ``2ⁿ`` sets are tried.
    linear : (n,) array
    """
    n = len(linear)
    best, least = np.zeros(n), 0.0
    for size in range(1, n + 1):
        supports = np.array(list(combinations(range(n), size)))
        H, free = hessian[supports[:, :, None], supports[:, None, :]], linear[supports]
        inverse = _solved(H, np.stack((free, np.ones_like(free)), axis=-1))
        found, of_ones = inverse[..., 0], inverse[..., 1]
        excess = found.sum(axis=-1) - 1.0
        active = excess > 0.0  # then Σπ = 1
        found[active] -= (excess / of_ones.sum(axis=-1))[active, None] * of_ones[active]
        cost = 0.5 * np.einsum("si,sij,sj->s", found, H, found) - np.einsum("si,si->s", free, found)
        cost[~(found >= 0.0).all(axis=-1)] = np.inf
        first = int(cost.argmin())
        if cost[first] < least:
            best, least = np.zeros(n), float(cost[first])
            best[supports[first]] = found[first]
    return best


def _solved(H: Array, right: Array) -> Array:
    """Solve systems side by side, ``(m, k, k)`` and ``(m, k, 2)``; one that is singular gives NaN."""
    try:
        return np.asarray(np.linalg.solve(H, right))
    except np.linalg.LinAlgError:  # of one system, but for all
        if len(H) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([_solved(H[i : i + 1], right[i : i + 1]) for i in range(len(H))])
