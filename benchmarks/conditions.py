"""Predictor with averaging in conditions that differ from a run at rest at 1 kHz with a sensor that does not lag.

    python -m benchmarks.conditions [--emps DATA_EMPS.mat] [--n 40]      (some minutes)

1. Start in motion: runs cut in mid-motion, RMS relative to the physics model's, which starts at rest, too.
2. Delay of the measurement: RMS relative to a run without delay over the same samples, predicted at the same
   horizon, the samples since the last measurement that has arrived: its windows begin the delay earlier. Then over
   whole windows, where the run with delay predicts that much further.
3. Plant changed before a warm run: RMS from 2 s on, relative to a cold run.
4. Sampling rates: RMS of one plant at 250 Hz, 1 kHz and 8 kHz, windows of 0.1 s each, relative to 1 kHz.

RMS is against the measured position.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
from random_drives.generator import SEED, random_drives
from random_drives.simulation import simulate as simulate_many

from benchmarks.averaging import RECORDINGS, SEEDS, Case, cases, simulated
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.machines.machine import Machine, load_machine
from hybridsep.model.physics import ModalModel
from hybridsep.plants.plant import Encoder, Plant, simulate
from hybridsep.plants.trajectory import spiral, staircase
from hybridsep.predict.predictor import HybridPredictor

DELAY = 5  # samples by which the measurement is late
SETTLED = 2.0  # time after which a warm run is to be no worse than a cold one, s
RATES = (250.0, 1000.0, 8000.0)  # sampling rates, Hz
HORIZON = 0.1  # length of a window at each of them, s

CUTS = (0.21, 0.37, 0.58)
"""Parts of a run of a random drive that are cut off, or up to a tenth more: until it moves fast."""

CHANGES = {
    "damping × 1.2, stiffness × 0.9": {"c": 1.2, "k": 0.9},
    "stiffness × 1.2": {"k": 1.2},
    "nonlinearities × 3": {"c_nl": 3.0, "k_nl": 3.0},
    "no nonlinearities": {"c_nl": 0.0, "k_nl": 0.0},
}
"""Factors on the parameters of the paper's drive after it was learned."""

STAGE_CHANGES = {
    "stage X, friction × 2": {"f": 2.0},
    "stage X, friction × 0.3": {"f": 0.3},
    "stage X, stiffness × 3": {"kappa": 3.0},
}
"""The same of the stage's X axis."""

DETUNED = 0.9  # factor on the natural frequencies of a random drive after it was learned


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emps", type=Path, help="DATA_EMPS.mat: the recorded axis, too")
    parser.add_argument("--n", type=int, default=40, help="number of random drives")
    options = parser.parse_args(arguments)
    print_ratios("start in motion, × physics", starts_in_motion(options.emps, options.n))
    late = f"delay of {DELAY} samples, × no delay"
    print_ratios(f"{late} at one horizon", delays(options.emps, options.n, at_one_horizon=True))
    print_ratios(f"{late}, {DELAY} samples further", delays(options.emps, options.n, at_one_horizon=False))
    print_ratios(f"changed plant, warm × cold from {SETTLED:g} s on", changes(options.n))
    print_ratios(f"windows of {HORIZON:g} s, × {RATES[1]:g} Hz", rates())


def print_ratios(title: str, ratios: Iterator[tuple[str, float, float]]) -> None:
    """Print a table of names, RMS errors, m, and their ratios to a peer's."""
    print(f"\n{title:44}{'µm':>10}{'peer':>10}{'ratio':>9}")
    found = []
    for name, error, peer in ratios:
        found.append(error / peer)
        print(f"{name:44}{1e6 * error:10.4g}{1e6 * peer:10.4g}{error / peer:9.3f}", flush=True)
    print(f"{f'largest of {len(found)}':64}{max(found):9.3f}")


def starts_in_motion(emps: Path | None, n: int) -> Iterator[tuple[str, float, float]]:
    """Yield names, RMS errors with averaging and of the physics model on runs cut in mid-motion."""
    for case, cut in motions(emps, n):
        settings = replace(case.settings, averaging=True, t_init=-1.0)
        found = backtest(HybridPredictor(case.model, settings), case.x_d[cut:], case.x_meas[0][cut:]).overall
        yield f"{case.name}, from sample {cut} on", found.h.rms, found.pb.rms


