"""Benchmark of compensation in closed loop: the native SepCompensator on drives of two masses, sound and not.

    python -m benchmarks.two_mass_loops [--n 60] [--seed 2] [--only TEXT]      (ten minutes)

RMS and largest of the tracking error of the true position, relative to no compensation, and the largest relative to
that with ``compensate = physics``; errors and limits are without the last preview, as the trajectory breaks off while
it moves, which no limit allows. Warm: with weights that were learned from a run without compensation.
"""

import argparse
import math
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass, replace
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from two_mass.axis import Axis, LinearLoop
from two_mass.generator import SEED, Recipe
from two_mass.plant import TwoMassDrive

from hybridsep.base.errors import HybridSepError
from hybridsep.base.metrics import largest, peak_derivatives, rms
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, Limits
from hybridsep.base.signals import Array
from hybridsep.cosim.loop import Sensor, cosimulate
from hybridsep.cosim.run import Run
from hybridsep.fitting.compensation import taught
from hybridsep.fitting.replay import Recording
from hybridsep.fmi.archive import build_here
from hybridsep.identify.model import machine_of
from hybridsep.machines.machine import Machine

DURATION = 2.5  # longest run, s
SPARE = (2.0, 3.0, 5.0)  # limits of velocity, acceleration and jerk relative to the trajectory's


def trajectory(recipe: Recipe) -> Array:
    """Return a drive's commanded positions, ``(n,)``, m, of at most :data:`DURATION`."""
    return recipe.x_d[: round(DURATION / recipe.axis.T_s)]


def machine_of_drive(recipe: Recipe) -> Machine:
    """Return a drive's physics model, and limits which leave something to its trajectory's.

    The settings are those that ``fit`` writes where it is given these limits, but for ``following_error_max``, which is
    off; the change may be twice the servo error.
    """
    T_s, hold, x_d, Np = recipe.axis.T_s, recipe.settings.input_hold, trajectory(recipe), recipe.settings.Np
    error = x_d - TwoMassDrive(recipe.axis, float(x_d[0])).run(x_d)
    velocity, acceleration, jerk = (spare * peak for spare, peak in zip(SPARE, peak_derivatives(x_d, T_s), strict=True))
    limits, change_max = Limits(velocity, acceleration, jerk), 2 * largest(error)
    given = CompensatorSettings(limits=limits, change_max=change_max)
    window = given.window(recipe.model.needed_preview(T_s, hold), T_s)
    return machine_of(
        *(recipe.model, hold, T_s, "two_mass", f"Drive of two masses {recipe.index}"),
        predictor={"Np": Np, "p": min(50, Np, window)},
        drive_limits={
            "velocity": velocity,
            "acceleration": acceleration,
            "jerk": jerk,
            "change_max": change_max,
        },
    )


def closed_loop(
    fmu: Path,
    machine: Machine,
    recipe: Recipe,
    axis: Axis,
    compensate: str,
    sensor: Sensor = lambda _k, x: x,
    **more: float,
) -> Run:
    """Return a run of a drive, which may be another one than the recipe's, with its machine's compensator.

    ``compensate``: {"off", "physics", "hybrid"}; ``sensor``: returns what is measured in the place of a measurement;
    ``**more``: parameters of the FMU besides.
    """
    x_d, late = trajectory(recipe), machine.compensator_settings.preview or 0
    noise, quantum = recipe.noise.tolist(), recipe.encoder.quantum

    def measured(k: int, x: float) -> float:
        return sensor(k, quantum * round((x + noise[(k + late) % len(x_d)]) / quantum))

    values = {"compensate": PARAMETERS["compensate"].to_fmi(compensate), **more}
    drive = TwoMassDrive(replace(axis, change_at=axis.change_at + late))
    return cosimulate(fmu, drive, x_d, controller_values=values, sensor=measured)


SATURATED = 0.6  # motor force beyond friction, relative to that which the trajectory needs
RINGING = 0.015  # damping ratio of the mode that begins to ring
CHANGE = 0.4  # part of a run after which the plant changes, or, in other benchmarks, the measurement fails


