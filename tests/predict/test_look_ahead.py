"""The look-ahead: the timing contract, sample by sample, against windows given to the predictor directly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from staircase_data import commanded, measured

from hybridsep import HybridPredictor, ModalModel, backtest
from hybridsep.base.errors import SignalError, StateError
from hybridsep.base.settings import PredictorSettings
from hybridsep.predict.look_ahead import LookAhead

MODEL = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)


def run(
    look_ahead: LookAhead, r: np.ndarray, x: np.ndarray, first: int = 0, last: int | None = None
) -> list[tuple[float, ...]]:
    """Feed samples ``first … last − 1`` and return the outputs after each."""
    outputs: list[tuple[float, ...]] = []
    for k in range(first, len(r) if last is None else last):
        look_ahead.sample(float(r[k]), float(x[k]))
        outputs.append(
            (
                look_ahead.x_d,
                look_ahead.x_pb,
                look_ahead.x_h,
                float(look_ahead.hybrid_active),
                look_ahead.rms_pb,
                look_ahead.rms_h,
            )
        )
    return outputs


def delayed(shift: float = 0.0, Np: int = 100, n: int = 2500) -> tuple[np.ndarray, np.ndarray]:
    """Return ``r(k)`` and the measurement of a drive that gets it ``Np`` samples later."""
    r = commanded()[:n] + shift
    x = np.concatenate((np.full(Np, r[0]), measured(1)[: n - Np] + shift))
    return r, x


@pytest.mark.parametrize("shift", [0.0, 0.1])
def test_equals_the_backtest_of_the_delayed_log(shift: float) -> None:
    r, x = delayed(shift)
    outputs = np.array(run(LookAhead(HybridPredictor(MODEL, start=None), float(r[0])), r, x))
    result = backtest(HybridPredictor(MODEL), r[:-100], x[100:])
    # After sample k the outputs are those of k + 1; the log begins with sample Np.
    n = len(r) - 101
    np.testing.assert_array_equal(outputs[99:-1, 0], r[: n + 1])
    np.testing.assert_allclose(outputs[99:-1, 1], result.x_pb[: n + 1], rtol=0, atol=1e-16)
    np.testing.assert_allclose(outputs[99:-1, 2], result.x_h[: n + 1], rtol=0, atol=1e-16)
    np.testing.assert_array_equal(outputs[99:-1, 3] == 1.0, result.active[: n + 1])


def test_first_fill_keeps_the_drive_at_its_start() -> None:
    look_ahead = LookAhead(HybridPredictor(MODEL), 0.25)
    assert (look_ahead.x_d, look_ahead.x_pb, look_ahead.x_h, look_ahead.e_servo) == (0.25, 0.25, 0.25, 0.0)
    assert (look_ahead.batch, look_ahead.hybrid_active, look_ahead.rms_pb, look_ahead.rms_h) == (0, False, 0.0, 0.0)
    for k in range(99):
        look_ahead.sample(0.3, 17.0)  # what is measured during the fill is not learned
        assert (look_ahead.x_d, look_ahead.x_h, look_ahead.batch) == (0.25, 0.25, 0), k
    look_ahead.sample(0.3, 17.0)
    assert (look_ahead.x_d, look_ahead.batch) == (0.3, 1)
    assert not look_ahead.predictor.weights.any()
    assert look_ahead.predictor.regression.n_samples == 0


def test_running_rms_counts_from_t_init() -> None:
    r, x = delayed()
    look_ahead = LookAhead(HybridPredictor(MODEL, PredictorSettings(t_init=0.25)), float(r[0]))
    x_pb, x_h = [look_ahead.x_pb], [look_ahead.x_h]
    for k in range(len(r)):
        look_ahead.sample(float(r[k]), float(x[k]))
        x_pb.append(look_ahead.x_pb)
        x_h.append(look_ahead.x_h)
        first = 100 + 250  # the fill, then t_init
        if k >= first:
            expected = math.sqrt(np.mean((x[first : k + 1] - np.array(x_h[first : k + 1])) ** 2))
            assert look_ahead.rms_h == pytest.approx(expected, rel=1e-9)
        else:
            assert look_ahead.rms_h == 0.0
    assert look_ahead.rms_pb == pytest.approx(math.sqrt(np.mean((x[350:] - np.array(x_pb[350:-1])) ** 2)), rel=1e-9)
    assert look_ahead.rms_h < look_ahead.rms_pb


@pytest.mark.parametrize("cut", [1, 99, 100, 101, 1234])
def test_a_saved_state_goes_on_bit_for_bit(cut: int) -> None:
    r, x = delayed(n=1700)
    look_ahead = LookAhead(HybridPredictor(MODEL), float(r[0]))
    run(look_ahead, r, x, last=cut)
    restored = LookAhead.from_bytes(look_ahead.to_bytes(), HybridPredictor)
    assert restored.to_bytes() == look_ahead.to_bytes()
    assert run(restored, r, x, first=cut) == run(look_ahead, r, x, first=cut)


def test_foreign_states_are_refused() -> None:
    look_ahead = LookAhead(HybridPredictor(MODEL), 0.0)
    with pytest.raises(StateError, match="truncated or damaged"):
        LookAhead.from_bytes(look_ahead.to_bytes()[:-1], HybridPredictor)
    with pytest.raises(StateError, match="kind 'look-ahead' was expected, got one of kind 'predictor'"):
        LookAhead.from_bytes(look_ahead.predictor.to_bytes(), HybridPredictor)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((math.nan, 0.0), "x_d_ahead must be finite, got nan at sample 3"),
        ((0.0, math.inf), "x_meas must be finite, got inf at sample 3"),
        ((0.0, 1e4), "x_meas must be within ±1000 m, got 10000 at sample 3"),
    ],
)
def test_a_bad_sample_changes_nothing(values: tuple[float, float], message: str) -> None:
    look_ahead = LookAhead(HybridPredictor(MODEL), 0.0)
    run(look_ahead, np.arange(3.0), np.arange(3.0))
    before = look_ahead.to_bytes()
    with pytest.raises(SignalError, match=message):
        look_ahead.sample(*values)
    assert look_ahead.to_bytes() == before


def test_start_must_be_finite() -> None:
    with pytest.raises(SignalError, match="start value of x_d_ahead must be finite, got nan"):
        LookAhead(HybridPredictor(MODEL), math.nan)
