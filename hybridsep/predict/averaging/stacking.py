"""Stack of experts: the convex sum of their predictions that would have erred least so far."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...base.signals import Array, Indices
from .constants import CONSTANTS
from .experts import ARX_COMMAND, ARX_RESIDUAL, EXPERTS, RECALL, STATIC, Expert, Regression

_LEAST_SQUARE = 1e-300  # mean square, m², that counts as 0

_ROUNDING = 1e-6  # what rounding may have added to the sum of the weights


@dataclass(frozen=True, eq=False)
class Stack:
    """Weights ``π ≥ 0``, ``Σπ ≤ 1`` of experts; the remainder is the prediction 0, the physics model's.

    ``π = argmin ‖e − F π‖² + κ s² n ‖π − π₀‖²`` over the windows so far, their evidence fading by ``γ`` a window, at
    first faster, as experts learn, with the mean square ``s²`` of the best expert and ``n`` samples of a window:
    without evidence ``π = π₀``. In the stack of plans ``π₀`` are the weights of the other one, and ``κ`` is larger.
    """

    weights: Array  # (n_experts,): ``π``
    # (n_experts, n_experts) and (n_experts,), m²: ``FᵀF`` and ``Fᵀe`` so far
    gram: Array
    cross: Array
    evidence: Array  # (2,): ``eᵀe`` so far, m², and samples

    @classmethod
    def init(cls) -> "Stack":
        """Return the stack without evidence."""
        n = len(EXPERTS)
        return cls(_first_weights(), np.zeros((n, n)), np.zeros(n), np.zeros(2))

    def update(self, predicted: Array, measured: Array, least: float, like: Array | None = None) -> "Stack":
        """Return the stack with a measured window more.

        ``predicted``, (n_experts, n), m: predictions made before the window was measured; ``measured``, (n,), m;
        ``least``, m²: least mean square that errors are judged by; ``like``, (n_experts,): weights of the stack of
        predictions, if it is that of plans.
        """
        prior, kappa = (_first_weights(), CONSTANTS.kappa) if like is None else (like, CONSTANTS.kappa_of_plans)
        n, before = len(measured), float(self.evidence[1])
        gamma = min(CONSTANTS.gamma, max(before - CONSTANTS.renewal * n, 0.0) / max(before, n))
        gram = gamma * self.gram + predicted @ predicted.T
        cross = gamma * self.cross + predicted @ measured
        total, rows = evidence = gamma * self.evidence + np.array([measured @ measured, n])
        least_sum = float(np.min(total - 2.0 * cross + gram.diagonal(), initial=total))
        ridge = kappa * max(least_sum / rows, least, _LEAST_SQUARE) * n
        hessian, linear = gram + ridge * np.eye(len(EXPERTS)), cross + ridge * prior
        return Stack(simplex_minimum(hessian, linear, self.weights > 0.0), gram, cross, evidence)

    def others(self) -> Array:
        """Return the weights of all experts but RECALL, with its weight shared among them and physics."""
        left = 1.0 - self.weights[RECALL.place]
        others = self.weights / left if left > _ROUNDING else _first_weights()
        others[RECALL.place] = 0.0
        return others

    @property
    def leader(self) -> Regression:
        """ARX_COMMAND, if it has more of the weights than ARX_RESIDUAL and STATIC together, else ARX_RESIDUAL."""
        of_residual = self.weights[ARX_RESIDUAL.place] + self.weights[STATIC.place]
        return ARX_COMMAND if self.weights[ARX_COMMAND.place] > of_residual else ARX_RESIDUAL

    def copy(self, expert: Expert, to: Expert) -> "Stack":
        """Return the stack with the evidence of an expert given to another, as if it had predicted the same so far."""
        order = np.arange(len(self.weights))
        order[to.place] = expert.place
        return replace(self, gram=self.gram[np.ix_(order, order)], cross=self.cross[order])

    def forget(self, expert: Expert) -> "Stack":
        """Return the stack without an expert that predicts no more."""
        others = np.arange(len(self.weights)) != expert.place
        gram = np.where(others[:, None] & others, self.gram, 0.0)
        return Stack(np.where(others, self.weights, 0.0), gram, np.where(others, self.cross, 0.0), self.evidence)


def _first_weights() -> Array:
    """Return the weights without evidence, ``π₀``."""
    return np.array([one.first_weight for one in EXPERTS])


def simplex_minimum(hessian: Array, linear: Array, likely: NDArray[np.bool_] | None = None) -> Array:
    """Return the ``π ≥ 0``, ``Σπ ≤ 1`` that minimises ``½ πᵀHπ − lᵀπ``, ``(n,)``, by its active set.

    ``hessian``, (n, n): positive definite; ``linear``, (n,); ``likely``, (n,): set that is tried first. ``n`` is small:
    if that one does not meet the optimality conditions, all ``2ⁿ`` are tried.
    """
    able = (linear > 0.0) | (hessian < 0.0).any(axis=1)  # the others weigh nothing
    if likely is not None and (support := np.flatnonzero(able & likely)).size:
        best, cost = _least_of(hessian, linear, support[None])
        slope = hessian @ best - linear
        if cost < 0.0 and (slope[able & ~likely] > slope[support].max()).all():
            return best
    places = np.flatnonzero(able)
    found = [_least_of(hessian, linear, places[subsets]) for subsets in _subsets(len(places))]
    best, cost = min(found, key=lambda one: one[1], default=(np.zeros(len(linear)), 0.0))
    return best if cost < 0.0 else np.zeros(len(linear))


@cache
def _subsets(n: int) -> tuple[Indices, ...]:
    """Return all subsets of n places that are not empty, ``(m, size)`` of each size."""
    return tuple(np.array(list(combinations(range(n), size))) for size in range(1, n + 1))


def _least_of(hessian: Array, linear: Array, supports: Indices) -> tuple[Array, float]:
    """Return the best π on some supports, ``(m, size)``, and its cost; infinite if it is negative on all."""
    H, free = hessian[supports[:, :, None], supports[:, None, :]], linear[supports]
    found, of_ones = np.moveaxis(_solved(H, np.stack((free, np.ones_like(free)), axis=-1)), -1, 0)
    excess = np.maximum(found.sum(axis=-1) - 1.0, 0.0)  # then Σπ = 1
    found -= (excess / of_ones.sum(axis=-1))[:, None] * of_ones
    cost = 0.5 * np.einsum("si,sij,sj->s", found, H, found) - np.einsum("si,si->s", free, found)
    cost[~(found >= 0.0).all(axis=-1)] = np.inf
    first, best = int(cost.argmin()), np.zeros(len(linear))
    best[supports[first]] = found[first]
    return best, float(cost[first])


def _solved(H: Array, right: Array) -> Array:
    """Solve systems side by side, ``(m, k, k)`` and ``(m, k, 2)``; one that is singular gives NaN."""
    try:
        return np.asarray(np.linalg.solve(H, right))
    except np.linalg.LinAlgError:  # of one system, but for all
        if len(H) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([_solved(H[i : i + 1], right[i : i + 1]) for i in range(len(H))])
