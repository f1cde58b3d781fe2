"""Long run of the C core: accuracy and memory over 10⁸ samples.

Folds a block of feature rows of the staircase over and over into the C regression, n = 55, and compares the weights
with the exact ones: repeating rows m times is the same as taking them times √m, so one QR in extended precision gives
them. Then steps the whole FMU along a motion that repeats, with the paper's model and with the trusted one: the error
of its predictions must not grow. Every call of the allocator is counted. Ends with 1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path
from time import perf_counter

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rich.console import Console
from rich.table import Table

from benchmarks.common import (
    exact_weights,
    feature_rows,
    physics_response,
    relative_error,
    require_extended_precision,
    staircase_log,
    staircase_predictor,
)
from benchmarks.long_run.host import Calls, Host
from hybridsep.fmi.compiler import compile_flags

P, Q, LAM = 50, 3, 1e-12
BLOCK = 5000
SKIPPED = 200
"""Rows before the block: there the lags are not all measured yet."""

ERROR_MAX = 1e-9
LEAST_STEPS = 1_000_000
"""Steps of which a twentieth is whole rounds of the motion, five of them: its first ones are another task."""
GROWTH_MAX = 1.01
"""Of the RMS error of predictions, from the second twentieth of the steps to the last."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=100_000_000, help="samples folded; a multiple of 5000")
    parser.add_argument("--steps", type=int, default=100_000_000, help="samples the whole FMU is stepped")
    options = parser.parse_args()
    if options.samples < BLOCK or options.samples % BLOCK:
        parser.error(f"--samples must be a multiple of {BLOCK}, got {options.samples}")
    if options.steps < LEAST_STEPS or options.steps % LEAST_STEPS:
        parser.error(f"--steps must be a multiple of {LEAST_STEPS}, got {options.steps}")
    require_extended_precision()
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    command = compiler.split() if compiler else [sys.executable, "-m", "ziglang", "cc"]
    x_d, x = staircase_log(SKIPPED + BLOCK)
    x_pb = physics_response(staircase_predictor(P, Q), x_d)
    rows = feature_rows(x_pb, x - x_d[0] - x_pb, P, Q)[SKIPPED:]

    table = Table(title=f"C core, n = {2 + Q + P} (p = {P}, q = {Q}), λ = {LAM:g} m²")
    for heading in ("samples", "", "µs per sample", "‖w − w*‖/‖w*‖", "allocator calls: before", "after"):
        table.add_column(heading, justify="right" if heading else "left")
    worst, calls = 0.0, []

    def add(samples: int, what: str, seconds: float, error: str, counted: Calls) -> None:
        calls.append(counted)
        took = f"{1e6 * seconds / samples:.3f}"
        table.add_row(f"{samples:.0e}", what, took, error, str(counted.before), str(counted.after))

    with tempfile.TemporaryDirectory(prefix="hsep_long_run_") as name:
        host = Host(Path(name), command, compile_flags(command))
        for samples in sorted({min(10**6, options.samples), min(10**7, options.samples), options.samples}):
            begin = perf_counter()
            weights, counted = host.fold(rows, LAM, samples // BLOCK)
            seconds = perf_counter() - begin
            error = relative_error(weights, exact_weights(rows, LAM, samples // BLOCK))
            worst = max(worst, error)
            add(samples, "rows folded", seconds, f"{error:.1e}", counted)
        runs = {}
        for trust in (False, True):
            begin = perf_counter()
            counted = host.step(options.steps, trust)
            what = f"fmi2DoStep, with its values, trust = {str(trust).lower()}"
            add(options.steps, what, perf_counter() - begin, "", counted)
            runs[trust] = counted
    console = Console(width=110)
    console.print(table)
    taken = sum(counted.after for counted in calls)
    checks = [
        (worst <= ERROR_MAX, f"weights within {worst:.1e} of the exact ones, limit ≤ {ERROR_MAX:g}"),
        (taken == 0, f"{taken} calls of the allocator after the initialization, limit 0"),
        *(
            (
                run.late <= GROWTH_MAX * run.early,
                f"trust = {str(trust).lower()}: RMS error of predictions {1e6 * run.early:.4f} µm early,"
                f" {1e6 * run.late:.4f} µm late, limit ≤ {GROWTH_MAX} times",
            )
            for trust, run in runs.items()
        ),
        (all(counted.before > 0 for counted in calls), "the calls before it were seen, so the count works"),
    ]
    for held, text in checks:
        console.print(f"{'held  ' if held else 'MISSED'} {text}", highlight=False)
    return 0 if all(held for held, _ in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