def _saturated(axis: Axis, x_d: Array) -> Axis:
    acceleration = float(np.abs(np.diff(x_d, 2)).max()) / axis.T_s**2
    heaviest = 1.0 + max(0.0, axis.changed.added)
    return replace(axis, force_max=SATURATED * acceleration * heaviest + axis.motor.coulomb + axis.bearing.coulomb)


def _ringing(axis: Axis, x_d: Array) -> Axis:
    return replace(axis, changed=_with_less_damping(axis.changed), change_at=round(CHANGE * len(x_d)))


def _with_less_damping(loop: LinearLoop) -> LinearLoop:
    """Return a loop with less damping of belt or screw, down to a tenth; where that does not ring, with what makes it.

    A higher velocity gain, which leaves the following error as it is, or else a longer lag of the motor's force.
    """

    def changed(name: str, log_factor: float) -> LinearLoop:
        start = loop if name == "damping" else replace(loop, damping=0.1 * loop.damping)
        return replace(start, **{name: math.exp(log_factor) * getattr(start, name)})

    for name, end in (("damping", math.log(0.1)), ("k_p", 4.0), ("tau", 10.0)):
        factors = np.linspace(0.0, end, 81).tolist()
        for low, high in pairwise(factors):
            if changed(name, high).least_damping <= RINGING:
                return changed(name, brentq(lambda x, name=name: changed(name, x).least_damping - RINGING, low, high))
    raise ValueError(f"nothing makes {loop} ring")


SOUND = "sound"

CONDITIONS: dict[str, Callable[[Axis, Array], Axis]] = {
    SOUND: lambda axis, _: axis,
    "motor saturated at 0.6": _saturated,
    "begins to ring": _ringing,
}
"""The drive under each, from the sound one and the trajectory, ``(n,)``, m; faults of sensors are in ``faults.py``."""

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
    machine, x_d = machine_of_drive(recipe), trajectory(recipe)
    T_s, start, late = machine.T_s, float(x_d[0]), machine.compensator_settings.preview or 0
    limits, change_max = machine.command_limits()
    assert limits is not None
    assert change_max is not None

    def errors(x: Array) -> tuple[float, float]:
        error = (x_d - x)[: len(x_d) - late]
        return (rms(error), largest(error)) if np.isfinite(error).all() else (np.inf, np.inf)

    folder = tempfile.TemporaryDirectory()
    fmus = {False: build_here(machine, "SepCompensator", Path(folder.name))}
    found = []
    for name, condition in CONDITIONS.items():
        if only not in name:
            continue
        axis = condition(recipe.axis, x_d)
        x = TwoMassDrive(axis, start).run(x_d)
        if name == SOUND:
            weights = _learned(machine, recipe, x, Path(folder.name, "learned.state"))
            fmus[True] = build_here(machine, "SepCompensator", Path(folder.name, "warm"), weights=weights)
        physics = (np.inf, np.inf)
        for run, (compensate, warm) in RUNS.items():
            if warm and name != SOUND:
                continue
            try:
                loop = closed_loop(fmus[warm], machine, recipe, axis, compensate)
            except HybridSepError:  # it refused to go on
                found.append(Result(name, run, index, errors(x), physics, (np.inf, np.inf), np.inf))
                continue
            sent = loop.x_dm[: len(x_d) - late]
            excess = [peak / most - 1 for peak, most in zip(peak_derivatives(sent, T_s), astuple(limits), strict=True)]
            excess.append(largest(sent - x_d[: len(sent)]) / change_max - 1)
            physics = errors(loop.x) if run == "physics" else physics
            found.append(Result(name, run, index, errors(x), physics, errors(loop.x), max(excess)))
    return found


def _learned(machine: Machine, recipe: Recipe, x: Array, path: Path) -> Path:
    """Save what ``fit`` would teach a compensator of a run without compensation, ``(n,)``, m."""
    quantum, x_d = recipe.encoder.quantum, trajectory(recipe)
    run = Recording(x_d, quantum * np.round((x + recipe.noise[: len(x)]) / quantum), len(x))
    taught(machine, [run]).save(path)
    return path


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
