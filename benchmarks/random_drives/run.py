"""Benchmark of trust: the predictor replayed on random nonlinear drives whose physics model is 20 or 40 % wrong.

    python -m benchmarks.random_drives.run [--n 1000] [--faults] [--predictor default] [--core] [--cache FILE]
    python -m benchmarks.random_drives.run --generator two_mass [--peers] …

Drives are of 1 to 4 modes with a model 20 % wrong, at 1 kHz, or of two masses in a cascaded position loop with a model
40 % wrong, at 250 Hz to 8 kHz. RMS against the measured position over the whole run, relative to the physics model
alone, to the hold (the physics model plus the last measured residual, in every window from the first) and with
``--peers`` to the best of hold and two ARX models in hindsight.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no part of the package

from benchmarks.random_drives.cache import read_positions, write_positions
from benchmarks.random_drives.generators import GENERATORS
from benchmarks.random_drives.replay import PREDICTORS, FaultyReplay, Replay, library_replay, replay, replay_faults
from benchmarks.random_drives.report import print_faults, print_replays
from hybridsep.base.signals import Array

Results = tuple[list[Replay], list[FaultyReplay]]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generator", choices=tuple(GENERATORS), default="modal", help="of the drives")
    parser.add_argument("--seed", type=int, help="the generator's own if left out")
    parser.add_argument("--n", type=int, help="number of drives, 1000 or 250")
    parser.add_argument("--faults", action="store_true", help="with each fault of the sensor too")
    parser.add_argument("--predictor", choices=tuple(PREDICTORS), default="default")
    parser.add_argument("--core", action="store_true", help="the C core instead of the library")
    parser.add_argument("--peers", action="store_true", help="beside ARX models of 20 and 40 lags, too")
    parser.add_argument("--cache", type=Path, help="file (.npz) of simulated positions, written if there is none")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    chosen = parser.parse_args(arguments)
    generator = GENERATORS[chosen.generator]
    seed = generator.seed if chosen.seed is None else chosen.seed
    n = generator.n if chosen.n is None else chosen.n
    size = min(generator.chunk, -(-n // chosen.processes))
    groups = [range(i, min(i + size, n)) for i in range(0, n, size)]
    with ProcessPoolExecutor(chosen.processes, get_context("spawn")) as pool:
        x = read_positions(chosen.cache, chosen.generator, seed, n) if chosen.cache else None
        if x is None:
            x = [one for group in pool.map(partial(generator.true_positions, seed=seed), groups) for one in group]
            if chosen.cache:
                write_positions(chosen.cache, chosen.generator, seed, x)
        chosen.seed = seed
        task = partial(_results, chosen=chosen)
        results = list(pool.map(task, groups, [x[group.start : group.stop] for group in groups]))
    print_replays([replayed for group, _ in results for replayed in group], chosen.predictor)
    if chosen.faults:
        print_faults([replayed for _, group in results for replayed in group])


def _results(indices: range, x: Sequence[Array], *, chosen: argparse.Namespace) -> Results:
    """Return the results of drives whose true positions are known."""
    run = library_replay
    if chosen.core:
        from benchmarks.random_drives.core import core_replay as run
    drives, predictor = GENERATORS[chosen.generator].drives_at(indices, x, chosen.seed), chosen.predictor
    faulty = (
        [one for drive in drives for one in replay_faults(drive, chosen.seed, predictor, run)] if chosen.faults else []
    )
    return [replay(drive, predictor, run, peers=chosen.peers) for drive in drives], faulty


if __name__ == "__main__":
    main()
