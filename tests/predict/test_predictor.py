"""The predictor against the oracle, its operator, causality; runs: windows, starts, what is kept and refused."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import oracle
import pytest
import staircase_data as staircase
from hypothesis import given
from hypothesis import strategies as st
from library_stream import library_compensator, runaway_predictor, start_values
from predictor_cases import MODEL, replay, small_signals, trained
from properties import examples
from stream import COMPENSATOR

from hybridsep.base.errors import ParameterError, SignalError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.online.look_ahead import LookAhead
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.window import Prediction

NUMERATOR, DENOMINATOR = np.array([staircase.C, staircase.K]), np.array([staircase.M, staircase.C, staircase.K])

PAPER: dict[str, Any] = {"T_s": 1e-3, "Np": 100, "p": 50, "q": 3, "lam": 1e-12, "t_init": 0.3}


@pytest.mark.slow
def test_the_staircase_equals_the_oracle() -> None:
    x_d, x = staircase.commanded(), staircase.measured(0)
    x_pb, x_h, active = replay(HybridPredictor(MODEL, PredictorSettings(**PAPER, averaging=False)), x_d, x)
    slow = oracle.run(NUMERATOR, DENOMINATOR, x_d, x, **PAPER)
    np.testing.assert_allclose(x_pb, slow.x_pb, rtol=0, atol=1e-12)
    np.testing.assert_allclose(x_h, slow.x_h, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(active, slow.active)
    assert active.sum() == 6001 - 300


def test_figures_of_the_paper_and_of_a_warm_start() -> None:
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
def test_is_the_oracle_with_other_parameters(Np: int, p: int, q: int, t_init: float, dead_time: int, hold: str) -> None:
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
    np.testing.assert_allclose(np.convolve(operator.g_pb, x_d)[:n] + operator.free_pb, predicted.x_pb, 0, size)


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


# Runs ----------------------------------------------------------------------------------------------------------------


PLAIN = PredictorSettings(averaging=False)


def test_update_with_the_beginning_of_the_window() -> None:
    # Measuring 4 of 10 samples, then predicting from there, is what a window of 4 does.
    x_d, x = small_signals(70)
    short, exact = trained(50), trained(50)
    short.predict(x_d[50:60])
    exact.predict(x_d[50:54])
    for predictor in (short, exact):
        predictor.update(x[50:54])
        assert predictor.k == 54
    assert short.to_bytes() == exact.to_bytes()
    np.testing.assert_array_equal(short.predict(x_d[54:64]).x_h, exact.predict(x_d[54:64]).x_h)


def test_a_window_longer_than_a_batch_is_learned_whole() -> None:
    x_d, x = small_signals(87)
    whole, parts = trained(50), trained(50)
    whole.predict(x_d[50:87])
    whole.update(x[50:87])
    replay(parts, x_d[50:87], x[50:87])
    np.testing.assert_allclose(whole.weights, parts.weights, rtol=1e-9, atol=1e-9)
    assert whole.k == parts.k == 87
    assert whole.residual.last == pytest.approx(parts.residual.last, abs=1e-16)


def test_start_is_the_first_command_unless_given() -> None:
    x_d, x = small_signals(40, start=0.3)
    implicit, explicit = HybridPredictor(MODEL, PLAIN), HybridPredictor(MODEL, PLAIN, start=float(x_d[0]))
    assert implicit.start is None
    for predictor in (implicit, explicit):
        predictor.predict(x_d)
        predictor.update(x)
        assert predictor.start == x_d[0]
    assert implicit.to_bytes() == explicit.to_bytes()
    # At rest elsewhere, the drive first has to travel.
    elsewhere = HybridPredictor(MODEL, PLAIN, start=0.2).predict(np.full(100, 0.3))
    assert elsewhere.x_pb[0] == pytest.approx(0.2, abs=1e-15)
    # Half a period of 40 ms later it has overshot by exp(−ζ ω t), ζ ω = c / 2m.
    assert elsewhere.x_pb[20] == pytest.approx(0.3 + 0.1 * math.exp(-staircase.C / 2 * 0.020), abs=1e-3)


def test_a_new_run_keeps_the_weights_and_forgets_the_rest() -> None:
    predictor = trained(57)
    weights = predictor.weights.copy()
    predictor.predict(np.zeros(10))
    predictor.restart(0.5, t_init=0.013)
    np.testing.assert_array_equal(predictor.weights, weights)
    assert (predictor.k, predictor.start, predictor.residual.last) == (0, 0.5, 0.0)
    with pytest.raises(SignalError, match=r"^update must follow predict"):
        predictor.update(np.zeros(10))
    np.testing.assert_array_equal(predictor.predict(np.full(20, 0.5)).active, np.arange(20) >= 13)
    # At rest, with zero residuals, only the constant feature is left: w₀ through the recursion.
    predicted = predictor.predict(np.full(1, 0.5))
    assert predicted.e_h[0] == pytest.approx(weights[0], abs=1e-18)


def test_an_automatic_warm_up_of_a_new_run_is_that_of_the_settings() -> None:
    predictor = trained(57, t_init=0.013)
    predictor.restart(t_init=-1.0)
    assert predictor.n_init == HybridPredictor(MODEL, PLAIN).n_init == 300
    predictor.restart()
    assert predictor.n_init == 0


def test_the_last_accepted_residual_of_the_paper_s_model_is_what_was_measured_last() -> None:
    predictor = trained(50)
    x_d, x = small_signals(60)
    predicted = predictor.predict(x_d[50:])
    predictor.update(x[50:57])
    assert predictor.residual.last == pytest.approx(x[56] - predicted.x_pb[6], abs=1e-15)


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda p: p.predict([]), "x_d must have at least one sample, got none"),
        (lambda p: p.predict([0.0, math.nan]), "x_d must be finite, got nan at sample 1"),
        (lambda p: p.predict([[0.0]]), "x_d must be one-dimensional, got shape (1, 1)"),
        (lambda p: p.update([]), "x must have 1 … 10 samples, as predicted, got 0"),
        (lambda p: p.update(np.zeros(11)), "x must have 1 … 10 samples, as predicted, got 11"),
        (lambda p: p.update([0.0, math.inf]), "x must be finite, got inf at sample 1"),
        (lambda p: p.operator(0), "n must be 1 … 100000, got 0"),
        (lambda p: p.operator(3)([0.0]), "x_d must have 3 samples, got 1"),
        (lambda p: p.restart(math.nan), "start must be finite, got nan at sample 0"),
        (lambda p: p.restart(0.1, t_init=-2.0), "t_init must be -1 (automatic) or 0 … 1000000 s, got -2.0"),
        (lambda p: p.restart(0.1, t_init=math.nan), "t_init must be finite, got nan"),
    ],
)
def test_bad_calls_are_refused_and_change_nothing(use: Callable[[HybridPredictor], object], message: str) -> None:
    predictor = trained(50)
    predictor.predict(np.zeros(10))
    before = predictor.to_bytes()
    with pytest.raises((SignalError, ParameterError)) as caught:
        use(predictor)
    assert str(caught.value) == message
    assert predictor.to_bytes() == before


def test_a_predictor_says_its_settings_and_how_much_it_has_learned() -> None:
    found = HybridPredictor(MODEL, PredictorSettings(Np=20, p=5, q=2))
    assert repr(found) == "HybridPredictor(Np = 20, p = 5, q = 2, T_s = 0.001, averaging = True, n_learned = 0)"
    found.predict(np.zeros(20))
    found.update(np.full(20, 1e-6))
    assert repr(found).endswith("n_learned = 20)")


SAID = "x_h must stay within ±1e+100 m: the learned recursion diverges; raise lambda, lower p or reset"


def test_a_direct_prediction_that_diverges_is_refused() -> None:
    with pytest.raises(SignalError) as caught:
        _ = runaway_predictor().predict(np.full(100, 1e-3)).x_h
    assert str(caught.value) == SAID
    with pytest.raises(SignalError, match="x_pb must stay within"):
        _ = Prediction(np.array([np.nan]), np.zeros(1), np.zeros(1), 1).x_h


def test_a_replay_that_diverges_is_refused() -> None:
    x_d = np.full(250, 1e-3)
    x_d[0] = 0.0
    with pytest.raises(SignalError, match="x_h diverges in the window from sample 0 on; raise lambda or lower p"):
        backtest(runaway_predictor(), x_d, np.zeros(250))


def test_a_plan_that_diverges_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {**start_values(COMPENSATOR), "averaging": False, "Np": 100, "t_init": 0.0}
    look_ahead = LookAhead(library_compensator(values), 0.0)
    diverging = Prediction(np.full(100, np.inf), np.zeros(100), np.zeros(100), 0)
    monkeypatch.setattr(look_ahead.predictor, "predict", lambda *_, **__: diverging)
    for _ in range(99):
        look_ahead.sample(0.0, 0.0)
    for _ in range(3):
        with pytest.raises(SignalError, match="x_pb must stay within"):
            look_ahead.sample(0.0, 0.0)
