"""The predictor against the oracle, its operator, and causality."""

from typing import Any

import numpy as np
import oracle
import pytest
import staircase_data as staircase
from hypothesis import given
from hypothesis import strategies as st
from predictor_cases import MODEL, replay, small_signals, trained
from properties import examples

from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.predictor import HybridPredictor

NUMERATOR, DENOMINATOR = np.array([staircase.C, staircase.K]), np.array([staircase.M, staircase.C, staircase.K])


PAPER: dict[str, Any] = {"T_s": 1e-3, "Np": 100, "p": 50, "q": 3, "lam": 1e-12, "t_init": 0.3}


class TestStaircase:
    @pytest.mark.slow
    def test_equals_the_oracle(self) -> None:
        x_d, x = staircase.commanded(), staircase.measured(0)
        x_pb, x_h, active = replay(HybridPredictor(MODEL, PredictorSettings(**PAPER, averaging=False)), x_d, x)
        slow = oracle.run(NUMERATOR, DENOMINATOR, x_d, x, **PAPER)
        np.testing.assert_allclose(x_pb, slow.x_pb, rtol=0, atol=1e-12)
        np.testing.assert_allclose(x_h, slow.x_h, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(active, slow.active)
        assert active.sum() == 6001 - 300

    def test_figures_of_the_paper_and_of_a_warm_start(self) -> None:
        x_d = staircase.commanded()
        physics, cold, warm = [], [], []
        for seed in range(10):
            predictor = HybridPredictor(MODEL, PredictorSettings(**PAPER, averaging=False))
            x = staircase.measured(seed)
            x_pb, x_h, _ = replay(predictor, x_d, x)
            physics.append(rms(x - x_pb))
            cold.append(rms(x - x_h))
            predictor.restart()
            x = staircase.measured(100 + seed)
            warm.append(rms(x - replay(predictor, x_d, x)[1]))
        # µm, RMS against the measured position, mean of ten noise seeds; the paper prints 33.7 and 14.7.
        assert 1e6 * np.mean(physics) == pytest.approx(33.94, abs=0.1)
        assert 1e6 * np.mean(cold) == pytest.approx(14.90, abs=0.2)
        assert 1e6 * np.mean(warm) == pytest.approx(8.95, abs=0.2)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(
    ("Np", "p", "q", "t_init", "dead_time"),
    [(1, 1, 0, 0.0, 0), (7, 7, 0, 0.010, 0), (7, 1, 6, 0.0, 3), (12, 12, 11, 0.0305, 1), (300, 9, 2, 0.1, 0)],
)
def test_equals_the_oracle_with_other_parameters(
    Np: int, p: int, q: int, t_init: float, dead_time: int, hold: str
) -> None:
    modes = [(25.0, 0.05, 20000.0, 15.7), (15.0, 2.0, 1600.0, 3.0)]
    model = ModalModel([Mode(*numbers) for numbers in modes], dead_time)
    x_d, x = small_signals(655, start=0.07)
    parameters: dict[str, Any] = {"T_s": 1e-3, "Np": Np, "p": p, "q": q, "lam": 1e-7, "t_init": t_init}
    x_pb, x_h, active = replay(
        HybridPredictor(model, PredictorSettings(averaging=False, input_hold=hold, **parameters)), x_d, x
    )
    slow = oracle.run(*oracle.transfer_function(modes), x_d, x, hold=hold, dead_time=dead_time, **parameters)
    np.testing.assert_allclose(x_pb, slow.x_pb, rtol=0, atol=1e-13)
    np.testing.assert_allclose(x_h, slow.x_h, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(active, slow.active)


@examples(80)
@given(data=st.data(), Np=st.integers(1, 12), windows=st.integers(0, 8), hold=st.sampled_from(["zoh", "foh"]))
def test_operator_equals_predict(data: st.DataObject, Np: int, windows: int, hold: str) -> None:
    p, q = data.draw(st.integers(1, Np), "p"), data.draw(st.integers(0, Np - 1), "q")
    dead_time = data.draw(st.integers(0, 4), "dead_time")
    start = data.draw(st.sampled_from([0.0, 0.25, -1.5]), "start")
    n = data.draw(st.integers(1, 3 * Np), "n")
    model = ModalModel([Mode(25.0, 0.05, 24674.0, 15.7)], dead_time)
    predictor = HybridPredictor(
        model, PredictorSettings(averaging=False, Np=Np, p=p, q=q, lam=1e-6, t_init=0.0, input_hold=hold), start=start
    )
    replay(predictor, *small_signals(windows * Np + data.draw(st.integers(0, Np - 1), "rest"), start=start))
    operator = predictor.operator(n)
    x_d = start + 0.01 * np.random.default_rng(n).normal(size=n)
    predicted = predictor.predict(x_d)
    size = 1e-13 * (1 + abs(start)) * max(1.0, float(np.max(np.abs(operator.g_h))))
    np.testing.assert_allclose(operator(x_d), predicted.x_h, rtol=0, atol=size)
    np.testing.assert_allclose(operator.G_h @ x_d + operator.free, predicted.x_h, rtol=0, atol=size)
    np.testing.assert_allclose(
        np.convolve(operator.g_pb, x_d)[:n] + operator.free_pb, predicted.x_pb, rtol=0, atol=size
    )


def test_operator_is_lower_triangular_toeplitz_and_of_a_window_by_default() -> None:
    predictor = trained(57)
    operator = predictor.operator()
    assert operator.G_h.shape == (predictor.Np, predictor.Np)
    for j in range(predictor.Np):
        np.testing.assert_array_equal(operator.G_h[j:, j], operator.g_h[: predictor.Np - j])
        np.testing.assert_array_equal(operator.G_h[:j, j], 0.0)


@examples(40)
@given(change=st.integers(0, 9), size=st.floats(1e-6, 10.0))
def test_a_future_command_changes_nothing_earlier(change: int, size: float) -> None:
    predictor = trained(50, input_hold="foh")
    x_d, _ = small_signals(10, seed=3)
    before = predictor.predict(x_d)
    x_d[change] += size
    after = predictor.predict(x_d)
    np.testing.assert_allclose(after.x_pb[:change], before.x_pb[:change], rtol=0, atol=1e-15)
    np.testing.assert_allclose(after.x_h[:change], before.x_h[:change], rtol=0, atol=1e-15)
    assert after.x_h[change] != before.x_h[change]


def test_predicting_changes_nothing_learned() -> None:
    x_d, x = small_signals(100)
    first, second = trained(50), trained(50)
    first.predict(x_d[50:60])
    before = first.to_bytes()
    for other in (x_d[:3], 5 * x_d[:40], x_d[60:70]):
        first.predict(other)
        first.operator(17)
    again = first.predict(x_d[50:60])
    assert first.to_bytes() == before
    np.testing.assert_array_equal(again.x_h, second.predict(x_d[50:60]).x_h)
    for predictor in (first, second):
        predictor.update(x[50:60])
    assert first.to_bytes() == second.to_bytes()
