"""Benchmark of the experts beside the model with trust, with one thing changed at a time.

    python -m benchmarks.experts.run [--emps DATA_EMPS.mat] [--recordings FOLDER] [--n 30] [--seed 7] [--lines]

Cases of ``benchmarks/trust.py`` and random drives of both generators, whole runs, cold and warm; RMS relative to the
physics model's, geometric means. Constants may be chosen on ``cnc_a_*``, ``xl330_sin_sin_*``, the simulated cases and
drives of one seed; the others judge.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no part of the package

import numpy as np

from benchmarks.experts.model import Constants, Experts
from benchmarks.random_drives.generators import GENERATORS
from benchmarks.trust import cases
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor

CHOOSE = ("cnc_a", "xl330_sin_sin")
"""Beginnings of the names of recordings that constants may be chosen on."""

COPIES = "raw_jitter"
"""Part of the name of a recording that is a copy of another."""

VARIANTS = {
    "as it is": Constants(),
    "without S": Constants({"hold": 0.0, "L": 0.5, "A": 0.0}),
    "without A": Constants({"hold": 0.0, "L": 0.5, "S": 0.5}),
    "without L": Constants({"hold": 0.0, "S": 0.5, "A": 0.0}),
    "without hold": Constants({"L": 0.5, "S": 0.5, "A": 0.0}),
    "A from the first": Constants({"hold": 0.0, "L": 0.4, "S": 0.4, "A": 0.2}),
    "rows independent": Constants(correlation_max=1.0),
    "not shrunk": Constants(shrink=0.0),
    "shrunk twice as much": Constants(shrink=2.0),
    "kappa 0.3": Constants(kappa=0.3),
    "kappa 3": Constants(kappa=3.0),
    "gamma 0.9": Constants(gamma=0.9),
    "gamma 0.98": Constants(gamma=0.98),
}
"""What is tried, by name."""


@dataclass(frozen=True)
class Axis:
    """Axis, its commands and measured positions of a cold and a warm run, ``(n,)``, m, and the group it belongs to."""

    group: str
    name: str
    model: ModalModel
    settings: PredictorSettings
    x_d: Array
    x_meas: tuple[Array, Array]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat")
    parser.add_argument("--recordings", type=Path, help="folder of recordings, *.csv with the columns t, x_d, x")
    parser.add_argument("--n", type=int, default=30, help="random drives of each generator")
    parser.add_argument("--seed", type=int, default=7, help="of the random drives")
    parser.add_argument("--lines", action="store_true", help="a line for each axis, too")
    given = parser.parse_args(arguments)
    axes = list(axes_of(given.emps, given.recordings, given.n, given.seed))
    today = [_trusted(axis) for axis in axes]
    groups = sorted({axis.group for axis in axes})
    print("| cold / warm, × physics | " + " | ".join(groups) + " |\n|---|" + "---|" * len(groups))
    print(_row("model with trust", axes, today, groups), flush=True)
    for name, constants in VARIANTS.items():
        errors = [_stacked(axis, constants) for axis in axes]
        print(_row(name, axes, errors, groups), flush=True)
        for axis, one, other in zip(axes, errors, today, strict=True) if given.lines else ():
            print(f"  {axis.name:40} {one[0]:.3f} {one[1]:.3f}, with trust {other[0]:.3f} {other[1]:.3f}")


def axes_of(emps: Path | None, recordings: Path | None, n: int, seed: int) -> Iterator[Axis]:
    """Yield all axes."""
    for case in cases(emps, recordings):
        if COPIES in case.name:
            continue
        group = "simulated"
        if case.x_meas[0] is case.x_meas[1]:
            group = "recordings to choose on" if case.name.startswith(CHOOSE) else "recordings that judge"
        yield Axis(group, case.name, case.model, replace(case.settings, trust=True, t_init=-1.0), case.x_d, case.x_meas)
    for kind, generator in GENERATORS.items():
        for drive in generator.drives_at(range(n), generator.true_positions(range(n), seed=seed), seed):
            both = (drive.x_meas, drive.x_meas)
            yield Axis(f"drives, {kind}", f"{kind} {drive.index}", drive.model, drive.settings, drive.x_d, both)


def _trusted(axis: Axis) -> tuple[float, float]:
    """Return the errors of the model with trust, cold and warm, relative to the physics model's in the cold run."""
    predictor = HybridPredictor(axis.model, axis.settings)
    cold = backtest(predictor, axis.x_d, axis.x_meas[0])
    predictor.restart()
    warm = backtest(predictor, axis.x_d, axis.x_meas[1])
    return _relative(axis, cold.x_pb, cold.x_h, warm.x_h)


def _stacked(axis: Axis, constants: Constants) -> tuple[float, float]:
    """Return those of the experts."""
    experts = Experts(axis.model, axis.settings, constants)
    cold, x_pb, _ = experts.replay(axis.x_d, axis.x_meas[0])
    warm, _, _ = experts.replay(axis.x_d, axis.x_meas[1])
    return _relative(axis, x_pb, cold, warm)


def _relative(axis: Axis, x_pb: Array, cold: Array, warm: Array) -> tuple[float, float]:
    physics = rms(axis.x_meas[0] - x_pb)
    return rms(axis.x_meas[0] - cold) / physics, rms(axis.x_meas[1] - warm) / physics


def _row(name: str, axes: Sequence[Axis], errors: Sequence[tuple[float, float]], groups: Sequence[str]) -> str:
    """Return a row: geometric means of each group, and the worst cold one."""
    cells = []
    for group in groups:
        of_group = np.array([one for axis, one in zip(axes, errors, strict=True) if axis.group == group])
        cold, warm = np.exp(np.mean(np.log(of_group), axis=0))
        cells.append(f"{cold:.3f} / {warm:.3f} (worst {of_group[:, 0].max():.2f})")
    return f"| {name} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
