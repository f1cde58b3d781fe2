"""Disturbances of the user, and those that repeat with the position."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from predictor_cases import MODEL, TS, cycles, physics, run

from benchmarks.periodic import errors
from hybridsep.base.errors import ParameterError, SignalError, StateError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.predict.averaging.features import Disturbance
from hybridsep.predict.predictor import HybridPredictor

START, WALL = 0.3, 0.302  # position of rest, and that beyond which a spring acts, m


def spring(x: Array, v: Array) -> Array:
    """Return the travel into a buffer, m."""
    return np.maximum(x - WALL, 0.0)


def predictor(*own: Disturbance) -> HybridPredictor:
    return HybridPredictor(MODEL, PredictorSettings(), disturbances=iter(own))


def into_the_buffer() -> tuple[Array, Array]:
    """Return commands that run into a weak buffer and positions measured with 0.1 µm of noise."""
    x_d = START + cycles(3000)
    discrete = MODEL.discretise(TS)
    e, x_pb = np.zeros(len(x_d)), physics(x_d)
    for _ in range(20):  # the buffer acts at the position itself
        e = -0.05 * discrete.forced_response(discrete.rest(), spring(x_pb + e, x_d))[0]
    return x_d, x_pb + e + np.random.default_rng(1).normal(0.0, 1e-7, len(x_d))


def test_what_its_function_describes_is_predicted() -> None:
    x_d, x = into_the_buffer()
    predictions = (run(predictor(spring), x_d, x), run(predictor(), x_d, x), physics(x_d))
    own, without, by_physics = (np.std((x - one)[2000:]) for one in predictions)
    assert own < 0.15 * without
    assert own < 0.03 * by_physics


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_the_unit_of_a_disturbance_is_free(scale: float) -> None:
    x_d, x = into_the_buffer()
    found = run(predictor(lambda x, v: scale * spring(x, v)), x_d, x)
    np.testing.assert_allclose(found, run(predictor(spring), x_d, x), rtol=0.0, atol=1e-12)


def test_what_a_constant_function_adds_is_nothing() -> None:
    x_d, x = into_the_buffer()
    found = run(predictor(lambda x, v: 5.0), x_d, x)  # an offset, and the constant has its feature already
    np.testing.assert_allclose(found, run(predictor(), x_d, x), rtol=0.0, atol=1e-12)


def test_copies_keep_the_functions_and_states_ask_for_them(tmp_path: Path) -> None:
    x_d, x = into_the_buffer()
    first = predictor(spring)
    run(first, x_d[:1500], x[:1500])
    expected = first.predict(x_d[1500:1600]).x_h
    first.save(tmp_path / "trained.state")
    loaded = HybridPredictor.load(tmp_path / "trained.state", (spring,))
    for one in (copy.deepcopy(first), pickle.loads(pickle.dumps(first)), loaded):
        assert one.disturbances == (spring,)
        np.testing.assert_array_equal(one.predict(x_d[1500:1600]).x_h, expected)
    with pytest.raises(StateError, match="learned with 1 disturbances of the user's own, got 0"):
        HybridPredictor.load(tmp_path / "trained.state")
    with pytest.raises(StateError, match="learned with 0 disturbances of the user's own, got 1"):
        HybridPredictor.from_bytes(predictor().to_bytes(), (spring,))


@pytest.mark.parametrize(
    ("returned", "complaint"),
    [
        (np.zeros(3), "return a number for each of 1 samples, got shape"),
        (np.nan, "be finite"),
        (np.inf, "be finite"),
        (1e101, r"be finite and at most 1e\+100"),
        ("much", "return numbers"),
    ],
)
def test_what_is_no_disturbance_is_refused_and_nothing_is_learned(returned: ArrayLike, complaint: str) -> None:
    x_d, _ = into_the_buffer()
    one = predictor(spring, lambda x, v: returned)
    before = one.to_bytes()
    with pytest.raises(SignalError, match=rf"disturbances\[1\] must .*{complaint}"):
        one.predict(x_d[:100])
    assert one.to_bytes() == before


def test_a_function_that_fails_where_the_drive_was_measured_changes_nothing() -> None:
    x_d, x = into_the_buffer()
    one = predictor(lambda x, v: np.where(x > START + 0.006, np.nan, spring(x, v)))
    twin = predictor(spring)
    one.predict(x_d[:100])
    twin.predict(x_d[:100])
    before = one.to_bytes()
    with pytest.raises(SignalError, match=r"disturbances\[0\] must be finite"):
        one.update(x[:100] + 0.004)  # the command goes to 5 mm at most
    assert one.to_bytes() == before
    for each in (one, twin):
        each.update(x[:100])
    np.testing.assert_array_equal(one.predict(x_d[100:200]).x_h, twin.predict(x_d[100:200]).x_h)


def test_disturbances_need_averaging_and_must_be_functions() -> None:
    with pytest.raises(ParameterError, match="with averaging = true only"):
        HybridPredictor(MODEL, PredictorSettings(averaging=False), disturbances=(spring,))
    with pytest.raises(ParameterError, match=r"disturbances\[1\] must be a function of x and v, got 3"):
        HybridPredictor(MODEL, disturbances=(spring, 3))  # type: ignore[arg-type]


COGGING = 20e-6, 0.005  # amplitude and pitch, m; the noise is 1 µm


@pytest.mark.parametrize("second_start", [0.0, 0.0313])
def test_what_repeats_is_predicted_to_the_noise_wherever_a_run_starts(second_start: float) -> None:
    cold, warm = errors(*COGGING, COGGING[1], (0.0, second_start))
    without = errors(*COGGING, 0.0, (0.0, second_start))
    assert cold < 0.7 * without[0]
    assert warm < 1.2 < 10.0 < without[1]


def test_another_period_does_no_harm() -> None:
    for wrong, without in zip(errors(*COGGING, 0.83 * COGGING[1]), errors(*COGGING, 0.0), strict=True):
        assert wrong < 1.05 * without
