"""Tuning of 1 000 candidates in one pass, beside replays one by one, and in constant memory.

    python benchmarks/tune.py [--emps DATA_EMPS.mat] [--samples 10000000]      (five minutes)

The log is EMPS, 24 841 samples, or as many of the staircase drive; ``p`` 5 to 100, ``q`` 0 to 8, ``λ`` 1e-14 to 1e-5,
with ``Np = 100``. Times are process times, in which other work on the machine counts less, each the median of runs by
turns. One by one is the mean time of randomly drawn candidates times the number of all; their losses are compared with
those of the pass, and with those of the same backtest when measured positions change by a unit in their last place.
Then a log of ``--samples`` samples in memory: what the process uses beyond it, at a tenth and at the end. Exit status 1
if a figure is missed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time
from typing import TypeVar

os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # benchmarks are no part of the package

import numpy as np

from benchmarks.common import Array, resident_bytes, staircase_log
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import Machine
from hybridsep.machines.paper import paper_machine
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.tune.losses import nested_losses

T = TypeVar("T")

P, Q, LAMBDA = tuple(range(5, 101, 5)), (0, 1, 3, 5, 8), tuple(float(f"1e{i}") for i in range(-14, -4))
RUNS = 3
ONE_BY_ONE = 40
"""Candidates that are replayed one by one."""

FASTER_MIN, MULTIPLE_AIM, ERROR_MAX = 20.0, 15.0, 1e-9
GROWTH_MAX = 1_000_000
"""Bytes by which the memory may differ between a tenth of the log and its end: a few of the allocator's pages."""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    parser.add_argument("--samples", type=int, default=10_000_000, help="of the long log; 0 for none")
    given = parser.parse_args(arguments)
    machine, x_d, x = recorded(given.emps) if given.emps else simulated(24_841)
    held = compare(machine, x_d, x)
    if given.samples:
        held &= stays_flat(given.samples)
    print("held" if held else "MISSED")
    return 0 if held else 1


def recorded(path: Path) -> tuple[Machine, Array, Array]:
    machine = paper_machine("emps")
    log = read_log(path, columns=machine.log.columns)
    return machine, log.x_d, log.x_meas


def simulated(n: int) -> tuple[Machine, Array, Array]:
    return paper_machine("spring_mass_damper"), *staircase_log(n)


def compare(machine: Machine, x_d: Array, x: Array) -> bool:
    """Print times and differences of a pass and of replays one by one; return whether the figures are held."""
    base = replace(machine.predictor_settings, Np=100, trust=False)
    tried = [replace(base, p=p, q=q, lam=lam) for lam in LAMBDA for q in Q for p in P]
    largest = max(tried, key=lambda one: (one.p, one.q))
    rng = np.random.default_rng(0)
    drawn = rng.choice(len(tried), ONE_BY_ONE, replace=False).tolist()

    def rms_h(settings: PredictorSettings, measured: Array = x) -> float:
        return backtest(HybridPredictor(machine.model, settings), x_d, measured).overall.rms_h

    rms_h(largest)  # what is loaded late is loaded
    once, passes, alone = [], [], []
    for i in range(RUNS):
        once.append(timed(lambda: rms_h(largest))[0])
        seconds, found = timed(lambda: nested_losses(machine.model, [(x_d, x)], tried).rms_h)
        passes.append(seconds)
        alone += [timed(lambda j=j: (rms_h(tried[j]), j)) for j in drawn[i::RUNS]]  # type: ignore[misc]
    one, whole = statistics.median(once), statistics.median(passes)
    each = statistics.mean(seconds for seconds, _ in alone)
    error = max(abs(float(found[j]) / loss - 1.0) for _, (loss, j) in alone)
    # One unit in the last place of a double, up or down or not at all, in each measured position
    rounded = x + rng.choice([-1.0, 0.0, 1.0], len(x)) * np.spacing(x)
    sensitivity = max(abs(rms_h(tried[j], rounded) / loss - 1.0) for _, (loss, j) in alone)
    print(f"{machine.name}: {len(x)} samples, {len(tried)} candidates, losses {found.min():.4g} … {found.max():.4g} m")
    print(f"one backtest, p = {largest.p}, q = {largest.q}   {one:8.3f} s")
    print(f"one pass for all candidates   {whole:8.3f} s   {whole / one:.1f} × one backtest, aim {MULTIPLE_AIM:g}")
    total = each * len(tried)
    print(
        f"one by one                    {total:8.1f} s   {total / whole:.1f} × the pass, at least {FASTER_MIN:g}; "
        f"from {len(alone)} candidates, {each:.3f} s each"
    )
    print(f"largest relative difference of their losses {error:.1e}, at most {ERROR_MAX:g}")
    print(f"the same of a backtest after a change in the last binary digit of x {sensitivity:.1e}")
    return total >= FASTER_MIN * whole and error <= ERROR_MAX


def stays_flat(n: int) -> bool:
    """Print the memory that a pass over a long log takes; return whether it stays the same."""
    machine, x_d, x = simulated(n)
    base = replace(machine.predictor_settings, Np=100, trust=False)
    tried = [replace(base, p=p, q=q, lam=lam) for lam in (1e-12, 1e-9) for q in (0, 3) for p in (5, 10, 20)]
    memory = {0.1: 0, 0.99: 0}
    before = resident_bytes()

    def watch(done: float) -> None:
        for at in memory:
            if done >= at and not memory[at]:
                memory[at] = resident_bytes() - before

    begin = perf_counter()
    losses = nested_losses(machine.model, [(x_d, x)], tried, watch)
    seconds = perf_counter() - begin
    early, late = memory.values()
    print(
        f"{n:,} samples, {len(tried)} candidates: {1e6 * seconds / n:.2f} µs a sample, least loss "
        f"{losses.rms_h.min():.4g} m; beyond the log {early / 1e6:.2f} MB after a tenth, {late / 1e6:.2f} MB at the "
        f"end, growth at most {GROWTH_MAX / 1e6:g} MB (the log itself: {2 * x.nbytes / 1e6:.0f} MB)"
    )
    return late - early <= GROWTH_MAX


def timed(run: Callable[[], T]) -> tuple[float, T]:
    """Return the process time that a function takes, s, and what it returns."""
    begin = process_time()
    result = run()
    return process_time() - begin, result


if __name__ == "__main__":
    sys.exit(main())
