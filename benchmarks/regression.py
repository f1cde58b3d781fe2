"""Benchmark of the replay's speed and accuracy against bare LAPACK and padasip's recursive regression.

Run with ``python -m benchmarks.regression``; exits with 1 if a limit is missed: replaying a log may take at most 3
times as long as LAPACK's ``dtpqrt`` alone takes for the same rows, and padasip's RLS filter must take at least 15 times
as long for a sample.

All times are from one thread, interleaved, and each ratio is the median of the ratios within a repetition. ``dtpqrt``
is timed call by call: the copy of the rows into its work space, which it overwrites, is not counted, so that it finds
its rows in the cache. The filters are given the finished rows, too; padasip's gets fewer of many features, and its
weights are compared with the exact ones of the samples it had.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.linalg import lapack

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

NOISE_STD = 5e-6  # standard deviation of the encoder noise, m
ROWS_AT_ONCE = 500  # rows that the extended-precision factor takes in at a time; bounds its work space


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
        ModalModel.spring_mass_damper(m=1.0, c=15.7, k=24674.0), PredictorSettings(averaging=False, p=p, q=q)
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


LAM = 1e-12
NP = 100
N_SAMPLES = 24_000
REPETITIONS, SLOW_REPETITIONS = 15, 3
DTPQRT_RATIO_MAX = 3.0
PADASIP_RATIO_MIN = 15.0
DTPQRT, PADASIP = "LAPACK dtpqrt alone", "padasip FilterRLS"


@dataclass(frozen=True)
class Contender:
    """Something that is timed: ``run`` returns the seconds it took and its weights."""

    name: str
    n_samples: int
    run: Callable[[], tuple[float, Array]]
    slow: bool = True


def run_backtest(p: int, q: int, x_d: Array, x: Array) -> tuple[float, Array]:
    predictor = staircase_predictor(p, q)
    begin = perf_counter()
    backtest(predictor, x_d, x)
    return perf_counter() - begin, predictor.weights


def run_dtpqrt(rows: Array) -> tuple[float, Array]:
    n = rows.shape[1] - 1
    factor = np.zeros((n + 1, n + 1), order="F")
    np.fill_diagonal(factor[:n, :n], np.sqrt(LAM))
    work, seconds = np.empty((NP, n + 1), order="F"), 0.0
    for i in range(0, len(rows), NP):
        work[:] = rows[i : i + NP]
        begin = perf_counter()
        lapack.dtpqrt(0, 8, factor, work, overwrite_a=1, overwrite_b=1)
        seconds += perf_counter() - begin
    return seconds, lapack.dtrtrs(factor[:n, :n], factor[:n, n])[0]


def run_covariance(rows: Array) -> tuple[float, Array]:
    n = rows.shape[1] - 1
    begin = perf_counter()
    P, w = np.eye(n) / LAM, np.zeros(n)
    for row in rows:
        phi = row[:n]
        direction = P @ phi
        gain = direction / (1.0 + phi @ direction)
        w += gain * (row[n] - phi @ w)
        P -= np.outer(gain, direction)
    return perf_counter() - begin, w


def run_padasip(rows: Array) -> tuple[float, Array]:
    from padasip.filters import FilterRLS

    n = rows.shape[1] - 1
    phi, target = np.ascontiguousarray(rows[:, :n]), rows[:, n].copy()
    rls = FilterRLS(n, mu=1.0, eps=LAM, w="zeros")  # no forgetting, P = I/λ at first
    begin = perf_counter()
    for d, x in zip(target, phi, strict=True):
        rls.adapt(d, x)
    return perf_counter() - begin, rls.w


def contenders(p: int, q: int) -> tuple[list[Contender], Array]:
    """Return who is compared at these lags, the replay first, and the rows they all fit."""
    x_d, x = staircase_log(N_SAMPLES)
    x_pb = physics_response(staircase_predictor(p, q), x_d)
    rows = feature_rows(x_pb, x - x_d[0] - x_pb, p, q)
    few = N_SAMPLES if rows.shape[1] < 100 else N_SAMPLES // 10
    return [
        Contender("hybridsep backtest", N_SAMPLES, lambda: run_backtest(p, q, x_d, x), slow=False),
        Contender(DTPQRT, N_SAMPLES, lambda: run_dtpqrt(rows), slow=False),
        Contender("textbook P matrix", N_SAMPLES, lambda: run_covariance(rows)),
        Contender(PADASIP, few, lambda: run_padasip(rows[:few])),
    ], rows


def compare(p: int, q: int, console: Console) -> list[str]:
    """Run one table; return the limits that were missed."""
    compared, rows = contenders(p, q)
    microseconds: dict[str, list[float]] = {contender.name: [] for contender in compared}
    weights: dict[str, Array] = {}
    with np.errstate(all="ignore"):  # a peer that loses its weights may overflow on the way
        for repetition in range(REPETITIONS):
            for contender in compared:
                if repetition < SLOW_REPETITIONS or not contender.slow:
                    seconds, weights[contender.name] = contender.run()
                    microseconds[contender.name].append(1e6 * seconds / contender.n_samples)
    exact = {n: exact_weights(rows[:n], LAM) for n in {contender.n_samples for contender in compared}}

    ours = microseconds[compared[0].name]
    ratio = {name: median(a / b for a, b in zip(times, ours, strict=False)) for name, times in microseconds.items()}
    table = Table(title=f"n = {rows.shape[1] - 1} features (p = {p}, q = {q}), Np = {NP}, λ = {LAM:g} m²")
    for heading in ("", "samples", "µs per sample", "times the backtest", "‖w − w*‖/‖w*‖"):
        table.add_column(heading, justify="right" if heading else "left")
    for contender in compared:
        name, error = contender.name, relative_error(weights[contender.name], exact[contender.n_samples])
        row = name, str(contender.n_samples), f"{median(microseconds[name]):.3f}", f"{ratio[name]:.2f}", f"{error:.1e}"
        table.add_row(*row)
    console.print(table)

    n = rows.shape[1] - 1
    over_dtpqrt = median(a / b for a, b in zip(ours, microseconds[DTPQRT], strict=True))
    checks = [
        (
            over_dtpqrt <= DTPQRT_RATIO_MAX,
            f"n = {n}: backtest / dtpqrt = {over_dtpqrt:.2f}, limit ≤ {DTPQRT_RATIO_MAX}",
        ),
        (
            ratio[PADASIP] >= PADASIP_RATIO_MIN,
            f"n = {n}: padasip / backtest = {ratio['padasip FilterRLS']:.0f}, limit ≥ {PADASIP_RATIO_MIN}",
        ),
    ]
    for held, text in checks:
        console.print(f"{'held  ' if held else 'MISSED'} {text}", highlight=False)
    return [text for held, text in checks if not held]


def main() -> int:
    require_extended_precision()
    console = Console(width=110)
    missed = [text for p, q in ((50, 3), (100, 99)) for text in compare(p, q, console)]
    console.print(
        "w*: Householder QR of the same rows in numpy.longdouble. nan: the weights were lost.", highlight=False
    )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
