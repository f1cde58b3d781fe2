"""Benchmark of one BLAS thread against two, in the regression and in a closed loop.

Run with ``python benchmarks/blas_threads.py``, or with ``--busy`` while as many processes as the machine has cores
compete. The package itself uses one thread around every window, whatever is set; here its limit counts as begun
before the number of threads is set, so that it changes nothing.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from benchmarks.common import Array, staircase_log, staircase_predictor
from hybridsep.base.threads import one_blas_thread
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.machines.machine import load_machine

N_WINDOWS = 40
REPETITIONS = 7


def replay(p: int, q: int, x_d: Array, x: Array) -> tuple[int, Array]:
    """Predict and learn window by window; return the number of samples and the weights."""
    predictor = staircase_predictor(p, q)
    n = N_WINDOWS * predictor.Np
    for k in range(0, n, predictor.Np):
        predictor.predict(x_d[k : k + predictor.Np])
        predictor.update(x[k : k + predictor.Np])
    return n, predictor.weights


def plans(x_d: Array, x: Array) -> tuple[int, Array]:
    """Plan and learn window by window; return the number of samples and the last plan."""
    compensator: SepCompensator = load_machine("spring_mass_damper").new_compensator()
    Np = compensator.predictor.Np
    for k in range(0, N_WINDOWS * Np, Np):
        plan = compensator.plan(x_d[k : k + compensator.preview])
        compensator.update(x[k : k + Np])
    return N_WINDOWS * Np, plan.x_dm


def seconds(run: Callable[[], tuple[int, Array]], n_threads: int) -> tuple[float, bytes]:
    """Return the seconds a sample takes with so many threads, and the bits of what came out."""
    with one_blas_thread, threadpool_limits(n_threads, user_api="blas"):
        begin = perf_counter()
        n, result = run()
        return (perf_counter() - begin) / n, np.ascontiguousarray(result).tobytes()


def main() -> None:
    """Print one row for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--busy", action="store_true", help="let one other process a core compete")
    options = parser.parse_args()
    x_d, x = staircase_log((N_WINDOWS + 10) * 100)
    cases: list[tuple[str, Callable[[], tuple[int, Array]]]] = [
        ("regression, n = 55", lambda: replay(50, 3, x_d, x)),
        ("regression, n = 201", lambda: replay(100, 99, x_d, x)),
        ("compensator", lambda: plans(x_d, x)),
    ]
    title = "BLAS threads: µs a sample, median" + (", all cores busy" if options.busy else "")
    table = Table(title=title)
    for heading in ("case", "1 thread", "2 threads", "ratio", "same bits"):
        table.add_column(heading, justify="left" if heading == "case" else "right")
    with ExitStack() as stack:
        for _ in range((os.cpu_count() or 1) if options.busy else 0):
            process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(process.kill)
        for name, run in cases:
            pairs = [(seconds(run, 1), seconds(run, 2)) for _ in range(REPETITIONS)]
            one, two = (1e6 * median(pair[i][0] for pair in pairs) for i in (0, 1))
            ratio = median(pair[1][0] / pair[0][0] for pair in pairs)
            same = len({bits for pair in pairs for _, bits in pair}) == 1
            table.add_row(name, f"{one:.2f}", f"{two:.2f}", f"{ratio:.2f}", "yes" if same else "no")
    Console().print(table)


if __name__ == "__main__":
    main()
