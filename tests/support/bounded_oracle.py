"""Bounded quadratic programmes by an independent solver."""

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

Array = NDArray[np.float64]


def clarabel_minimum(P: Array, v: Array, rows: Array, low: Array, high: Array, tolerance: float = 1e-8) -> Array:
    """Return the minimum of ``½ xᵀPx − vᵀx`` within the bounds by Clarabel (Goulart and Chen, arXiv:2405.12762)."""
    unit = float(np.max(np.abs(np.linalg.solve(P, v))))
    scale = 1.0 / float(np.max(np.diag(P)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    solver = clarabel.DefaultSolver(
        csc_matrix(np.triu(P * scale)),
        -v * (scale / unit),
        csc_matrix(np.concatenate((rows, -rows)) * unit),
        np.concatenate((high, -low)),
        [clarabel.NonnegativeConeT(2 * len(rows))],
        settings,
    )
    solution = solver.solve()
    assert str(solution.status) in ("Solved", "AlmostSolved")
    return np.asarray(solution.x) * unit
