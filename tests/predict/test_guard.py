"""The guard against wrong measurements: what it rejects, and that it accepts what is sound."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from trusted_cases import trusted_model

from hybridsep.base.errors import SignalError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.model.physics import ModalModel
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.trust.constants import CONSTANTS
from hybridsep.predict.trust.guard import SensorGuard

Array = NDArray[np.float64]

NP = 100


def motion(n: int = 3000) -> tuple[Array, Array]:
    """Return predicted and measured positions, m, of a drive that goes to and fro, with 1 µm of noise."""
    t = 1e-3 * np.arange(n)
    x_pb = 0.01 * (1.0 - np.cos(2.0 * np.pi * t))
    lag = 5e-5 * np.sin(2.0 * np.pi * t) + 2e-5 * np.tanh(np.sin(2.0 * np.pi * t) / 0.01)
    return x_pb, x_pb + lag + np.random.default_rng(1).normal(0.0, 1e-6, n)


def accepted(x: Array, x_pb: Array, *, scale: float = 1.0) -> NDArray[np.bool_]:
    guard, largest, found = SensorGuard(NP, 1e-3, CONSTANTS), 0.0, []
    for i in range(0, len(x), NP):
        window = slice(i, i + NP)
        found.append(guard.accepts(scale * x[window], scale * x_pb[window], largest))
        errors = scale * np.abs(x[window] - x_pb[window])[found[-1]]
        largest = max(largest, float(errors.max(initial=0.0)))
    return np.concatenate(found)


@pytest.mark.parametrize("resolution", [0.0, 1e-6, 1e-5])
def test_sound_measurements_are_accepted(resolution: float) -> None:
    x_pb, x = motion()
    x = resolution * np.rint(x / resolution) if resolution else x
    assert np.mean(accepted(x, x_pb)) > 0.995


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_judgement_does_not_depend_on_units(scale: float) -> None:
    x_pb, x = motion()
    x[1234] += 1e-4
    assert accepted(x, x_pb, scale=scale).tolist() == accepted(x, x_pb).tolist()


@pytest.mark.parametrize("height", [5e-5, 1e-3, -1.0, 1e2])
def test_an_isolated_value_is_rejected_alone(height: float) -> None:
    x_pb, x = motion()
    places = [350, 1234, 1799, 1800, 2500]  # in motion, at the edges of a window, near a turn
    x[places] += height
    rejected = np.flatnonzero(~accepted(x, x_pb))
    assert set(places) <= set(rejected.tolist())
    assert len(rejected) <= len(places) + 10


def test_a_held_value_is_rejected_until_it_moves_again() -> None:
    x_pb, x = motion()
    x[1230:1290] = x[1229]
    rejected = np.flatnonzero(~accepted(x, x_pb))
    assert set(range(1230, 1290)) <= set(rejected.tolist())
    assert len(rejected) <= 70


def with_play(x_pb: Array, width: float) -> Array:
    """Return the position of an axis that stands still after each reversal until the play is taken up."""
    x: Array = x_pb.copy()
    for k in range(1, len(x)):
        x[k] = min(max(x[k - 1], x_pb[k] - width), x_pb[k] + width)
    return x


def test_an_axis_that_stands_still_by_itself_is_believed() -> None:
    x_pb, _ = motion(4000)
    x = with_play(x_pb, 2e-4)
    rejected = np.flatnonzero(~accepted(x, x_pb))
    assert len(rejected) < 200
    assert rejected.max(initial=0) < 1000  # the first reversal is at 500
    x[2250:2300] = x[2250]  # at full speed: the sensor this time, which only its end tells
    x[3250:3300] = x[3250]
    rejected = np.flatnonzero(~accepted(x, x_pb))
    assert set(range(3260, 3300)) <= set(rejected.tolist())


@pytest.mark.parametrize(("largest", "believed"), [(8e-5, False), (1e-3, True)])
def test_an_axis_stands_no_further_than_its_residuals_allow(largest: float, believed: bool) -> None:
    x_pb, x = motion(2 * NP)
    guard = SensorGuard(NP, 1e-3, CONSTANTS)
    guard.accepts(x[:NP], x_pb[:NP], largest)
    guard.stood = 1e-4
    predicted = x_pb[NP - 1] + 4.5e-6 * np.arange(1, NP + 1)
    held = np.full(NP, x[NP - 1])
    last = guard.accepts(held, predicted, largest)[-1]  # under a motion of 450 µm
    assert bool(last) is believed
    assert guard.holding == int(not believed)


def test_zeros_for_a_while_are_rejected() -> None:
    x_pb, x = motion()
    x[1330:1380] = 0.0
    rejected = np.flatnonzero(~accepted(x, x_pb))
    assert set(range(1330, 1380)) <= set(rejected.tolist())
    assert len(rejected) <= 60


def test_a_new_level_is_believed_in_the_end() -> None:
    x_pb, x = np.zeros(3000), np.random.default_rng(2).normal(0.0, 1e-6, 3000)
    x[1000:] += 1e-3
    found = accepted(x, x_pb)
    assert not found[1000:1200].any()
    assert found[1205:].all()


def ringing(frequency: float) -> tuple[Array, Array]:
    """Return predicted and measured positions, m: from rest a drive rings, of which the model knows nothing."""
    n = 20 * NP
    rings = np.arange(n) >= 5 * NP
    x = 1e-4 * np.sin(2.0 * np.pi * frequency * 1e-3 * np.arange(n)) * rings
    return np.zeros(n), x + np.random.default_rng(2).normal(0.0, 2e-7, n)


@pytest.mark.parametrize("frequency", [5.0, 20.0, 80.0])
def test_a_drive_that_rings_at_rest_is_believed_after_a_window(frequency: float) -> None:
    x_pb, x = ringing(frequency)
    found = accepted(x, x_pb)
    assert np.mean(found[5 * NP : 6 * NP]) < 0.7  # a sensor that goes wrong would look the same
    assert np.mean(found[6 * NP :]) > 0.97


def test_what_rings_is_learned() -> None:
    _, x = ringing(20.0)
    predictor = HybridPredictor(ModalModel.spring_mass_damper(m=1.0, c=15.7, k=24674.0))
    errors = []
    for i in range(0, len(x), NP):
        errors.append(x[i : i + NP] - predictor.predict(np.zeros(NP)).x_h)
        predictor.update(x[i : i + NP])
    assert rms(np.concatenate(errors[10:])) < 0.1 * rms(x[10 * NP :])


def test_wrong_values_are_rejected_while_a_drive_rings() -> None:
    x_pb, x = ringing(20.0)
    places = np.arange(7 * NP, 20 * NP, 37)
    x[places] += 1e-3
    assert not accepted(x, x_pb)[places].any()


def test_a_wrong_value_in_a_short_window_is_no_vibration() -> None:
    guard = SensorGuard(3, 1e-3, CONSTANTS)
    for x in ([0.0, 1e-7, 0.0], [0.0, 1.0, 0.0], [1e-7, 0.0, 1e-7]):
        found = guard.accepts(np.array(x), np.zeros(3), 1e-6)
    assert guard.vibration == 0.0
    assert found.all()


def test_missing_samples_are_counted_and_bridged() -> None:
    model = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)
    x_d = staircase()[:2000]
    predictor = HybridPredictor(model, PredictorSettings(trust=True))
    x_pb, _ = predictor.discrete.forced_response(predictor.discrete.rest(), x_d)
    e_pb = 0.5 * np.diff(x_pb, prepend=0.0)  # a residual that a feature describes exactly
    gaps = np.random.default_rng(3).random(2000) < 0.01
    errors = []
    for i in range(0, 2000, NP):
        window = slice(i, i + NP)
        errors.append(e_pb[window] - predictor.predict(x_d[window]).e_h)
        predictor.update(np.where(gaps[window], np.nan, (x_pb + e_pb)[window]))
    assert gaps.sum() <= trusted_model(predictor).n_rejected <= gaps.sum() + 20
    assert rms(np.concatenate(errors[10:])) < 0.05 * rms(e_pb[1000:])


def test_without_trust_a_missing_sample_is_an_error() -> None:
    predictor = HybridPredictor(ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), PredictorSettings(trust=False))
    predictor.predict(np.zeros(NP))
    with pytest.raises(SignalError, match="must be finite, got nan at sample 3"):
        predictor.update(np.where(np.arange(NP) == 3, np.nan, 0.0))


def test_infinite_measurements_stay_errors_with_trust() -> None:
    predictor = HybridPredictor(ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), PredictorSettings(trust=True))
    predictor.predict(np.zeros(NP))
    with pytest.raises(SignalError, match="must be finite, got inf at sample 3"):
        predictor.update(np.where(np.arange(NP) == 3, np.inf, 0.0))
