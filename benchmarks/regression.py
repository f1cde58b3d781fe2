"""Benchmark of the replay's speed and accuracy against bare LAPACK and padasip's recursive regression.

    python -m benchmarks.regression      (half a minute; after ``pip install '.[test,benchmark]'``)

A replay of a log, with its predictions and their intervals, beside LAPACK's ``dtpqrt`` alone on the same rows, the
textbook's update of the covariance, and padasip's RLS filter.

All times are from one thread, interleaved, and each ratio is the median of the ratios within a repetition. ``dtpqrt``
is timed call by call: the copy of the rows into its work space, which it overwrites, is not counted, so that it finds
its rows in the cache. The filters are given the finished rows, too; padasip's gets fewer of many features, and its
weights are compared with the exact ones of the samples it had. Exact weights are the tests', in extended precision.
"""

from collections.abc import Callable
from statistics import median
from time import perf_counter

import numpy as np
import oracle
from scipy.linalg import lapack

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

LAM, NP, NOISE_STD = 1e-12, 100, 5e-6  # ridge, samples in a window, noise of the encoder, m
N_SAMPLES, REPETITIONS, SLOW_REPETITIONS = 24_000, 15, 3
BACKTEST, DTPQRT, COVARIANCE, PADASIP = "hybridsep backtest", "LAPACK dtpqrt alone", "textbook P matrix", "padasip RLS"

Timed = tuple[float, Array]  # seconds, and weights, (n,)


def staircase_log(n: int) -> tuple[Array, Array]:
    """Return ``(x_d, x)``, (n,), m: 10 mm moves, three up and three down, over and over, on the nonlinear drive."""
    period = staircase()[:-1]
    # The second of two periods: the drive's own vibration has become periodic.
    x = simulate(FeedDrive(m=1.0, c=15.7, k=24674.0, c_nl=100.0, k_nl=1000.0), np.tile(period, 2), 1e-3)[len(period) :]
    return np.resize(period, n), np.resize(x, n) + np.random.default_rng(0).normal(0.0, NOISE_STD, n)


def new_predictor(p: int, q: int) -> HybridPredictor:
    """Return a predictor for the staircase with the linear part of its drive as the physics model."""
    model = ModalModel.spring_mass_damper(m=1.0, c=15.7, k=24674.0)
    return HybridPredictor(model, PredictorSettings(averaging=False, p=p, q=q))


def run_backtest(predictor: HybridPredictor, x_d: Array, x: Array) -> Timed:
    """Replay a log."""
    begin = perf_counter()
    backtest(predictor, x_d, x)
    return perf_counter() - begin, predictor.weights


def run_dtpqrt(phi: Array, e: Array) -> Timed:
    """Update the triangular factor of eq. (6) window by window."""
    n = phi.shape[1]
    factor = np.zeros((n + 1, n + 1), order="F")
    np.fill_diagonal(factor[:n, :n], np.sqrt(LAM))
    rows, work, seconds = np.column_stack((phi, e)), np.empty((NP, n + 1), order="F"), 0.0
    for i in range(0, len(rows), NP):
        work[:] = rows[i : i + NP]
        begin = perf_counter()
        lapack.dtpqrt(0, 8, factor, work, overwrite_a=1, overwrite_b=1)
        seconds += perf_counter() - begin
    return seconds, lapack.dtrtrs(factor[:n, :n], factor[:n, n])[0]


def run_covariance(phi: Array, e: Array) -> Timed:
    """Update the covariance sample by sample."""
    n = phi.shape[1]
    begin = perf_counter()
    P, w = np.eye(n) / LAM, np.zeros(n)
    for row, target in zip(phi, e, strict=True):
        direction = P @ row
        gain = direction / (1.0 + row @ direction)
        w += gain * (target - row @ w)
        P -= np.outer(gain, direction)
    return perf_counter() - begin, w


def run_padasip(phi: Array, e: Array) -> Timed:
    """Let padasip's filter learn sample by sample, without forgetting, from ``P = I/λ``."""
    from padasip.filters import FilterRLS

    rls = FilterRLS(phi.shape[1], mu=1.0, eps=LAM, w="zeros")
    begin = perf_counter()
    for target, row in zip(e, phi, strict=True):
        rls.adapt(target, row)
    return perf_counter() - begin, rls.w


def compare(p: int, q: int) -> None:
    """Print the table at these lags."""
    x_d, x = staircase_log(N_SAMPLES)
    discrete = new_predictor(p, q).discrete
    x_pb = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0]
    e = x - x_d[0] - x_pb
    of_x, of_e = x_pb.tolist(), e.tolist()
    phi = np.array([oracle.features(of_x, of_e, k, p, q) for k in range(N_SAMPLES)])
    few = N_SAMPLES if phi.shape[1] < 100 else N_SAMPLES // 10
    compared: dict[str, tuple[int, Callable[[], Timed]]] = {
        BACKTEST: (N_SAMPLES, lambda: run_backtest(new_predictor(p, q), x_d, x)),
        DTPQRT: (N_SAMPLES, lambda: run_dtpqrt(phi, e)),
        COVARIANCE: (N_SAMPLES, lambda: run_covariance(phi, e)),
        PADASIP: (few, lambda: run_padasip(phi[:few], e[:few])),
    }
    times: dict[str, list[float]] = {name: [] for name in compared}  # µs a sample
    weights: dict[str, Array] = {}
    with np.errstate(all="ignore"):  # a peer that loses its weights may overflow on the way
        for repetition in range(REPETITIONS):
            for name, (n, run) in compared.items():
                if repetition < SLOW_REPETITIONS or name in (BACKTEST, DTPQRT):
                    seconds, weights[name] = run()
                    times[name].append(1e6 * seconds / n)
    exact = {
        n: oracle.ridge_extended(phi[:n].astype(np.longdouble), e[:n].astype(np.longdouble), LAM)
        for n in (N_SAMPLES, few)
    }
    print(f"{phi.shape[1]} features (p = {p}, q = {q}), Np = {NP}, λ = {LAM:g} m²")
    print(f"{'':20}{'samples':>9}{'µs a sample':>13}{'× backtest':>12}{'|w − w*| / |w*|':>17}")
    for name, (n, _) in compared.items():
        off = np.linalg.norm((weights[name] - exact[n]).astype(np.float64)) / np.linalg.norm(
            exact[n].astype(np.float64)
        )
        ratio = median(a / b for a, b in zip(times[name], times[BACKTEST], strict=False))
        print(f"{name:20}{n:9}{median(times[name]):13.3f}{ratio:12.2f}{off:17.1e}")


if __name__ == "__main__":
    if np.finfo(np.longdouble).eps > 2e-19:
        raise SystemExit("the exact weights need an extended-precision numpy.longdouble; run this on x86-64 Linux")
    compare(50, 3)
    compare(100, 99)
