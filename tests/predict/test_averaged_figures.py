"""RMS errors of the model with averaging, cold and warm, on the default drive, the stage and the recorded axis."""

from dataclasses import replace

import numpy as np
import pytest
from places import EMPS

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
    ("axis", "cold_most", "warm_most"), [pytest.param("x", 5.5, 1.1, marks=pytest.mark.nightly), ("y", 33.0, 1.4)]
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