def motions(emps: Path | None, n: int) -> Iterator[tuple[Case, int]]:
    """Yield cases and the samples at which they are cut."""
    for case in (*cases(emps, RECORDINGS), *random_cases(n)):
        for part in CUTS:
            first = round(part * len(case.x_d))
            speed = np.abs(np.diff(case.x_d[first : first + len(case.x_d) // 10]))
            if speed.any():
                yield case, first + int(np.argmax(speed))


def random_cases(n: int) -> Iterator[Case]:
    """Yield the first random drives."""
    for drive in random_drives(range(n)):
        measured = (drive.x_meas, drive.x_meas)
        yield Case(f"drive {drive.index}", drive.model, PredictorSettings(), drive.x_d, measured)


def delays(emps: Path | None, n: int, *, at_one_horizon: bool) -> Iterator[tuple[str, float, float]]:
    """Yield names and RMS errors with a late measurement and without delay, over the same samples."""
    for case in (*cases(emps), *random_cases(n)):
        settings = replace(case.settings, averaging=True, t_init=-1.0)
        late = _in_turn(case, replace(settings, measurement_delay=DELAY))
        peer = _in_turn(case, settings, earlier=DELAY if at_one_horizon else 0)
        samples = slice(settings.Np - DELAY if at_one_horizon else settings.Np)
        for name, one, other in zip(("cold", "warm"), late, peer, strict=True):
            found, without = (rms(_of_windows(error, settings.Np, samples)) for error in (one, other))
            yield f"{case.name}, {name}", found, without


def _in_turn(case: Case, settings: PredictorSettings, *, earlier: int = 0) -> list[Array]:
    """Return the errors, m, of runs of a predictor, each going on with what the ones before have trained.

    earlier: samples by which windows begin earlier, at rest.
    """
    predictor, errors, late = HybridPredictor(case.model, settings), [], settings.measurement_delay
    x_d = _after_rest(case.x_d, earlier)
    for x in case.x_meas:
        x_meas = _after_rest(x, earlier + late)[: len(x_d)]
        found = backtest(predictor, x_d, x_meas)
        errors.append((x_meas - found.x_h)[earlier + late :])  # with a delay x_h belongs to the sample measured
        predictor.restart()
    return errors


def _after_rest(signal: Array, n: int) -> Array:
    """Return a signal that rests for ``n`` samples where it begins."""
    return np.concatenate((np.full(n, signal[0]), signal))


def _of_windows(error: Array, Np: int, samples: slice) -> Array:
    """Return the errors at some samples of each whole window."""
    return error[: len(error) // Np * Np].reshape(-1, Np)[:, samples]


def changes(n: int) -> Iterator[tuple[str, float, float]]:
    """Yield names and RMS errors after a while, warm and cold, of plants that have changed before the warm run."""
    for case in changed_plants(n):
        yield case.name, *_warm_and_cold(case)


def changed_plants(n: int, seed: int | None = None) -> Iterator[Case]:
    """Yield cases whose plant has changed before the warm run; ``n`` of them are random drives."""
    drive, stage = load_machine("spring_mass_damper"), load_machine("als25010_x")
    for name, factors in CHANGES.items():
        yield _changed(name, drive, _scaled(drive.new_plant(), factors), staircase())
    for name, factors in STAGE_CHANGES.items():
        yield _changed(name, stage, _scaled(stage.new_plant(), factors), spiral()[0])
    for drawn in random_drives(range(n), SEED if seed is None else seed):
        recipe = drawn.recipe
        true = recipe.true.model.modes
        modes = [replace(mode, f_n=DETUNED * mode.f_n, alpha=DETUNED**2 * mode.alpha) for mode in true]
        x = simulate_many([ModalModel(modes)], [recipe.disturbances], [drawn.x_d])[0]
        x_meas = x + recipe.noise_std * np.random.default_rng(drawn.index).standard_normal(len(x))
        name = f"drive {drawn.index}, frequencies × {DETUNED:g}"
        yield Case(name, drawn.model, PredictorSettings(), drawn.x_d, (drawn.x_meas, x_meas))


def _scaled(plant: Plant, factors: dict[str, float]) -> Plant:
    """Return a copy of a plant with some of its parameters changed."""
    changed = copy(plant)
    for name, factor in factors.items():
        setattr(changed, name, factor * getattr(plant, name))
    return changed


def _changed(name: str, machine: Machine, changed: Plant, x_d: Array) -> Case:
    """Return the case of a machine's plant that is changed before the warm run."""
    assert machine.plant is not None
    before = simulated(name, machine, x_d)
    after = Encoder(machine.plant.noise_std, 1000).measure_all(simulate(changed, x_d, machine.T_s))
    return replace(before, x_meas=(before.x_meas[0], after))


def _warm_and_cold(case: Case) -> tuple[float, float]:
    """Return RMS errors from 2 s on over the second run of a case, after the first one and without it."""
    settings = replace(case.settings, averaging=True, t_init=-1.0)
    settled, predictor = round(SETTLED / settings.T_s), HybridPredictor(case.model, settings)
    backtest(predictor, case.x_d, case.x_meas[0])
    predictor.restart()
    runs = (predictor, HybridPredictor(case.model, settings))
    warm, cold = (rms((case.x_meas[1] - backtest(run, case.x_d, case.x_meas[1]).x_h)[settled:]) for run in runs)
    return warm, cold


def rates() -> Iterator[tuple[str, float, float]]:
    """Yield names and RMS errors of one plant at each sampling rate, and at 1 kHz."""
    drive, stage = load_machine("spring_mass_damper"), load_machine("als25010_x")
    for name, machine, path in (
        ("staircase", drive, lambda T_s: staircase(T_s)),
        ("spiral, stage X", stage, lambda T_s: spiral(T_s)[0]),
    ):
        peer = _at_rate(machine, path, RATES[1])
        for rate in RATES:
            for run, error, of_peer in zip(("cold", "warm"), _at_rate(machine, path, rate), peer, strict=True):
                yield f"{name}, {rate:g} Hz, {run}", error, of_peer


def _at_rate(machine: Machine, path: Callable[[float], Array], rate: float) -> tuple[float, float]:
    """Return RMS errors, cold and warm, with windows and lags of the same time at a sampling rate, Hz."""
    T_s, Np = 1.0 / rate, round(HORIZON * rate)
    usual = PredictorSettings()
    settings = replace(usual, T_s=T_s, Np=Np, p=max(round(usual.p * usual.T_s * rate), 1))
    x_d = path(T_s)
    assert machine.plant is not None
    plant = machine.changed("", {"T_s": T_s}).new_plant()
    x = simulate(plant, x_d, T_s)
    predictor = HybridPredictor(machine.model, settings)
    errors = []
    for seed in SEEDS:
        x_meas = Encoder(machine.plant.noise_std, seed).measure_all(x)
        errors.append(rms(x_meas - backtest(predictor, x_d, x_meas).x_h))
        predictor.restart()
    return errors[0], errors[1]


if __name__ == "__main__":
    main()
