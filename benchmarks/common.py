"""Reference data of the benchmarks: a staircase log, rows of features written out plainly, and exact weights."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

__all__ = [
    "Array",
    "exact_weights",
    "feature_rows",
    "physics_response",
    "relative_error",
    "require_extended_precision",
    "resident_bytes",
    "staircase_log",
    "staircase_predictor",
]

NOISE_STD = 5e-6
"""Standard deviation of the encoder noise, m."""

ROWS_AT_ONCE = 500
"""Rows that the extended-precision factor takes in at a time; bounds its work space."""


def staircase_log(n: int) -> tuple[Array, Array]:
    """Return ``(x_d, x)``, (n,), m: 10 mm moves, three up and three down, over and over, on the nonlinear drive."""
    period = staircase()[:-1]
    # The second of two periods: the drive's own vibration has become periodic.
    x = simulate(FeedDrive(m=1.0, c=15.7, k=24674.0, c_nl=100.0, k_nl=1000.0), np.tile(period, 2), 1e-3)[len(period) :]
    repetitions = -(-n // len(period))
    noise = np.random.default_rng(0).normal(0.0, NOISE_STD, n)
    return np.tile(period, repetitions)[:n], np.tile(x, repetitions)[:n] + noise


def staircase_predictor(p: int, q: int) -> HybridPredictor:
    """Return a predictor for the staircase with the linear part of its drive as the physics model."""
    return HybridPredictor(
        ModalModel.spring_mass_damper(m=1.0, c=15.7, k=24674.0), PredictorSettings(trust=False, p=p, q=q)
    )


def physics_response(predictor: HybridPredictor, x_d: Array) -> Array:
    """Return ``x_pb`` from rest, (n,), m, relative to the first command, window by window as a predictor does it."""
    state, parts = predictor.discrete.rest(), []
    for i in range(0, len(x_d), predictor.Np):
        x_pb, state = predictor.discrete.forced_response(state, x_d[i : i + predictor.Np] - x_d[0])
        parts.append(x_pb)
    return np.concatenate(parts)


def feature_rows(x_pb: Array, e_pb: Array, p: int, q: int) -> Array:
    """Return the rows ``[φ(k) | e_pb(k)]`` of eq. (5), (n, 3 + q + p); all before the first sample is zero."""
    n = len(x_pb)
    x_past, e_past = np.concatenate((np.zeros(q), x_pb)), np.concatenate((np.zeros(p), e_pb))
    columns: list[Array] = [np.ones(n)]
    columns += [x_past[q - i : q - i + n] for i in range(q + 1)]
    columns += [e_past[p - i : p - i + n] for i in range(1, p + 1)]
    return np.column_stack([*columns, e_pb])


def exact_weights(rows: Array, lam: float, repetitions: int = 1) -> NDArray[np.longdouble]:
    """Return the ridge solution of eq. (6) in extended precision, (n,).

    Householder QR in ``numpy.longdouble`` (64-bit mantissa on x86) of the rows, taken ``repetitions`` times, on top
    of ``√λ·I``; repeating rows m times is the same as taking them times ``√m``.

    Parameters
    ----------
    rows : (m, n + 1) array
        Features and target.
    lam : float
        Ridge penalty, m².
    repetitions : int
        Repetitions of the rows.
    """
    n = rows.shape[1] - 1
    R = np.zeros((n, n + 1), dtype=np.longdouble)
    np.fill_diagonal(R, np.sqrt(np.longdouble(lam)))
    for i in range(0, len(rows), ROWS_AT_ONCE):
        block = rows[i : i + ROWS_AT_ONCE].astype(np.longdouble, order="F") * np.sqrt(np.longdouble(repetitions))
        for j in range(n):
            v = block[:, j].copy()
            square = v @ v
            if square == 0:
                continue
            # The reflection along [u, v] takes [R_jj; v] to [r; 0].
            r = -np.copysign(np.sqrt(R[j, j] ** 2 + square), R[j, j])
            u = R[j, j] - r
            along = (u * R[j, j + 1 :] + v @ block[:, j + 1 :]) * (2 / (u * u + square))
            R[j, j], R[j, j + 1 :] = r, R[j, j + 1 :] - u * along
            block[:, j + 1 :] -= np.outer(v, along)
    w = np.zeros(n, dtype=np.longdouble)
    for j in reversed(range(n)):
        w[j] = (R[j, n] - R[j, j + 1 : n] @ w[j + 1 :]) / R[j, j]
    return w


def relative_error(w: Any, exact: NDArray[np.longdouble]) -> float:
    """Return ``‖w − w*‖ / ‖w*‖``."""
    difference = np.asarray(w, dtype=np.longdouble) - exact
    return float(np.sqrt(difference @ difference) / np.sqrt(exact @ exact))


def require_extended_precision() -> None:
    """Stop where ``numpy.longdouble`` is no more precise than float64, as on ARM and with MSVC."""
    if np.finfo(np.longdouble).eps > 2e-19:
        raise SystemExit("the exact weights need an extended-precision numpy.longdouble; run this on x86-64 Linux")


def resident_bytes() -> int:
    """Return the memory this process has in use now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
