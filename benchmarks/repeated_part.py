"""A part that is made three times: predicted, compensated, by learning control, and then at a higher feed.

    python -m benchmarks.repeated_part [--only TEXT]      (ten minutes)

RMS errors of the true position, µm, over whole runs, each under other noise, of the staircase's drive, the stage with
friction on the actual velocity and the first drives of two masses with backlash; what was learned is kept from run to
run. Learning control is norm-optimal, without a Q filter; it begins with the physics model's command, knows no limits
of the drive, and has the weight ``r`` that is best for its last run. At the higher feed its command is stretched
in time. *Kept* is the reduction there after the runs, relative to that of the last run, both against the physics
model's plans; *of cold*, both against the hybrid's first run.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from two_mass.generator import SEED, Recipe
from two_mass.plant import TwoMassDrive

from benchmarks.averaging import with_friction_on
from benchmarks.compensation.loops import noise_seed
from benchmarks.learning_control import learned_commands
from benchmarks.two_mass_loops import settings_of
from hybridsep.base.metrics import rms
from hybridsep.base.settings import CompensatorSettings, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.cosim.loop import cosimulate
from hybridsep.evaluate.backtest import backtest
from hybridsep.machines.machine import Machine, load_machine
from hybridsep.model.physics import ModalModel
from hybridsep.plants.plant import Encoder, Plant, simulate
from hybridsep.plants.trajectory import spiral, staircase
from hybridsep.predict.predictor import HybridPredictor

RUNS, FEED = 3, 1.3
WEIGHTS = 10.0 ** np.arange(-2.0, 1.5, 0.5)  # of learning control, relative to the square of the model's gain at rest


@dataclass(frozen=True)
class Part:
    """Drive and part; settings of the predictor, of the compensator's predictor and of the compensator."""

    name: str
    model: ModalModel
    plant: Plant
    predictor: PredictorSettings
    planned: PredictorSettings
    compensator: CompensatorSettings
    x_d: Array
    noise_std: float
    quantum: float = 0.0

    def rounded(self, _k: int, x_meas: float) -> float:
        """Return a position in steps of the encoder, m."""
        return self.quantum * round(x_meas / self.quantum) if self.quantum else x_meas

    def measured(self, x: Array, run: int) -> Array:
        """Return the measurements of true positions, (n,), m."""
        noisy = Encoder(self.noise_std, noise_seed(0, run)).measure_all(x)
        return np.array([self.rounded(0, x_meas) for x_meas in noisy.tolist()])


def parts() -> Iterator[Part]:
    """Yield the parts."""
    yield of_machine("staircase", load_machine("spring_mass_damper"), staircase())
    for axis, x_d in zip("XY", spiral(), strict=True):
        stage = with_friction_on(load_machine(f"als25010_{axis.lower()}"), "motion")
        yield of_machine(f"stage {axis}, spiral", stage, x_d)
    recipes = (Recipe.draw(index, SEED) for index in range(100))
    for recipe in [one for one in recipes if one.axis.play and one.axis.T_s >= 1e-3][:4]:
        planned, compensator, x_d = settings_of(recipe)
        name, plant = f"two masses {recipe.index}, {recipe.kind}", TwoMassDrive(recipe.axis)
        steps = recipe.encoder.noise_std, recipe.encoder.quantum
        yield Part(name, recipe.model, plant, planned, planned, compensator, x_d, *steps)


def of_machine(name: str, machine: Machine, x_d: Array) -> Part:
    """Return a part of a machine, whose limit of velocity leaves something at the higher feed."""
    settings, predictor = machine.compensator_settings, replace(machine.predictor_settings, averaging=True, t_init=-1.0)
    assert machine.plant is not None
    assert settings.limits is not None
    limits = replace(settings.limits, velocity=FEED * settings.limits.velocity)
    planning = machine.compensator_predictor, replace(settings, limits=limits)
    return Part(name, machine.model, machine.new_plant(), predictor, *planning, x_d, machine.plant.noise_std)


