"""Benchmark of compensation in closed loop: the native SepCompensator on drives of two masses, sound and not.

    python -m benchmarks.two_mass_loops [--n 60] [--seed 2] [--only TEXT]      (ten minutes)

RMS and largest of the tracking error of the true position, relative to no compensation, and the largest relative to
that with ``compensate = physics``; without the samples of the last preview, whose trajectory ends while it moves. Warm:
with weights that were learned from a run without compensation.
"""

import argparse
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from two_mass.generator import SEED, Recipe
from two_mass.loop import CONDITIONS, SOUND, closed_loop, settings_of
from two_mass.plant import TwoMassDrive

from hybridsep.base.metrics import largest, peak_derivatives, rms
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.fmi.weights import weights_file
from hybridsep.predict.predictor import HybridPredictor

KEPT = 1e-7  # share by which a limit may be exceeded: third differences of positions round

RUNS = {"physics": ("physics", False), "hybrid": ("hybrid", False), "hybrid, warm": ("hybrid", True)}
"""Best model allowed, and whether it starts with learned weights; warm only where the drive is sound."""

UM = 1e6


@dataclass(frozen=True)
class Result:
    """A drive under a condition."""

    condition: str
    run: str
    index: int
    # (RMS, largest) of the tracking error, m: infinite where the compensator refused to go on
    none: tuple[float, float]
    physics: tuple[float, float]
    compensated: tuple[float, float]
    excess: float  # by how much the command exceeds a limit of the drive, relative to it; ≤ 0: by nothing

    @property
    def ratios(self) -> tuple[float, float, float]:
        """RMS and largest relative to none, and largest relative to the physics model's plans."""
        (of_rms, of_largest), none = self.compensated, self.none
        return of_rms / none[0], of_largest / none[1], of_largest / self.physics[1]

    def __str__(self) -> str:
        figures = (f"{UM * rms:.4g}, {UM * peak:.4g}" for rms, peak in (self.none, self.physics, self.compensated))
        return f"{self.condition}, {self.run}: {' / '.join(figures)} µm: drive {self.index}"


def results(index: int, seed: int, only: str = "") -> list[Result]:
    """Return the results of a drive under each condition whose name has a text."""
    recipe = Recipe.draw(index, seed)
    _, compensator, x_d = settings_of(recipe)
    assert compensator.limits is not None
    assert compensator.change_max is not None
    T_s, start, late = recipe.axis.T_s, float(x_d[0]), compensator.preview or 0
    limits = (compensator.limits.velocity, compensator.limits.acceleration, compensator.limits.jerk)

    def errors(x: Array) -> tuple[float, float]:
        error = (x_d - x)[: len(x_d) - late]
        return (rms(error), largest(error)) if np.isfinite(error).all() else (np.inf, np.inf)

    found = []
    for name, condition in CONDITIONS.items():
        if only not in name:
            continue
        axis, sensor = condition.axis(recipe.axis, x_d), condition.sensor(x_d, T_s)
        x = TwoMassDrive(axis, start).run(x_d)
        weights = _learned(recipe, x_d, x) if name == SOUND else None
        physics = (np.inf, np.inf)
        for run, (compensate, warm) in RUNS.items():
            if warm and weights is None:
                continue
            loop = closed_loop(recipe, axis, compensate, sensor, weights if warm else None)
            sent = loop.x_dm[np.isfinite(loop.x_dm)]
            excess = [peak / most - 1 for peak, most in zip(peak_derivatives(sent, T_s), limits, strict=True)]
            excess.append(largest(sent - x_d[: len(sent)]) / compensator.change_max - 1)
            physics = errors(loop.x) if run == "physics" else physics
            found.append(Result(name, run, index, errors(x), physics, errors(loop.x), max(excess)))
    return found


def _learned(recipe: Recipe, x_d: Array, x: Array) -> bytes:
    """Return the weights that a run without compensation leaves."""
    settings, _, _ = settings_of(recipe)
    predictor = HybridPredictor(recipe.model, settings, start=float(x_d[0]))
    quantum, n = recipe.encoder.quantum, len(x_d) // settings.Np * settings.Np  # whole windows
    backtest(predictor, x_d[:n], quantum * np.round((x[:n] + recipe.noise[:n]) / quantum))
    return weights_file(predictor)


def rows(found: Sequence[Result]) -> Iterator[str]:
    """Yield the lines of the table."""
    groups = (
        ("RMS × none", "median", "95 %", "worst"),
        ("largest × none", "median", "95 %", "worst"),
        ("largest × physics", "median", "> 1.02", "worst"),
    )
    yield f"{'':38}" + "".join(f"{title:>27}" for title, *_ in groups) + f"{'limits':>9}"
    yield f"{'':38}" + "".join(f"{name:>9}" for _, *names in groups for name in names) + f"{'kept':>9}"
    for condition in CONDITIONS:
        for run in RUNS:
            group = [r for r in found if (r.condition, r.run) == (condition, run)]
            if not group:
                continue
            ratios = np.array([r.ratios for r in group])
            median, most, worst = np.quantile(ratios, (0.5, 0.95, 1.0), axis=0, method="inverted_cdf")
            above = f"{100 * np.mean(ratios[:, 2] > 1.02):7.1f} %"
            cells = [f"{median[i]:9.3g}{most[i]:9.3g}{worst[i]:9.3g}" for i in (0, 1)]
            cells.append(f"{median[2]:9.3g}{above}{worst[2]:9.3g}")
            kept = np.mean([r.excess <= KEPT for r in group])
            yield f"{condition + ', ' + run:38}{''.join(cells)}{100 * kept:7.1f} %"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--n", type=int, default=60, help="number of drives")
    parser.add_argument("--only", default="", help="only the conditions whose name has this text")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    chosen = parser.parse_args(arguments)
    with ProcessPoolExecutor(chosen.processes, get_context("spawn")) as pool:
        of_drives = pool.map(partial(results, seed=chosen.seed, only=chosen.only), range(chosen.n))
        found = [one for of_drive in of_drives for one in of_drive]
    print(f"{chosen.n} drives")
    for line in rows(found):
        print(line)
    print("worst of sound drives; none / physics / this, RMS and largest:")
    for place in range(3):
        for r in sorted((r for r in found if r.condition == SOUND), key=lambda r: r.ratios[place])[-3:]:
            print(f"  {r}")


if __name__ == "__main__":
    main()
