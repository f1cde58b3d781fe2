"""Paper's model and predictor with averaging beside the physics model and the hold, cold and warm.

    python -m benchmarks.averaging [--emps DATA_EMPS.mat]      (four minutes)

RMS of the prediction error against the measured position, µm, over the whole run from its first sample. A warm run goes
on with what the cold one has learned, under other noise; over a recording it is a second pass. The stage's friction
follows the command, or the actual velocity. Recordings come with no model: a first-order lag with a whole number of
samples of dead time is fitted to each by least squares. ``diverged`` stands where a replay was refused.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hybridsep.base.errors import SignalError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.evaluate.peers import fitted_lag
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import Machine, paper_machine
from hybridsep.machines.sections import StageSection
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.trajectory import PAPER_LIMITS, along_path, rest_to_rest, spiral, staircase
from hybridsep.predict.predictor import HybridPredictor

SEEDS = (0, 1000)  # seeds of the encoder noise, cold and warm
RECORDINGS = sorted((Path(__file__).parent / "recordings").glob("*.npz"))
WINDOWS = (100, 20)  # samples in a window, ``Np``, over a recording; ``p`` is 50 where it fits


@dataclass(frozen=True)
class Case:
    """Axis and a run to predict."""

    name: str
    model: ModalModel
    settings: PredictorSettings  # of the paper's model
    x_d: Array  # (n,), m: commanded positions
    x_meas: tuple[Array, Array]  # each (n,), m: measured positions of the cold and the warm run


@dataclass(frozen=True)
class Row:
    """RMS errors of a case, m; infinite where the replay was refused, because the prediction diverged."""

    name: str
    # of the cold run
    physics: float
    hold: float
    # cold and warm
    paper: tuple[float, float]
    averaging: tuple[float, float]

    def __str__(self) -> str:
        cells = [self.physics, self.hold, *self.paper, *self.averaging]
        ratios = [self.averaging[0] / self.physics, self.averaging[0] / self.hold]
        return (
            f"{self.name:40}"
            + "".join(f"{_micrometres(cell):>10}" for cell in cells)
            + "".join(f"{ratio:10.3f}" for ratio in ratios)
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat: the recorded axis, too")
    options = parser.parse_args(arguments)
    columns = ("physics", "hold", "paper", "warm", "averaging", "warm", "× physics", "× hold")
    print(f"{'µm; ratios: averaging, cold':40}" + "".join(f"{column:>10}" for column in columns))
    for case in cases(options.emps, RECORDINGS):
        print(replayed(case), flush=True)


def cases(emps: Path | None = None, recordings: Sequence[Path] = ()) -> Iterator[Case]:
    """Yield the simulated drives, the EMPS axis and the recordings."""
    drive, stage = paper_machine("spring_mass_damper"), [paper_machine(f"als25010_{axis}") for axis in "xy"]
    yield simulated("staircase", drive, staircase())
    yield simulated("staircase of 7 mm", drive, short_staircase())
    for friction_on in ("command", "motion"):
        for name, path in stage_paths():
            for axis, machine, x_d in zip("XY", stage, path, strict=True):
                label = f"{axis}, friction on {friction_on}: {name}"
                yield simulated(label, with_friction_on(machine, friction_on), x_d)
    if emps is not None:
        machine = paper_machine("emps")
        log = read_log(emps, columns=machine.log.columns)
        yield Case("EMPS", machine.model, machine.predictor_settings, log.x_d, (log.x_meas, log.x_meas))
    for Np in WINDOWS:
        yield from (recorded(path, Np) for path in recordings)


def stage_paths() -> Iterator[tuple[str, tuple[Array, Array]]]:
    """Yield names of paths of the stage, with the commands of X and Y, (n,), m."""
    yield "spiral", spiral()
    yield "circle", circle()
    yield "7 mm staircase", (short_staircase(), short_staircase())
    yield "random moves", (random_moves(1), random_moves(2))


def with_friction_on(machine: Machine, friction_on: str) -> Machine:
    """Return a stage whose friction follows the command or the motion."""
    assert isinstance(machine.plant, StageSection)
    return machine.changed("plant", {"friction_on": friction_on})


def simulated(name: str, machine: Machine, x_d: Array) -> Case:
    """Return a run of a machine's plant over ``x_d``, (n,), m, measured under two noises."""
    assert machine.plant is not None
    x, std = simulate(machine.new_plant(), x_d, machine.T_s), machine.plant.noise_std
    cold, warm = (Encoder(std, seed).measure_all(x) for seed in SEEDS)
    return Case(name, machine.model, machine.predictor_settings, x_d, (cold, warm))


