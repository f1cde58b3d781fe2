"""Which measurements are believed."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from predictor_cases import MODEL, averaged_model
from two_mass.generator import Recipe

from benchmarks.two_mass_loops import closed_loop, machine_of_drive
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.fmi.archive import build_here
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.averaging.experts import COMMAND_RESIDUAL, MODEL_RESIDUAL
from hybridsep.predict.averaging.gate import InnovationGate, gated
from hybridsep.predict.predictor import HybridPredictor

NP, T_S = 100, 1e-3


def motion(n: int = 3000) -> tuple[Array, Array]:
    """Return predicted and measured positions, m, of a drive that goes to and fro, with 1 µm of noise."""
    t = 1e-3 * np.arange(n)
    x_pb = 0.01 * (1.0 - np.cos(2.0 * np.pi * t))
    lag = 5e-5 * np.sin(2.0 * np.pi * t) + 2e-5 * np.tanh(np.sin(2.0 * np.pi * t) / 0.01)
    return x_pb, x_pb + lag + np.random.default_rng(1).normal(0.0, 1e-6, n)


def believed(x: Array, x_pb: Array, *, scale: float = 1.0, Np: int = NP) -> NDArray[np.bool_]:
    reach, before, fastest, largest, found = InnovationGate(), 0.0, 0.0, 0.0, []
    for i in range(0, len(x), Np):
        window = slice(i, i + Np)
        at, predicted = scale * x[window], scale * x_pb[window]
        fastest = max(fastest, float(np.abs(np.diff(predicted, prepend=before)).max()))
        one, reach = gated(reach, at - predicted, largest, fastest, T_S)
        before, largest = predicted[-1], max(largest, float(np.abs(at - predicted)[one].max(initial=0.0)))
        found.append(one)
    return np.concatenate(found)


@pytest.mark.parametrize("resolution", [0.0, 1e-6, 1e-5, 1e-3])
def test_sound_measurements_are_believed(resolution: float) -> None:
    x_pb, x = motion()
    assert believed(resolution * np.rint(x / resolution) if resolution else x, x_pb).all()


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("step", [1e-12, 1e-8, 1e-7])
def test_a_creep_far_below_the_noise_is_believed_soon(step: float, seed: int) -> None:
    x_pb = step * np.arange(3000.0)
    found = believed(x_pb + np.random.default_rng(seed).normal(0.0, 1e-6, 3000), x_pb)
    assert (~found).sum() < 100


@pytest.mark.slow
def test_a_coarse_encoder_is_believed_while_a_compensator_creeps(tmp_path: Path) -> None:
    """Before the first motion its steps are far above how the model moves, and not above how the commands will."""
    recipe = Recipe.draw(2, 900202)
    machine = machine_of_drive(recipe)
    run = closed_loop(build_here(machine, "SepCompensator", tmp_path), machine, recipe, recipe.axis, "hybrid")
    assert run.n_rejected == 0


def test_noise_is_believed_before_the_first_motion() -> None:
    x = np.random.default_rng(2).normal(0.0, 1e-6, 10 * NP)
    assert believed(x, np.zeros(10 * NP)).all()


def test_a_poor_model_is_no_fault_of_the_sensor() -> None:
    x_pb, _ = motion()
    assert believed(np.concatenate((np.zeros(120), x_pb[:-120])), x_pb).all()  # which lags by more than a window
    assert believed(-x_pb, x_pb).all()
    assert believed(x_pb + 1e-3 * np.sin(0.5 * np.arange(3000)) * (np.arange(3000) > 700), x_pb).all()  # it rings


@pytest.mark.parametrize("Np", [1, 7])
def test_judgement_does_not_depend_on_the_windows(Np: int) -> None:
    x_pb, x = motion()
    x[1230:1290] = 0.0
    assert believed(x, x_pb, Np=Np)[700:].tolist() == believed(x, x_pb)[700:].tolist()  # the fastest step is known then


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_judgement_does_not_depend_on_units(scale: float) -> None:
    x_pb, x = motion()
    x[1234] += 1e-3
    assert believed(x, x_pb, scale=scale).tolist() == believed(x, x_pb).tolist()


@pytest.mark.parametrize("height", [1e-3, -1.0, 1e2])
def test_a_value_out_of_reach_is_missing_alone(height: float) -> None:
    x_pb, x = motion()
    places = [350, 1234, 1799, 1800, 2500]  # in motion, at the edges of a window, near a turn
    x[places] += height
    assert set(np.flatnonzero(~believed(x, x_pb)).tolist()) == {*places, 1801}  # as many follow as there were


def test_a_wrong_reading_is_missing_though_the_axis_passes_by() -> None:
    x_pb, x = motion()
    x[600:1050] = x[750]
    found = believed(x, x_pb)
    assert not found[600:1050].any()
    assert found[1500:].all()


def test_another_level_is_believed_after_a_second() -> None:
    x_pb, x = motion(4000)
    x[1000:] += 1e-2
    found = believed(x, x_pb)
    assert found[:1000].all()
    assert not found[1000:2000].any()
    assert found[2000:].all()


def test_what_is_missing_for_a_second_says_nothing_of_what_comes_then() -> None:
    x_pb, x = motion(4000)
    x[500:1500] = np.nan
    x[1500:] += 1.0
    assert believed(x, x_pb)[1500:].all()


def test_an_axis_that_stands_is_believed() -> None:
    x_pb, x = motion()
    x[1230:1730] = x[1229]
    assert believed(x, x_pb).all()


def test_missing_samples_are_counted_and_bridged() -> None:
    x_d = staircase()[:2000]
    predictor = HybridPredictor(MODEL, PredictorSettings(averaging=True))
    x_pb, _ = predictor.discrete.forced_response(predictor.discrete.rest(), x_d)
    e_pb = 0.5 * np.diff(x_pb, prepend=0.0)  # a residual that a feature describes exactly
    gaps = np.random.default_rng(3).random(2000) < 0.01
    errors = []
    for i in range(0, 2000, NP):
        window = slice(i, i + NP)
        errors.append(e_pb[window] - predictor.predict(x_d[window]).e_h)
        predictor.update(np.where(gaps[window], np.nan, (x_pb + e_pb)[window]))
    assert averaged_model(predictor).n_rejected == gaps.sum()
    assert rms(np.concatenate(errors[10:])) < 0.05 * rms(e_pb[1000:])


def test_each_measured_sample_is_learned_whatever_is_missing_before_it() -> None:
    predictor = HybridPredictor(MODEL, PredictorSettings(averaging=True, p=10))
    x = staircase()[: 2 * NP]
    for i in range(0, 2 * NP, NP):
        predictor.predict(x[i : i + NP])
        predictor.update(np.where(np.arange(NP) // 8 % 2 == 1, np.nan, x[i : i + NP]))
    learned = averaged_model(predictor)
    assert learned.evidence[MODEL_RESIDUAL].n_rows == learned.evidence[COMMAND_RESIDUAL].n_rows == 2 * (NP - 48)


def test_what_is_missing_is_predicted_and_shifted_as_its_neighbours_are_off() -> None:
    predictor = HybridPredictor(MODEL, PredictorSettings(averaging=True, Np=10, p=10))
    x_d = staircase()[:20]
    measured = x_d + 1e-6
    predictor.predict(x_d[:10])
    predictor.update(measured[:10])
    e_h = predictor.predict(x_d[10:]).e_h
    e = measured[10:] - predictor.predict(x_d[10:]).x_pb
    measured[[10, 11, 15, 18, 19]] = np.nan
    predictor.update(measured[10:])
    off = e - e_h
    bridged = np.concatenate((off[2] / 3.0 * np.array([1, 2]), [(off[4] + off[6]) / 2.0], off[[7, 7]]))
    expected = e.copy()
    expected[[0, 1, 5, 8, 9]] = e_h[[0, 1, 5, 8, 9]] + bridged
    np.testing.assert_allclose(averaged_model(predictor).run.past[MODEL_RESIDUAL], expected[::-1], rtol=0, atol=1e-15)
