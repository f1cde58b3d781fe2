"""Coverage of the intervals ``x_h ± z·x_h_std`` of the predictor with averaging.

    python -m benchmarks.intervals [--emps DATA_EMPS.mat] [--n 300] [--generator modal] [--seed 1]

Percent of the measured positions within the intervals of 50, 90 and 95 %, over the whole window and over each third of
it: of the warm runs of ``benchmarks/averaging.py``, and pooled over cold runs of random drives.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.averaging import cases
from benchmarks.random_drives import GENERATORS
from hybridsep.base.metrics import coverage
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor

LEVELS = (0.5, 0.9, 0.95)
THIRDS = ("whole window", "first third", "second third", "last third")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat: the recorded axis, too")
    parser.add_argument("--n", type=int, default=0, help="number of random drives")
    parser.add_argument("--generator", choices=tuple(GENERATORS), default="modal", help="of the random drives")
    parser.add_argument("--seed", type=int, help="the generator's own if left out")
    chosen = parser.parse_args(arguments)
    print(f"{'% within 50, 90, 95 %':40}" + "".join(f"{part:>22}" for part in THIRDS))
    for name, error, std in warm_runs(chosen.emps):
        print(row(name, error, std), flush=True)
    if chosen.n:
        pooled = [
            np.concatenate(parts, axis=1)
            for parts in zip(*random_runs(chosen.n, chosen.generator, chosen.seed), strict=True)
        ]
        print(row(f"{chosen.n} random drives, cold", *pooled))


def warm_runs(emps: Path | None) -> Iterator[tuple[str, Array, Array]]:
    """Yield name, errors and standard deviations, m, of the warm runs."""
    for case in cases(emps):
        predictor = HybridPredictor(case.model, replace(case.settings, averaging=True, t_init=-1.0))
        backtest(predictor, case.x_d, case.x_meas[0])
        predictor.restart()
        yield (case.name, *run(predictor, case.x_d, case.x_meas[1]))


def random_runs(n: int, name: str, seed: int | None) -> Iterator[tuple[Array, Array]]:
    """Yield errors and standard deviations, m, of the cold runs of random drives."""
    generator = GENERATORS[name]
    seed = generator.seed if seed is None else seed
    for drive in generator.drives_at(range(n), generator.true_positions(range(n), seed=seed), seed):
        yield run(HybridPredictor(drive.model, drive.settings), drive.x_d, drive.x_meas)


def run(predictor: HybridPredictor, x_d: Array, x: Array) -> tuple[Array, Array]:
    """Return the errors of a run and their deviations, m, ``(3, n)``: NaN but in a third of the window each."""
    result = backtest(predictor, x_d, x)
    third = np.arange(len(x)) % predictor.Np * 3 // predictor.Np
    here = third == np.arange(3)[:, None]
    return np.where(here, x - result.x_h, np.nan), np.where(here, result.x_h_std, np.nan)


def row(name: str, error: Array, std: Array) -> str:
    """Return the coverage at each level, %, over the whole window and each third of it."""
    parts = [(error.ravel(), std.ravel()), *zip(error, std, strict=True)]
    cells = ["  ".join(f"{100 * coverage(*part, level):5.1f}" for level in LEVELS) for part in parts]
    return f"{name:40}" + "".join(f"{cell:>22}" for cell in cells)


if __name__ == "__main__":
    main()
