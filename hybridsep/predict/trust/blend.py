"""Convex blend of candidate predictions, weighted by their errors in the windows so far."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from ...base.signals import Array

__all__ = ["Blend", "simplex_minimum"]

_MEMORY_LEAST, _MEMORY = 0.7, 0.97
"""Bounds on the factor by which evidence fades from window to window."""

_OUTDATED = 1.5
"""What that factor falls short of 1, times the windows learned from: how far a candidate erred when it knew little says
little of what it knows now."""

_CONFIDENCE = 0.3
"""Evidence that the first weights count for, in windows of the largest mean square error."""

_EARLY = 3.0
"""Windows learned from which on that evidence falls as their inverse: the candidates' own errors are far smaller then,
and what tells them apart must not drown in it."""

_EXPERIENCED = 15.0
"""Windows learned after which the weights without evidence are halfway from the first to the later ones."""


class Blend:
    """Weights ``π ≥ 0``, ``Σπ ≤ 1`` of candidates; the rest is the prediction 0, the physics model's.

    They minimise the squared error of the blend over the windows so far, forgotten as more was learned, with a ridge
    about what they are without evidence, that fades.

    Parameters
    ----------
    first, later : sequence of float
        Weights without evidence, before anything is learned and when much is.
    Np : int
        Samples of a usual window.
    """

    def __init__(self, first: tuple[float, ...], later: tuple[float, ...], Np: int) -> None:
        self.first, self.later, self.Np = np.array(first), np.array(later), Np
        n = len(first)
        self.gram, self.cross = np.zeros((n, n)), np.zeros(n)
        self.weights = self.first.copy()

    def update(self, candidates: Array, target: Array, scale: float, n_rows: float) -> None:
        """Update the weights with a measured window.

        Parameters
        ----------
        candidates : (n_candidates, n) array, m
            Predictions made before the window was measured.
        target : (n,) array, m
            What was measured.
        scale : float
            Largest mean square of a measured window, m².
        n_rows : float
            Rows learned so far.
        """
        n_windows = n_rows / self.Np
        memory = min(max(1.0 - _OUTDATED / max(n_windows, 1.0), _MEMORY_LEAST), _MEMORY)
        self.gram = memory * self.gram + candidates @ candidates.T
        self.cross = memory * self.cross + candidates @ target
        ridge = _CONFIDENCE * scale * self.Np / max(n_windows / _EARLY, 1.0)
        if ridge > 0.0:
            without = self.first + n_windows / (n_windows + _EXPERIENCED) * (self.later - self.first)
            hessian = self.gram + ridge * np.eye(len(self.first))
            self.weights = simplex_minimum(hessian, self.cross + ridge * without)


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
        for support in combinations(range(n), size):
            H, free = hessian[np.ix_(support, support)], linear[list(support)]
            try:
                inverse = np.linalg.solve(H, np.column_stack((free, np.ones(size))))
            except np.linalg.LinAlgError:  # singular: a smaller set does as well
                continue
            found = inverse[:, 0]
            if found.sum() > 1.0:  # then Σπ = 1 is active
                found = found - (found.sum() - 1.0) / inverse[:, 1].sum() * inverse[:, 1]
            cost = float(0.5 * found @ H @ found - free @ found)
            if (found >= 0.0).all() and cost < least:
                best, least = np.zeros(n), cost
                best[list(support)] = found
    return best
