"""Slow, obvious and independent oracles: equations (2) to (6), ARX models and the hold sample by sample; bounded plans.

They share no code with the library. The physics model is discretised as one transfer function, features are lists,
the ridge problem is solved once per batch from all rows so far, and a window is a loop of its own predictions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import clarabel
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.signal import cont2discrete, tf2ss
from scipy.sparse import csc_matrix

Array = NDArray[np.float64]


def transfer_function(modes: Sequence[tuple[float, float, float, float]]) -> tuple[Array, Array]:
    """Multiply out eq. (15).

    ``modes``: sequence of (f_n, zeta, alpha, beta): Hz, 1, 1/s², 1/s. Returns ``numerator``, ``denominator``:
    coefficients, highest power of s first.
    """
    numerator, denominator = np.array([0.0]), np.array([1.0])
    for f_n, zeta, alpha, beta in modes:
        omega = 2 * np.pi * f_n
        quadratic = [1.0, 2 * zeta * omega, omega**2]
        numerator = np.polyadd(np.polymul(numerator, quadratic), np.polymul([beta, alpha], denominator))
        denominator = np.polymul(denominator, quadratic)
    return np.trim_zeros(np.asarray(numerator, dtype=np.float64), "f"), np.asarray(denominator, dtype=np.float64)


def physics(
    numerator: Array, denominator: Array, x_d: Sequence[float], *, T_s: float, hold: str = "zoh", dead_time: int = 0
) -> list[float]:
    """Eq. (2): answer commands from rest, sample by sample.

    ``numerator``, ``denominator``: G_pb(s), highest power first; ``x_d``, m: commands relative to the position of
    rest; ``T_s``, s; ``hold``: {"zoh", "foh"}; ``dead_time``: samples. Returns list, m.
    """
    # With the sampling interval as the unit of time the coefficients stay near one another.
    num = numerator * T_s ** -np.arange(len(numerator) - 1.0, -1.0, -1.0)
    den = denominator * T_s ** -np.arange(len(denominator) - 1.0, -1.0, -1.0)
    A, B, C, D = (np.asarray(matrix) for matrix in cont2discrete(tf2ss(num, den), 1.0, method=hold)[:4])
    s = np.zeros(len(A))
    x_pb = []
    for k in range(len(x_d)):
        u = x_d[k - dead_time] if k >= dead_time else 0.0
        x_pb.append(float(C[0] @ s + D[0, 0] * u))
        s = A @ s + B[:, 0] * u
    return x_pb


def features(x_pb: Sequence[float], e_pb: Sequence[float], k: int, p: int, q: int) -> list[float]:
    """Eq. (5): ``[1, x_pb(k) … x_pb(k−q), e_pb(k−1) … e_pb(k−p)]``, zero before the first sample; ``(2+q+p,)``."""
    past_x = [x_pb[k - i] if k - i >= 0 else 0.0 for i in range(q + 1)]
    return [1.0, *past_x, *(e_pb[k - i] if k - i >= 0 else 0.0 for i in range(1, p + 1))]


def ridge(rows: Array, target: Array, lam: float) -> Array:
    """Eq. (6), solved from all rows in double precision; ``(m, n), (m,) → (n,)``."""
    n = rows.shape[1]
    stacked = np.vstack((np.sqrt(lam) * np.eye(n), rows))
    goal = np.concatenate((np.zeros(n), target))
    R: Array = np.asarray(np.linalg.qr(np.column_stack((stacked, goal)), mode="r"), dtype=np.float64)
    return np.asarray(np.linalg.solve(R[:n, :n], R[:n, n]), dtype=np.float64)


def ridge_extended(rows: Array, target: Array, lam: float) -> NDArray[np.longdouble]:
    """Eq. (6), solved from all rows to the digits of long double; ``(m, n), (m,) → (n,)``."""
    # A double solution is refined, its residuals in long double: Björck, BIT 7 (1967), 257
    n, long = rows.shape[1], np.longdouble
    A, b = np.vstack((np.sqrt(long(lam)) * np.eye(n), rows)), np.concatenate((np.zeros(n), target)).astype(long)
    scale = np.sqrt(np.sum(A * A, axis=0))
    A /= scale
    columns, R = np.linalg.qr(A.astype(np.float64))
    w, residual = np.zeros(n, dtype=long), np.zeros(len(b), dtype=long)
    for _ in range(8):
        # [I A; Aᵀ 0] [residual; w] = [b; 0]
        f, g = (b - residual - A @ w).astype(np.float64), -(A.T @ residual).astype(np.float64)
        along = columns.T @ f - solve_triangular(R, g, trans=1)
        w += solve_triangular(R, along)
        residual += f - columns @ along
    return np.asarray(w / scale)


@dataclass
class OracleRun:
    """Result of the oracle for a whole run, one entry per sample, m."""

    x_pb: list[float] = field(default_factory=list)
    x_h: list[float] = field(default_factory=list)
    active: list[bool] = field(default_factory=list)


def run(
    numerator: Array,
    denominator: Array,
    x_d: Array,
    x: Array,
    *,
    T_s: float,
    Np: int,
    p: int,
    q: int,
    lam: float,
    t_init: float,
    hold: str = "zoh",
    dead_time: int = 0,
) -> OracleRun:
    """Predict batch after batch of a run from rest at ``x_d[0]``, eqs. (2) to (6).

    ``numerator``, ``denominator``: G_pb(s), highest power first; ``x_d``, ``x``, (n,), m: commanded and measured
    positions; the last batch may be short; ``T_s``, ``t_init``, s; ``lam``, m²; ``hold``: {"zoh", "foh"};
    ``dead_time``: samples.
    """
    start = float(x_d[0])
    relative = [float(value) - start for value in x_d]
    x_pb = physics(numerator, denominator, relative, T_s=T_s, hold=hold, dead_time=dead_time)
    out = OracleRun()
    e_pb: list[float] = []  # measured residuals so far
    rows: list[list[float]] = []
    for first in range(0, len(relative), Np):
        batch = range(first, min(first + Np, len(relative)))
        # Eq. (6): the weights of this batch, from all rows before it
        w = ridge(np.array(rows), np.array(e_pb), lam) if rows else np.zeros(2 + q + p)
        # Eq. (4): residuals of this batch are unknown and stand as their own predictions
        guessed = list(e_pb)
        for k in batch:
            guessed.append(float(w @ np.array(features(x_pb, guessed, k, p, q))))
            warm = k * T_s < t_init - 1e-6 * T_s
            out.x_pb.append(x_pb[k] + start)
            out.x_h.append(x_pb[k] + start + (0.0 if warm else guessed[k]))
            out.active.append(not warm)
        # The batch is measured; e_pb = x − x_pb
        e_pb += [float(x[k]) - start - x_pb[k] for k in batch]
        rows += [features(x_pb, e_pb, k, p, q) for k in batch]
    return out


def arx_by_definition(x_d: Array, x: Array, n: int, n_fitted: int) -> Array:
    """Return the coefficients from the samples before ``n_fitted``, row by row."""
    y, rows, targets = x - x_d, [], []
    for k in range(n + 1, n_fitted):
        steps = [x_d[k - j] - x_d[k - j - 1] for j in range(n + 1)]
        row = [y[k - i] for i in range(1, n + 1)] + steps + [1.0]
        if not np.isnan([*row, y[k]]).any():
            rows.append(row)
            targets.append(y[k])
    return np.asarray(np.linalg.lstsq(np.array(rows), np.array(targets), rcond=None)[0])


def free_run_by_definition(w: Array, x_d: Array, x: Array, n: int, begin: int, end: int) -> Array:
    """Return the positions predicted from what is measured before ``begin``, sample by sample."""
    y = (x - x_d)[:begin].tolist()
    for k in range(n + 1, end):
        if k >= len(y) or np.isnan(y[k]):
            steps = [x_d[k - j] - x_d[k - j - 1] for j in range(n + 1)]
            value = float(np.dot(w, [y[k - i] for i in range(1, n + 1)] + steps + [1.0]))
            y[k : k + 1] = [value]
    return np.asarray(x_d[begin:end] + np.array(y[begin:end]))


def held(x_pb: Array, x_meas: Array, Np: int, *, delay: int = 0, first: int = 0) -> Array:
    """Return ``x_pb`` plus the residual of the last sample measured before each window, (n,), m.

    ``x_meas`` is what was measured at each sample, NaN where missing; it arrived ``delay`` samples later. What is
    measured before sample ``first`` does not count.
    """
    found: Array = x_pb.copy()
    for begin in range(0, len(x_pb), Np):
        known = first + np.flatnonzero(~np.isnan(x_meas[first : max(first, begin - delay)]))
        if len(known):
            found[begin : begin + Np] += x_meas[known[-1]] - x_pb[known[-1]]
    return found


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
