"""Free runs of many learned recursions over one window, eq. (4), all candidates at once."""

from __future__ import annotations

import numpy as np

from ..base.signals import Array, Indices
from ..predict.paper.features import FeatureLayout

__all__ = ["free_runs"]

_AT_ONCE = 500
"""Recursions that run together: with 100 lags their weights and residuals fit into a processor's second cache."""


def free_runs(layout: FeatureLayout, rows: Array, weights: Array, p: Indices) -> Array:
    """Return ``wᵀφ`` of each recursion over a window, ``(n_candidates, m)``, m; not finite where it overflows.

    Parameters
    ----------
    layout : FeatureLayout
        Of rows and weights.
    rows : (m, n) array
        φ with the measured residuals, of which those of the window are not used.
    weights : (n_candidates, n) array
        0 beyond the lags of a recursion.
    p : (n_candidates,) array of int
        Lags of each recursion; where they ascend, fewer zeros are multiplied.
    """
    known = np.array(rows)
    known[:, layout.e_pb] = np.triu(rows[:, layout.e_pb])  # e_pb(k−i) is known where k−i is before the window
    found = np.empty((len(weights), len(rows)))
    with np.errstate(over="ignore", invalid="ignore"):
        for i in range(0, len(weights), _AT_ONCE):
            some = slice(i, i + _AT_ONCE)
            w_e = weights[some, layout.e_pb][:, : p[some].max()]
            found[some] = _recursion(weights[some] @ known.T, w_e)
    return found


def _recursion(drive: Array, w_e: Array) -> Array:
    """Return ``e(k) = drive(k) + Σ_i w_e,i e(k−i)`` with ``e = 0`` before the window, ``(n_candidates, m)``."""
    m, p = drive.shape[1], w_e.shape[1]
    backwards = np.empty_like(drive)  # the last sample first: then lags ascend
    for k in range(m):
        own, reach = m - 1 - k, min(k, p)
        before = backwards[:, own + 1 : own + 1 + reach]
        np.add(drive[:, k], np.einsum("ij,ij->i", w_e[:, :reach], before), out=backwards[:, own])
    return backwards[:, ::-1]
