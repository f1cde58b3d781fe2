"""Streaming benchmark: a log of 10⁷ samples in constant memory, with the weights exact at the end.

Run with ``python benchmarks/streaming.py``; exits with 1 if memory grew or the weights are off by more than 1e-10.

The log is one block of 10⁴ samples over and over. Its last 5 s are at rest with no residual: the physics model's state
is back at exactly zero when the next block begins, so that the rows of all blocks are the same bit for bit. The exact
weights then follow from one extended-precision QR of ``√m`` times the rows of one block.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import zipfile
from pathlib import Path
from time import perf_counter

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.lib import format as npy
from rich.console import Console
from rich.table import Table

from benchmarks.common import (
    Array,
    exact_weights,
    feature_rows,
    physics_response,
    relative_error,
    require_extended_precision,
    resident_bytes,
)
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import Batch, backtest_stream
from hybridsep.logs.log import open_log
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.predictor import HybridPredictor

TS = 1e-3
BLOCK = 10_000
P_LAGS, Q_LAGS = 50, 3
ERROR_MAX = 1e-10
GROWTH_MAX = 1_000_000
"""Bytes by which the memory may differ between a tenth of the log and its end: a few of the allocator's pages."""


def make_predictor() -> HybridPredictor:
    """Return n = 55 features on a well-damped drive: 40 Hz at ζ = 0.7 decays by e^−880 in 5 s, that is, to zero."""
    model = ModalModel([Mode(f_n=40.0, zeta=0.7, alpha=(80 * np.pi) ** 2)])
    return HybridPredictor(model, PredictorSettings(trust=False, T_s=TS, p=P_LAGS, q=Q_LAGS))


def minimum_jerk(tau: Array) -> Array:
    """Return the rest-to-rest move from 0 to 1 in unit time, ``10τ³ − 15τ⁴ + 6τ⁵``, clipped at its ends."""
    tau = np.clip(tau, 0.0, 1.0)
    return tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)


def make_block() -> tuple[Array, Array, Array]:
    """Return ``(x_d, x_pb, x)`` of one block, (10⁴,), m: moves of 10 mm for 5 s, then rest at 0 without a residual."""
    t: Array = np.arange(BLOCK, dtype=np.float64) * TS
    x_d = np.zeros(BLOCK)
    for begin, direction in ((0.1, 1), (1.1, 1), (2.1, -1), (3.1, -1)):
        x_d += 0.010 * direction * minimum_jerk((t - begin) / 0.2)
    x_d[t >= 3.4] = 0.0  # what rounding left of the sum
    x_pb = physics_response(make_predictor(), x_d)
    moving = t < 5.0
    v_d = np.gradient(x_d, TS)
    noise = np.random.default_rng(0).normal(0.0, 1e-6, BLOCK)
    # Friction that follows the command, a spring that hardens, an encoder's noise; nothing of it at rest.
    residual = 10e-6 * np.tanh(v_d / 2e-3) + 0.2 * x_pb * np.abs(x_pb) + noise
    return x_d, x_pb, np.where(moving, x_pb + residual, x_pb)


def write_repeated(path: Path, repetitions: int, **columns: Array) -> None:
    """Write an ``.npz`` file whose columns are the given ones, repeated; one block at a time."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, column in columns.items():
            header = {"descr": "<f8", "fortran_order": False, "shape": (repetitions * len(column),)}
            data = column.astype("<f8").tobytes()
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array_header_1_0(member, header)
                for _ in range(repetitions):
                    member.write(data)


def main() -> int:
    parser = argparse.ArgumentParser(description="Stream a long log; check its memory and the weights at the end.")
    parser.add_argument("--samples", type=int, default=10_000_000, help=f"a multiple of {10 * BLOCK}")
    n_samples = parser.parse_args().samples
    if n_samples < 10 * BLOCK or n_samples % (10 * BLOCK):
        parser.error(f"--samples must be a multiple of {10 * BLOCK}, got {n_samples}")
    require_extended_precision()
    if not Path("/proc/self/statm").exists():
        parser.error("the memory in use is read from /proc/self/statm; run this on Linux")
    repetitions = n_samples // BLOCK

    x_d, x_pb, x = make_block()
    if x_pb[-100:].any() or x[-100:].any():
        raise AssertionError("the block must end at exactly zero, else its repetitions differ")
    predictor = make_predictor()
    memory: list[int] = []

    def measure(batch: Batch) -> None:
        if batch.k + len(batch.x) in (n_samples // 10, n_samples):
            memory.append(resident_bytes())

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        write_repeated(path, repetitions, x_d=x_d, x=x)
        size = path.stat().st_size
        begin = perf_counter()
        scores = backtest_stream(predictor, open_log(path, T_s=TS).chunks(BLOCK), on_batch=measure)
        seconds = perf_counter() - begin

    rows = feature_rows(x_pb, x - x_pb, P_LAGS, Q_LAGS)
    error = relative_error(predictor.weights, exact_weights(rows, predictor.settings.lam, repetitions))
    growth = memory[1] - memory[0]

    table = Table(
        title=f"n = {predictor.regression.n_features} features, a block of {BLOCK} samples {repetitions} times"
    )
    table.add_column("")
    table.add_column("seen", justify="right")
    table.add_column("limit", justify="right")
    table.add_row("samples", f"{scores.overall.n_samples:,}", "")
    table.add_row("file", f"{size / 1e6:.1f} MB", "")
    table.add_row("time, reading included", f"{1e6 * seconds / n_samples:.3f} µs per sample", "")
    table.add_row("memory after 10 %", f"{memory[0] / 1e6:.2f} MB", "")
    table.add_row("memory at the end", f"{memory[1] / 1e6:.2f} MB", "")
    table.add_row("difference", f"{growth / 1e6:+.2f} MB", f"≤ {GROWTH_MAX / 1e6:g} MB")
    table.add_row("weights, ‖w − w*‖/‖w*‖", f"{error:.1e}", f"≤ {ERROR_MAX:g}")
    table.add_row(
        "RMS, physics / hybrid", f"{1e6 * scores.overall.rms_pb:.3f} / {1e6 * scores.overall.rms_h:.3f} µm", ""
    )
    console = Console(width=110)
    console.print(table)
    console.print("w*: Householder QR in numpy.longdouble; RMS against the measured position.", highlight=False)
    held = scores.overall.n_samples == n_samples and growth <= GROWTH_MAX and error <= ERROR_MAX
    console.print("held" if held else "MISSED")
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
