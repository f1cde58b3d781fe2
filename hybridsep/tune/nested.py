"""Weights of many candidates (p, q, λ) from one triangular factor; eq. (6).

The factor of the rows with the most lags and the least penalty λ₀ holds the solutions of all candidates. Rows
``√(λ − λ₀)·I`` folded into a copy raise its penalty. In the order ``[1, x_pb(k) … x_pb(k−q) | e_pb(k−1) … e_pb(k−p)]``
its leading columns are the factor of a smaller p, and a smaller q is reached by folding the rows of the lags that are
left out into the triangle below (Golub and Van Loan, *Matrix Computations*, 4th ed., section 6.5). All of it is
orthogonal, so the weights are as accurate as those of a regression for each candidate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ..base.settings import PredictorSettings
from ..base.signals import Array, Indices
from ..predict.paper.features import FeatureLayout
from ..predict.regression import RidgeRegression, fold

__all__ = ["NestedRidge"]


@dataclass(frozen=True)
class _SameLags:
    """Candidates that share q and λ: their rows among those of that λ, and which equations each of them has."""

    q: int
    rows: Indices
    equations: Array
    """``(p_max + 1, n)`` array, column-major: 1 for the first p rows of the triangle of the lags, 0 below."""


@dataclass(frozen=True)
class _SamePenalty:
    """Candidates that share λ: their indices among all, and by q, descending."""

    lam: float
    members: Indices
    by_q: tuple[_SameLags, ...]


class NestedRidge:
    """Recursive ridge regressions of many candidates, carried as one factor.

    Parameters
    ----------
    candidates : sequence of PredictorSettings
        Of the paper's model; ``p``, ``q`` and ``lam`` may differ.

    Attributes
    ----------
    layout : FeatureLayout
        Rows with the largest ``p`` and ``q``.
    """

    def __init__(self, candidates: Sequence[PredictorSettings]) -> None:
        self.layout = FeatureLayout(max(one.p for one in candidates), max(one.q for one in candidates))
        self.n_candidates = len(candidates)
        self.regression = RidgeRegression(self.layout.n, min(one.lam for one in candidates))
        self._groups = tuple(_by_penalty(candidates, self.layout.p))

    def update_stacked(self, rows: Array) -> None:
        """Update with rows ``[φ(k) | e_pb(k)]`` of :attr:`layout`; they are overwritten."""
        self.regression.update_stacked(rows)

    def weights(self) -> Array:
        """Return the weights of all candidates, one row each, ``(n_candidates, n)``; 0 where it has no feature."""
        found = np.zeros((self.n_candidates, self.layout.n))
        for group in self._groups:
            found[group.members] = self._weights_of(group)
        return found

    def _weights_of(self, group: _SamePenalty) -> Array:
        layout, n = self.layout, self.layout.n
        first = layout.e_pb.start
        factor = self.regression.factor_with(group.lam)
        lags = np.array(factor[first:, first:], order="F")  # [R_e z_e; 0 ρ]
        w = np.zeros((len(group.members), n))
        q_now = layout.q
        for same in group.by_q:
            if same.q < q_now:
                left_out = slice(layout.x_pb.start + same.q + 1, layout.x_pb.start + q_now + 1)
                fold(lags, np.array(factor[left_out, first:], order="F"))
                q_now = same.q
            lags[-1, -1] = 1.0  # ρ belongs to no weight, and may be 0
            # R_e w_e = z_e in the leading p rows and columns; with 0 on the right of the others, their solution is 0.
            w_e, _ = lapack.dtrtrs(lags, same.equations * lags[:, -1:], overwrite_b=1)
            w[same.rows, first:] = w_e[:-1].T
        # R_x w_x = z_x − R_xe w_e
        right = factor[:first, n:] - factor[:first, first:n] @ w[:, first:].T
        for same in group.by_q:
            right[layout.x_pb.start + same.q + 1 :, same.rows] = 0.0
        w_x, _ = lapack.dtrtrs(factor[:first, :first], right)
        w[:, :first] = w_x.T
        return w


def _by_penalty(candidates: Sequence[PredictorSettings], p_max: int) -> Iterable[_SamePenalty]:
    for lam in sorted({one.lam for one in candidates}):
        members = [i for i, one in enumerate(candidates) if one.lam == lam]
        by_q = []
        for q in sorted({candidates[i].q for i in members}, reverse=True):
            rows = [row for row, i in enumerate(members) if candidates[i].q == q]
            p = np.array([candidates[members[row]].p for row in rows])
            equations = np.asfortranarray(np.arange(p_max + 1)[:, None] < p, dtype=np.float64)
            by_q.append(_SameLags(q, np.array(rows), equations))
        yield _SamePenalty(lam, np.array(members), tuple(by_q))
