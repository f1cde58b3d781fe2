"""The compensating look-ahead: the timing contract, sample by sample, against plans made window by window."""

from __future__ import annotations

import math

import numpy as np
import pytest
from staircase_data import commanded, measured

from hybridsep.base.errors import SignalError, StateError
from hybridsep.base.settings import CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator, SepState
from hybridsep.model.physics import ModalModel
from hybridsep.predict.look_ahead import LookAhead
from hybridsep.predict.predictor import HybridPredictor

MODEL = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)
LIMITS = Limits(0.1, 16.0, 5000.0)
NAMES = ("x_dm", "x_d", "x_pb", "x_h", "e_servo", "sep_state", "batch", "rms_e", "rms_pb", "rms_h")


def compensator(preview: int = 200, t_init: float = 0.1) -> SepCompensator:
    predictor = HybridPredictor(MODEL, PredictorSettings(Np=50, p=20, q=3, t_init=t_init))
    return SepCompensator(predictor, CompensatorSettings(preview=preview, limits=LIMITS))


def outputs(look_ahead: LookAhead) -> tuple[float, ...]:
    return tuple(float(getattr(look_ahead, name)) for name in NAMES)


def run(look_ahead: LookAhead, r: Array, x: Array, first: int = 0, last: int | None = None) -> Array:
    """Feed samples ``first … last − 1`` and return the outputs before each."""
    found = []
    for k in range(first, len(r) if last is None else last):
        found.append(outputs(look_ahead))
        look_ahead.sample(float(r[k]), float(x[k]))
    return np.array(found)


def delayed(preview: int, shift: float = 0.0, n: int = 1500) -> tuple[Array, Array]:
    """Return ``r(k)`` and the measurement of a drive that gets it ``preview`` samples later, without compensation."""
    r = commanded()[:n] + shift
    noise = np.concatenate((np.random.default_rng(0).normal(0.0, 5e-6, preview), np.zeros(n - preview)))
    return r, np.concatenate((np.full(preview, r[0]), measured(1)[: n - preview] + shift)) + noise


@pytest.mark.parametrize("preview", [200, 170])
@pytest.mark.parametrize("shift", [0.0, 0.1])
def test_equals_plans_made_window_by_window(preview: int, shift: float) -> None:
    r, x = delayed(preview, shift)
    found = run(LookAhead(compensator(preview), float(r[0])), r, x)
    x_d = np.concatenate((np.full(preview, r[0]), r))
    by_window = compensator(preview)
    by_window.restart(float(r[0]), t_init=0.1, lead_in=preview)
    for k in range(0, len(r), 50):
        plan = by_window.plan(x_d[k : k + preview])
        np.testing.assert_array_equal(found[k : k + 50, 0], plan.x_dm)
        np.testing.assert_array_equal(found[k : k + 50, 1], x_d[k : k + 50])
        np.testing.assert_array_equal(found[k : k + 50, 3], plan.x_h)
        np.testing.assert_array_equal(found[k : k + 50, 5], plan.state)
        by_window.update(x[k : k + 50])
    assert {SepState.PHYSICS, SepState.HYBRID} == set(found[:, 5])


def test_a_move_is_prepared_in_the_fill_and_the_fill_is_not_learned() -> None:
    r, x = delayed(200)
    look_ahead = LookAhead(compensator(), float(r[0]))
    found = run(look_ahead, r, x, last=200)
    np.testing.assert_array_equal(found[:, 1], 0.0)
    assert not found[:50, 0].any()  # nothing was in sight yet
    assert found[50:, 0].any()
    assert look_ahead.predictor.regression.n_samples == 0
    run(look_ahead, r, x, 200, 250)
    assert look_ahead.predictor.regression.n_samples == 50


def test_warm_up_counts_from_the_end_of_the_fill() -> None:
    r, x = delayed(200)
    cold = LookAhead(compensator(t_init=0.3), 0.0)
    states = run(cold, r, x)[:, 5]
    assert np.flatnonzero(states == SepState.HYBRID)[0] == 500
    warm = run(LookAhead(cold.model, 0.0, t_init=0.0), r, x)[:, 5]
    assert warm[0] == SepState.HYBRID


def test_running_rms() -> None:
    r, x = delayed(200)
    look_ahead = LookAhead(compensator(), 0.0)
    found = run(look_ahead, r, x)
    first = 200 + 100
    for name, column in (("rms_e", 1), ("rms_pb", 2), ("rms_h", 3)):
        expected = math.sqrt(np.mean((x[first:] - found[first:, column]) ** 2))
        assert getattr(look_ahead, name) == pytest.approx(expected, rel=1e-9)
    assert not found[: first + 1, 7:].any()


@pytest.mark.parametrize("cut", [1, 49, 50, 201, 1234])
def test_a_saved_state_goes_on_bit_for_bit(cut: int) -> None:
    r, x = delayed(200)
    look_ahead = LookAhead(compensator(), 0.0)
    run(look_ahead, r, x, last=cut)
    restored = LookAhead.from_bytes(look_ahead.to_bytes(), SepCompensator)
    assert restored.to_bytes() == look_ahead.to_bytes()
    np.testing.assert_array_equal(run(restored, r, x, first=cut), run(look_ahead, r, x, first=cut))
    assert restored.to_bytes() == look_ahead.to_bytes()


def test_bad_samples_and_foreign_states_are_refused() -> None:
    look_ahead = LookAhead(compensator(), 0.0)
    look_ahead.sample(0.0, 0.0)
    before = look_ahead.to_bytes()
    with pytest.raises(SignalError, match="x_meas must be finite, got nan at sample 1"):
        look_ahead.sample(0.0, math.nan)
    with pytest.raises(SignalError, match="x_d_ahead must be within"):
        look_ahead.sample(1e12, 0.0)
    assert look_ahead.to_bytes() == before
    with pytest.raises(StateError, match="kind 'look-ahead' was expected, got one of kind 'compensator'"):
        LookAhead.from_bytes(look_ahead.model.to_bytes(), SepCompensator)
    with pytest.raises(SignalError, match="start value of x_d_ahead must be finite, got inf"):
        LookAhead(compensator(), math.inf)
