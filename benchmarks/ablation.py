"""Ablation of the model with trust: each of its rules switched off, or its constant changed, one at a time.

    python -m benchmarks.ablation [--emps DATA_EMPS.mat] [--recordings FOLDER] [--n 12] [--seed 7] [--only TEXT]

Cases of ``benchmarks/trust.py`` and random drives of both generators, whole runs, cold and warm; RMS relative to the
physics model's, geometric means and the worst cold one. Constants may be chosen on ``cnc_a_*``, ``xl330_sin_sin_*``,
the simulated cases and drives of one seed; the others judge. Half an hour for all of it.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # benchmarks are no part of the package

import numpy as np

from benchmarks.random_drives.generators import GENERATORS
from benchmarks.trust import cases
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.trust.constants import CONSTANTS, TrustConstants
from hybridsep.predict.trust.saved import SavedTrustedModel

CHOOSE = ("cnc_a", "xl330_sin_sin")
"""Beginnings of the names of recordings that constants may be chosen on."""

COPIES = "raw_jitter"
"""Part of the name of a recording that is a copy of another."""

VARIANTS = {
    "as it is": CONSTANTS,
    "rows are independent": replace(CONSTANTS, correlation_max=1.0),
    "predictions hardly bounded": replace(CONSTANTS, bound=100.0, bound_of_command=100.0),
    "velocities never outgrown": replace(CONSTANTS, growth=1e12, growth_learned=1e12),
    "earlier runs never doubted": replace(CONSTANTS, doubt=2.0),
    "earlier runs sooner doubted": replace(CONSTANTS, doubt=0.25),
    "every measurement is believed": replace(CONSTANTS, reach_steps=1e12),
    "5 lags of the command": replace(CONSTANTS, lags_of_command=5),
    "50 lags of the command": replace(CONSTANTS, lags_of_command=50),
    "kappa 0.3": replace(CONSTANTS, kappa=0.3),
    "kappa 3": replace(CONSTANTS, kappa=3.0),
    "gamma 0.9": replace(CONSTANTS, gamma=0.9),
    "gamma 0.98": replace(CONSTANTS, gamma=0.98),
    "L from the first": replace(CONSTANTS, first_lagged=1.0, first_static=0.0),
    "S from the first": replace(CONSTANTS, first_lagged=0.0, first_static=1.0),
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
    parser.add_argument("--n", type=int, default=12, help="random drives of each generator")
    parser.add_argument("--seed", type=int, default=7, help="of the random drives")
    parser.add_argument("--only", default="", help="rows whose name has this text")
    parser.add_argument("--lines", action="store_true", help="a line for each axis, too")
    given = parser.parse_args(arguments)
    axes = list(axes_of(given.emps, given.recordings, given.n, given.seed))
    groups = sorted({axis.group for axis in axes})
    print("| cold / warm, × physics | " + " | ".join(groups) + " |\n|---|" + "---|" * len(groups))
    for name, constants in VARIANTS.items():
        if given.only not in name:
            continue
        errors = [relative_errors(axis, constants) for axis in axes]
        print(_row(name, axes, errors, groups), flush=True)
        for axis, (cold, warm) in zip(axes, errors, strict=True) if given.lines else ():
            print(f"  {axis.name:44} {cold:.3f} {warm:.3f}")


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


def relative_errors(axis: Axis, constants: TrustConstants) -> tuple[float, float]:
    """Return the errors cold and warm relative to the physics model's in the cold run."""
    predictor = HybridPredictor(axis.model, axis.settings)
    predictor.residual = SavedTrustedModel(predictor.settings, predictor.discrete, (), constants)
    cold = backtest(predictor, axis.x_d, axis.x_meas[0])
    predictor.restart()
    warm = backtest(predictor, axis.x_d, axis.x_meas[1])
    physics = rms(axis.x_meas[0] - cold.x_pb)
    return rms(axis.x_meas[0] - cold.x_h) / physics, rms(axis.x_meas[1] - warm.x_h) / physics


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