def faster(path: Array) -> Array:
    """Return positions or commands of a run, (n,), m, at the higher feed."""
    n = len(path)
    return np.asarray(CubicSpline(np.arange(n), path)(FEED * np.arange(int((n - 1) / FEED) + 1)))


def predicted(part: Part) -> list[float]:
    """Return the errors of prediction of all runs, m."""
    predictor, errors = HybridPredictor(part.model, part.predictor), []
    x = simulate(part.plant, part.x_d, part.predictor.T_s)
    for run in range(RUNS):
        errors.append(rms(x - backtest(predictor, part.x_d, part.measured(x, run)).x_h))
        predictor.restart()
    return errors


def compensated(part: Part, compensate: str, paths: Sequence[Array]) -> list[float]:
    """Return the tracking errors, m, of paths one after the other."""
    settings = replace(part.compensator, compensate=compensate)
    compensator, errors = SepCompensator(HybridPredictor(part.model, part.planned), settings), []
    for run, x_d in enumerate(paths):
        encoder = Encoder(part.noise_std, noise_seed(0, run))
        made = cosimulate(compensator, part.plant, x_d, encoder=encoder, t_init=0.0, sensor=part.rounded)
        errors.append(made.tracking_rms)
    return errors


def learning_controlled(part: Part, weight: float) -> tuple[float, float]:
    """Return the tracking errors of the last run, and at the higher feed, m."""
    T_s, hold = part.predictor.T_s, part.predictor.input_hold
    plant, x_d = part.plant, part.x_d
    *_, last = learned_commands(part.model, T_s, hold, plant, x_d, RUNS, part.measured, weight=weight, advised=True)
    return rms(x_d - last.x), rms(faster(x_d) - simulate(plant, faster(last.u), T_s))


def row(index: int) -> str:
    """Return the figures of a part."""
    part = list(parts())[index]
    fast, first, *_, last = faster(part.x_d), *predicted(part)
    none = rms(part.x_d - simulate(part.plant, part.x_d, part.predictor.T_s))
    physics, physics_fast = (compensated(part, "physics", [path])[0] for path in (part.x_d, fast))
    *hybrid, after = compensated(part, "hybrid", [*[part.x_d] * RUNS, fast])
    (cold,) = compensated(part, "hybrid", [fast])
    learning, stretched = min(learning_controlled(part, float(weight)) for weight in WEIGHTS)

    def shown(*errors: float) -> str:
        return "".join(f"{1e6 * error:9.4g}" for error in errors)

    def kept(now: float, at_feed: float, was: float, before: float) -> str:
        return f"{100 * (1 - now / at_feed) / (1 - was / before):7.0f} %"

    return (
        f"{part.name:24}{shown(first, last)}{last / first:9.3f}{shown(none, physics, *hybrid, learning)}"
        f"{hybrid[-1] / learning:9.2f}{shown(physics_fast, cold, after, stretched)}"
        f"{kept(after, physics_fast, hybrid[-1], physics)}{kept(after, cold, hybrid[-1], hybrid[0])}"
        f"{kept(stretched, physics_fast, learning, physics)}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="only the parts whose name has this text")
    options = parser.parse_args(arguments)
    chosen = [index for index, part in enumerate(parts()) if options.only in part.name]
    runs = [f"hybrid {run + 1}" for run in range(RUNS)]
    columns = ["predict 1", f"{RUNS}", f"{RUNS} / 1", "none", "physics", *runs, "learning", "× learn."]
    columns += [f"{FEED:g}: phys.", "cold", f"after {RUNS}", "learning", "kept", "of cold", "learning"]
    print(f"{'µm':24}" + "".join(f"{column:>9}" for column in columns))
    with ProcessPoolExecutor() as pool:
        for line in pool.map(row, chosen):
            print(line, flush=True)


if __name__ == "__main__":
    main()