def short_staircase() -> Array:
    """Return the paper's staircase with moves of 7 instead of 10 mm, (n,), m."""
    steps = np.array([0.0, 1, 2, 3, 2, 1, 0]) * 0.007
    return rest_to_rest(steps, PAPER_LIMITS, start_times=range(6), duration=6.0)


def circle(radius: float = 0.02, turns: float = 3.0) -> tuple[Array, Array]:
    """Return the commands of X and Y for a circle from rest to rest, (n,), m."""

    def position(theta: Array) -> Array:
        return radius * np.stack((np.cos(theta) - 1.0, np.sin(theta)), axis=-1)

    def derivative(theta: Array) -> Array:
        return radius * np.stack((-np.sin(theta), np.cos(theta)), axis=-1)

    points = along_path(position, derivative, 2 * np.pi * turns, PAPER_LIMITS)
    return np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])


def random_moves(seed: int) -> Array:
    """Return ten moves from rest to rest within ±20 mm, one every 0.6 s, (n,), m."""
    ends = np.random.default_rng(seed).uniform(-0.02, 0.02, 10)
    return rest_to_rest([0.0, *ends.tolist()], PAPER_LIMITS, start_times=(0.6 * np.arange(10)).tolist())


def recorded(path: Path, Np: int) -> Case:
    """Return the case of a recording with a model fitted to it."""
    log = read_log(path)
    settings = PredictorSettings(averaging=False, Np=Np, p=min(50, Np), T_s=log.T_s)
    model = fitted_model(log.x_d, log.x_meas, log.T_s)
    return Case(f"{path.stem}, Np = {Np}", model, settings, log.x_d, (log.x_meas, log.x_meas))


def fitted_model(x_d: Array, x: Array, T_s: float) -> ModalModel:
    """Return the first-order lag with whole samples of dead time that fits a recording best by least squares."""
    lag = fitted_lag([(x_d, x)])
    omega = 1.0 / (lag.tau * T_s)
    # 1/(τs + 1) = (ω² + ω s)/(s + ω)²
    return ModalModel([Mode(omega / (2 * math.pi), 1.0, omega**2, omega)], max(lag.late - 1, 0))


def replayed(case: Case) -> Row:
    """Return the errors of all predictors on a case."""
    averages = replace(case.settings, averaging=True, t_init=-1.0)
    peers = backtest(HybridPredictor(case.model, averages), case.x_d, case.x_meas[0]).overall
    return Row(
        case.name,
        peers.pb.rms,
        peers.hold.rms,
        _cold_and_warm(HybridPredictor(case.model, case.settings), case),
        _cold_and_warm(HybridPredictor(case.model, averages), case),
    )


def _cold_and_warm(predictor: HybridPredictor, case: Case) -> tuple[float, float]:
    """Return the RMS errors of ``x_h``, m, of a first and a second run."""
    errors = []
    for x in case.x_meas:
        try:
            errors.append(rms(x - backtest(predictor, case.x_d, x).x_h))
        except SignalError:
            errors.append(math.inf)
        predictor.restart()
    return errors[0], errors[1]


def _micrometres(error: float) -> str:
    return f"{1e6 * error:.4g}" if math.isfinite(error) else "diverged"


if __name__ == "__main__":
    main()
