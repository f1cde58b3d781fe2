"""Benchmark of the replay's speed and accuracy against bare LAPACK and other packages' recursive regressions.

Run with ``python benchmarks/regression.py``; exits with 1 if a limit is missed: replaying a log may take at most 3
times as long as LAPACK's ``dtpqrt`` alone takes for the same rows, and padasip's RLS filter must take at least 15 times
as long for a sample.

All times are from one thread, interleaved, and each ratio is the median of the ratios within a repetition. ``dtpqrt``
is timed call by call: the copy of the rows into its work space, which it overwrites, is not counted, so that it finds
its rows in the cache. The other packages are given the finished rows, too; slow ones get fewer samples, and their
weights are compared with the exact ones of the samples they had. River's nearest is its Bayesian linear regression,
whose mean is the ridge solution. A package that is missing is left out and named, with how to install it; padasip must
be there.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.linalg import lapack

from benchmarks.common import (
    Array,
    exact_weights,
    feature_rows,
    physics_response,
    relative_error,
    require_extended_precision,
    staircase_log,
    staircase_predictor,
)
from hybridsep.evaluate.backtest import backtest

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


def run_sysidentpy(rows: Array) -> tuple[float, Array]:
    from sysidentpy.parameter_estimation import RecursiveLeastSquares

    n = rows.shape[1] - 1
    # It leaves out the first two rows; zero rows there change nothing.
    padded = np.vstack((np.zeros((2, n + 1)), rows))
    estimator = RecursiveLeastSquares(lam=1.0, delta=LAM)  # no forgetting, P = I/λ at first
    begin = perf_counter()
    w = estimator.optimize(padded[:, :n], padded[:, n:])
    return perf_counter() - begin, w[:, 0]


def run_river(rows: Array) -> tuple[float, Array]:
    from river.linear_model import BayesianLinearRegression

    n = rows.shape[1] - 1
    samples = [(dict(enumerate(row[:n])), row[n]) for row in rows.tolist()]
    model: Any = BayesianLinearRegression(alpha=LAM, beta=1.0)  # its mean is the ridge solution
    begin = perf_counter()
    for x, y in samples:
        model.learn_one(x, y)
    seconds = perf_counter() - begin
    return seconds, np.array([model.predict_one({i: 1.0}) for i in range(n)])


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
        Contender("sysidentpy RLS", few, lambda: run_sysidentpy(rows[:few])),
        Contender("river BayesianLinearRegression", few, lambda: run_river(rows[:few])),
    ], rows


def importable(contender: Contender, console: Console) -> bool:
    """Run a contender once, untimed, and say how to install it if its package is missing or too old."""
    try:
        contender.run()
    except ImportError as error:
        console.print(f"{contender.name} is left out: {error}", highlight=False)
        console.print("  to compare with it: pip install 'padasip>=1.2' 'river>=0.21' 'sysidentpy>=0.5'", markup=False)
        if contender.name == PADASIP:
            raise SystemExit(1) from None
        return False
    return True


def compare(p: int, q: int, console: Console) -> list[str]:
    """Run one table; return the limits that were missed."""
    everyone, rows = contenders(p, q)
    with np.errstate(all="ignore"):
        compared = [contender for contender in everyone if importable(contender, console)]
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
