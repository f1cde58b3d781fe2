"""Benchmark of the whole way: a log of a drive, ``hybridsep.fit``, its compensator FMU, another program of the drive.

    python -m benchmarks.from_log [--n 40] [--seed 31001] [--faster 1]      (seven minutes on two cores)

Drives of two masses at up to 2.5 kHz. The log has up to 8 s of a drive's own trajectory, as its encoder shows it,
without compensation; nothing else of the drive is known. The other program is that trajectory backwards, ``--faster``
times as fast, 2.5 s of it from where it moves, from rest to rest. RMS and largest tracking error of the true position,
relative to no compensation: with plans of the physics model, with the hybrid, cold, and warm by what ``fit`` learned.
"""

import argparse
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from two_mass.generator import Recipe
from two_mass.plant import TwoMassDrive

from benchmarks.two_mass_loops import SPARE
from hybridsep.base.errors import LogError
from hybridsep.base.metrics import ErrorSize, peak_derivatives
from hybridsep.base.settings import DRIVE_LIMIT_ENTRIES, PARAMETERS
from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.fitting.fit import fit
from hybridsep.fmi.archive import build_here

LOG, PROGRAM = 8.0, 2.5  # longest log, and longest program after it, s
BEFORE, AFTER = 0.05, 0.2  # rests before and after the program, s
EASED = 0.25  # in which it comes up to the trajectory's speed, and in which it stops, s
FASTEST = 2500.0  # largest sampling rate, Hz
RUNS = {"off": ("off", False), "physics": ("physics", False), "cold": ("hybrid", False), "warm": ("hybrid", True)}
"""Best model allowed, and whether it begins with what was learned."""


class Result(NamedTuple):
    """Drive."""

    drive: int
    told: str  # structure of the physics model, or why ``fit`` refuses the log
    sizes: dict[str, ErrorSize]  # by the keys of :data:`RUNS`, m; empty where the log is refused


def other_program(x_d: Array, T_s: float, faster: float) -> Array:
    """Return a trajectory backwards, ``(n,)``, m, ``faster`` times as fast, that begins and ends at rest."""
    backwards = x_d[::-1] - x_d[-1]
    first, n_eased, n = int(np.argmax(np.abs(backwards) > 1e-6)), round(EASED / T_s), round(PROGRAM / T_s)
    at = np.linspace(0.0, 1.0, n_eased)
    speed = np.concatenate((rise := at**3 * (10.0 - 15.0 * at + 6.0 * at**2), np.ones(n - 2 * n_eased), rise[::-1]))
    time = np.minimum(first + np.cumsum(faster * speed), len(x_d) - 1.0)
    part = np.asarray(CubicSpline(np.arange(len(x_d)), backwards)(time))
    return np.concatenate((np.full(round(BEFORE / T_s), part[0]), part, np.full(round(AFTER / T_s), part[-1])))


def result(seed: int, faster: float, index: int) -> Result:
    """Return the result of a drive."""
    recipe = Recipe.draw(index, seed)
    T_s, quantum, noise = recipe.axis.T_s, recipe.encoder.quantum, recipe.noise.tolist()
    x_d = recipe.x_d[: round(LOG / T_s)]
    drive = TwoMassDrive(recipe.axis, float(x_d[0]))

    def measured(k: int, x: float) -> float:
        return float(quantum * round((x + noise[k % len(noise)]) / quantum))

    log = np.array([measured(k, x) for k, x in enumerate(drive.run(x_d).tolist())])
    names = [one.name for one in DRIVE_LIMIT_ENTRIES.values()][:3]
    of_program = np.array(SPARE) * faster ** np.arange(1, 4) * peak_derivatives(x_d, T_s)
    limits = dict(zip(names, of_program.tolist(), strict=True))
    try:
        found = fit(x_d, log, T_s=T_s, unit="m", **limits)
    except LogError as error:
        return Result(index, str(error), {})
    program, sizes = other_program(x_d, T_s, faster), {}
    with tempfile.TemporaryDirectory(prefix="hsep_from_log_") as folder:
        weights = Path(folder) / "weights.state"
        weights.write_bytes(found.trained)
        fmus = [
            build_here(found.machine, "SepCompensator", Path(folder) / f"{warm:d}", weights=weights if warm else None)
            for warm in (False, True)
        ]
        for name, (compensate, is_warm) in RUNS.items():
            values = {"compensate": PARAMETERS["compensate"].to_fmi(compensate)}
            run = cosimulate(fmus[is_warm], drive, program, controller_values=values, sensor=measured)
            sizes[name] = ErrorSize.of(run.x_d - run.x)
    return Result(index, found.identification.structure, sizes)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each drive, and means, 95 % and largest of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=40, help="drives that are drawn")
    parser.add_argument("--seed", type=int, default=31001, help="of the drives")
    parser.add_argument("--faster", type=float, default=1.0, help="speed of the program, relative to the log's")
    given = parser.parse_args(arguments)
    indices = [i for i in range(given.n) if Recipe.draw(i, given.seed).axis.T_s >= 1.0 / FASTEST]
    names, ratios = list(RUNS)[1:], []
    print(f"{'RMS / largest, × off':10}" + "".join(f"{name:>16}" for name in names) + f"{'warm / cold':>16}")
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for one in pool.map(partial(result, given.seed, given.faster), indices):
            if not one.sizes:
                print(f"{one.drive:20}   refused: {one.told}", flush=True)
                continue
            off, *others = (np.array([size.rms, size.largest]) for size in one.sizes.values())
            ratios.append([*(size / off for size in others), others[2] / others[1]])
            print(f"{one.drive:20}{cells(np.array(ratios[-1]))}   {one.told}", flush=True)
    table = np.array(ratios)
    for head, row in (
        ("mean", table.mean(axis=0)),
        ("95 %", np.quantile(table, 0.95, axis=0)),
        ("largest", table.max(axis=0)),
    ):
        print(f"{f'{head} of {len(table)}':>20}{cells(row)}")


def cells(row: Array) -> str:
    """Return the cells of a line."""
    return "".join(f"{f'{rms:.3f} / {largest:.3f}':>16}" for rms, largest in row)


if __name__ == "__main__":
    main()
