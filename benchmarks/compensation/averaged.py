"""Benchmark of compensation with the averaged model, by the settings of the machine files.

    python -m benchmarks.compensation.averaged [--seeds 1] [--first-seed 0] [--only TEXT]      (15 minutes a seed)

Tracking RMS of the true position in µm, cold and warm, mean over the seeds, beside the physics model's plans and the
limits; the exit code is 1 if one is missed. The stage's friction follows the command, or the actual velocity.
"""

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.averaging import circle, random_moves, short_staircase, with_friction_on
from benchmarks.compensation.loops import Case, LibraryLoops
from benchmarks.compensation.run import CASES, LESS_THAN_5_PERCENT_WORSE, UM, Report, excess
from hybridsep.base.metrics import largest
from hybridsep.base.signals import Array
from hybridsep.machines.machine import Machine, load_machine
from hybridsep.plants.trajectory import spiral, staircase

NO_WORSE = 1.02  # largest RMS relative to the physics model's plans, where there is no figure
OUTLIER_MOVES = 5.0  # largest change of x_dm by an outlier of 1 mm, µm
LATE = 5  # samples by which a late measurement is late, which the compensator knows; the same figures are asked of it


@dataclass(frozen=True)
class Row:
    """Machine, path and disturbance, with the largest RMS cold and warm, µm; none: relative to the physics model."""

    name: str
    machine: Machine
    x_d: Array
    limits: tuple[float, float] | None = None
    case: Case | None = None
    worse: float = NO_WORSE


def rows() -> Iterator[Row]:
    """Yield the cases."""
    drive = load_machine("spring_mass_damper")
    yield Row("staircase", drive, staircase(), (4.2, 0.5))
    yield Row(f"staircase, {LATE} samples late", _late(drive), staircase(), (4.2, 0.5))
    yield Row("staircase of 7 mm", drive, short_staircase())
    for name, case in CASES.items():
        yield Row(name, drive, staircase(), case=case, worse=LESS_THAN_5_PERCENT_WORSE)
    yield Row("outlier of 1 mm", drive, staircase(), (OUTLIER_MOVES, OUTLIER_MOVES), Case(outlier=(1050, 1e-3)))
    axes = load_machine("als25010_x"), load_machine("als25010_y")
    for kind, limits in (("command", ((6.0, 1.6), (30.0, 12.0))), ("motion", ((9.5, 7.0), (85.0, 77.0)))):
        paths: tuple[tuple[str, tuple[Array, Array]], ...] = (
            ("circle", circle()),
            ("second spiral", spiral(radius=0.02, turns=8.0)),
            ("staircase of 7 mm", (short_staircase(),) * 2),
            ("random moves", (random_moves(1), random_moves(2))),
        )
        for i, axis in enumerate("XY"):
            stage, label = with_friction_on(axes[i], kind), f"{axis}, friction on the {kind}"
            yield Row(f"{label}: spiral", stage, spiral()[i], limits[i])
            yield Row(f"{label}: spiral, {LATE} samples late", _late(stage), spiral()[i], limits[i])
            for name, path in paths:
                yield Row(f"{label}: {name}", stage, path[i])


def _late(machine: Machine) -> Machine:
    return machine.changed("compensator", {"measurement_delay": LATE})


def measured(row: Row, seed: int) -> tuple[float, float, float, float]:
    """Return the RMS of the physics model's plan, cold and warm, µm, and how far a limit is exceeded, relative to it.

    With an outlier, the largest changes of ``x_dm`` by it instead of the RMS.
    """
    loops, case = LibraryLoops(), row.case or Case()
    physics = loops.run(row.machine, row.x_d, "physics", seed, 1, case)[0].tracking_rms
    runs = loops.run(row.machine, row.x_d, "hybrid", seed, 2, case)
    figures = [run.tracking_rms for run in runs]
    if case.outlier is not None:
        sound = loops.run(row.machine, row.x_d, "hybrid", seed, 2, replace(case, outlier=None))
        figures = [largest(run.x_dm - other.x_dm) for run, other in zip(runs, sound, strict=True)]
    limits, change_max = row.machine.command_limits()
    beyond = max(excess(run, (case.limits or limits, change_max), row.machine.T_s) for run in runs)
    return UM * physics, UM * figures[0], UM * figures[1], beyond


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1, help="noise seeds to average over")
    parser.add_argument("--first-seed", type=int, default=0, help="the first of them")
    parser.add_argument("--only", default="", help="only the cases whose name has this text")
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    report, cases = Report(), [row for row in rows() if options.only in row.name]
    with ProcessPoolExecutor() as pool:
        found = [[pool.submit(measured, row, seed) for seed in seeds] for row in cases]
        for row, futures in zip(cases, found, strict=True):
            results = np.array([future.result() for future in futures])
            physics, cold, warm, _ = results.mean(axis=0).tolist()
            beyond = float(results[:, 3].max())
            most = row.limits or (row.worse * physics,) * 2
            report.most(f"{row.name}, cold", cold, most[0], f"physics {physics:.2f}")
            kept = "" if beyond <= 1e-9 else f"a limit of the drive is exceeded by {beyond:.1e}"
            report.most(f"{row.name}, warm", warm, most[1], kept)
            sys.stdout.flush()
    for text in report.missed:
        print(f"missed: {text}")
    return 1 if report.missed else 0


if __name__ == "__main__":
    sys.exit(main())
