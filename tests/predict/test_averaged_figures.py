"""The model with averaging over whole runs: RMS errors cold and warm, saved and restored."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from places import EMPS
from predictor_cases import averaged, averaged_model, cycles, friction, physics, run

from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import Machine, load_machine
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.trajectory import spiral, staircase
from hybridsep.predict.predictor import HybridPredictor


def with_averaging(machine: Machine) -> HybridPredictor:
    """Return the machine's predictor with averaging, without a warm-up."""
    return machine.new_predictor(replace(machine.predictor_settings, averaging=True, t_init=-1.0))


def rms_um(predictor: HybridPredictor, x_d: Array, x: Array) -> float:
    """Return the RMS error of x_h over the whole run against the measured position, µm."""
    result = backtest(predictor, x_d, x)
    assert result.active.all()
    return 1e6 * float(np.sqrt(np.mean((x - result.x_h) ** 2)))


def cold_and_warm(name: str, x_d: Array, noise_std: float) -> tuple[float, float]:
    machine = load_machine(name)
    predictor, x = with_averaging(machine), simulate(machine.new_plant(), x_d, machine.T_s)
    cold = rms_um(predictor, x_d, Encoder(noise_std, 0).measure_all(x))
    predictor.restart()
    return cold, rms_um(predictor, x_d, Encoder(noise_std, 1000).measure_all(x))


@pytest.mark.slow
def test_staircase() -> None:
    """Noise: 5 µm; the physics model alone: 33.8 µm."""
    cold, warm = cold_and_warm("spring_mass_damper", staircase(), 5e-6)
    assert cold <= 10.8
    assert warm <= 5.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axis", "cold_most", "warm_most"), [pytest.param("x", 5.6, 1.1, marks=pytest.mark.nightly), ("y", 33.0, 1.4)]
)
def test_spiral_of_the_stage(axis: str, cold_most: float, warm_most: float) -> None:
    """Noise: 1 µm; the physics model alone: 22.0 and 130.2 µm."""
    cold, warm = cold_and_warm(f"als25010_{axis}", dict(zip("xy", spiral(), strict=True))[axis], 1e-6)
    assert cold <= cold_most
    assert warm <= warm_most


@pytest.mark.slow
@pytest.mark.skipif(not EMPS.is_file(), reason="needs ../shared/data/emps beside the repository")
def test_recorded_axis() -> None:
    """The physics model alone: 15.45 µm."""
    log = read_log(EMPS, columns={"t": "t", "x_d": "qg", "x": "qm"})
    predictor = with_averaging(load_machine("emps"))
    cold = rms_um(predictor, log.x_d, log.x_meas)
    predictor.restart()
    assert cold <= 3.5
    assert rms_um(predictor, log.x_d, log.x_meas) <= 2.0


WAYS: dict[str, Callable[[HybridPredictor], HybridPredictor]] = {
    "bytes": lambda predictor: HybridPredictor.from_bytes(predictor.to_bytes()),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda predictor: pickle.loads(pickle.dumps(predictor)),
}


def signals(n: int = 1500) -> tuple[Array, Array]:
    x_d = 0.1 + cycles(n)
    return x_d, physics(x_d) + friction(x_d) + 1e-6 * np.random.default_rng(3).normal(size=n)


def in_mid_run(x: Array | None = None, *, warm: bool = False, **changes: Any) -> HybridPredictor:
    """Return a small predictor after 400 samples, of a second run if it is warm, with a predicted window of 30."""
    x_d, sound = signals()
    x = sound if x is None else x
    predictor = averaged(**{"Np": 20, "p": 6, "q": 2, "forgetting": 2.0} | changes)
    if warm:
        run(predictor, x_d, sound, 20)
        predictor.restart(0.1)
    run(predictor, x_d[:400], x[:400], 20)
    predictor.predict(x_d[400:430])
    return predictor


@pytest.mark.slow
@pytest.mark.parametrize("warm", [True, False])
@pytest.mark.parametrize("pending", [True, False])
def test_a_restored_predictor_continues_bit_for_bit(pending: bool, warm: bool) -> None:
    x_d, x = signals()
    x[[390, 395]], x[435:440] = np.nan, x[435] + 1e-2  # what is missing is part of the state, too
    original = in_mid_run(x=x, warm=warm)
    assert averaged_model(original).doubts == warm
    assert averaged_model(original).n_rejected >= 2
    if not pending:
        original.update(x[400:430])
    twins = {way: restored(original) for way, restored in WAYS.items()}
    for way, twin in twins.items():
        assert twin.to_bytes() == original.to_bytes(), way
    if pending:
        for each in (original, *twins.values()):
            each.update(x[400:417])
    for first in range(430, 700, 20):
        window = slice(first, first + 20)
        predicted = original.predict(x_d[window]).x_h
        original.update(x[window])
        for way, twin in twins.items():
            np.testing.assert_array_equal(twin.predict(x_d[window]).x_h, predicted, err_msg=way)
            twin.update(x[window])
    for way, twin in twins.items():
        assert twin.to_bytes() == original.to_bytes(), way


@pytest.mark.parametrize("samples", [0, 1])
def test_before_anything_is_learned(samples: int) -> None:
    predictor = averaged(q=0)
    if samples:
        run(predictor, np.zeros(1), np.zeros(1))
    predictor.predict(np.linspace(0.0, 1e-3, 100))
    twin = HybridPredictor.from_bytes(predictor.to_bytes())
    assert twin.to_bytes() == predictor.to_bytes()


def test_memory_does_not_grow() -> None:
    x_d, x = signals()
    predictor = in_mid_run()
    predictor.update(x[400:430])
    size = len(predictor.to_bytes())
    run(predictor, x_d, x, 20)
    assert abs(len(predictor.to_bytes()) - size) <= 200  # the digits of some numbers, and the pending window
