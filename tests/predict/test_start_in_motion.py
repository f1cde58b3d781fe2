"""A run that begins in motion: the state of the physics model from its first window."""

import numpy as np
import pytest
from predictor_cases import FRICTION, MODEL, TS, averaged, cycles, friction, physics

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.predictor import HybridPredictor

MODES = ((30, 0.1, 0.6, 9), (90, 0.05, 0.4, -5))  # f_n, Hz, zeta, static gain, beta, 1/s: together of unit static gain
STAGE = ModalModel([Mode(f, zeta, gain * (2 * np.pi * f) ** 2, beta) for f, zeta, gain, beta in MODES], dead_time=4)

CUT = 400  # samples of a motion before a run


def in_motion(model: ModalModel, hold: str = "zoh", size: float = 1.0) -> tuple[Array, Array]:
    """Return commands and positions of a linear drive that was in motion before, (n,), m."""
    x_d = size * (cycles(1400) + 2e-3 * np.arange(1400) / 100)
    discrete = model.discretise(TS, hold)
    return x_d[CUT:], discrete.forced_response(discrete.rest(), x_d)[0][CUT:]


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("model", [MODEL, STAGE])
@pytest.mark.parametrize("delay", [0, 7])
def test_the_state_is_found_in_the_first_window(model: ModalModel, hold: str, delay: int) -> None:
    """But for what the commands before, which are not known, differ from a constant velocity."""
    x_d, x = in_motion(model, hold)
    errors = []
    for averaging in (True, False):
        settings = PredictorSettings(averaging=averaging, input_hold=hold, measurement_delay=delay)
        each = HybridPredictor(model, settings)
        each.predict(x_d[delay : 100 + delay])
        each.update(x[:100])
        errors.append(np.abs(each.predict(x_d[100 + delay : 200 + delay]).x_pb - x[100 + delay : 200 + delay]).max())
    assert errors[0] < 0.05 * errors[1]


def test_the_paper_begins_at_rest() -> None:
    x_d, x = in_motion(MODEL)
    paper = HybridPredictor(MODEL, PredictorSettings(averaging=False))
    for k in range(0, 300, 100):
        np.testing.assert_allclose(paper.predict(x_d[k : k + 100]).x_pb, physics(x_d)[k : k + 100], rtol=0, atol=1e-12)
        paper.update(x[k : k + 100])


def test_a_drive_at_rest_stays_there_though_its_command_moves_at_once() -> None:
    x_d = cycles(300)
    predictor = averaged()
    for k in range(0, 300, 100):
        expected = physics(x_d)[k : k + 100]
        np.testing.assert_allclose(predictor.predict(x_d[k : k + 100]).x_pb, expected, rtol=0, atol=1e-12)
        predictor.update((physics(x_d) + friction(x_d, 5 * FRICTION))[k : k + 100])


@pytest.mark.parametrize("n", [3, 4])
def test_few_samples_tell_nothing(n: int) -> None:
    """Two of each number of the state are needed, here four."""
    x_d, x = in_motion(MODEL)
    predictor = averaged()
    predictor.predict(x_d[:100])
    predictor.update(x[:n])
    found = predictor.predict(x_d[n : n + 100]).x_pb
    assert (np.abs(found - physics(x_d)[n : n + 100]).max() > 1e-6) == (n == 4)


def test_missing_samples_are_left_out() -> None:
    x_d, x = in_motion(MODEL)
    x[10:60:3] = np.nan
    predictor = averaged()
    predictor.predict(x_d[:100])
    predictor.update(x[:100])
    assert np.abs(predictor.predict(x_d[100:200]).x_pb - x[100:200]).max() < 1e-5


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_the_unit_has_no_effect(size: float) -> None:
    predictions = []
    for scale in (1.0, size):
        x_d, x = in_motion(MODEL, size=scale)
        predictor = averaged()
        for k in range(0, 400, 100):
            found = predictor.predict(x_d[k : k + 100])
            predictor.update(x[k : k + 100])
        predictions.append(found.x_h / scale)
    np.testing.assert_allclose(predictions[1], predictions[0], rtol=0, atol=1e-9)
