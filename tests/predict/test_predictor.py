"""The predictor against the per-sample oracle, the paper's figures and its own affine operator."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import oracle
import pytest
import staircase_data as staircase
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hybridsep.base.errors import ParameterError, SignalError, StateError
from hybridsep.base.settings import PredictorSettings
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.window import Prediction

Array = NDArray[np.float64]

MODEL = ModalModel.spring_mass_damper(staircase.M, staircase.C, staircase.K)
NUMERATOR, DENOMINATOR = np.array([staircase.C, staircase.K]), np.array([staircase.M, staircase.C, staircase.K])
PAPER: dict[str, Any] = {"T_s": 1e-3, "Np": 100, "p": 50, "q": 3, "lam": 1e-12, "t_init": 0.3}


def replay(predictor: HybridPredictor, x_d: Array, x: Array) -> tuple[Array, Array, Array]:
    """Predict then measure, window after window, the last one short; return x_pb, x_h and whether x_h is hybrid."""
    windows: list[Prediction] = []
    for first in range(0, len(x_d), predictor.Np):
        windows.append(predictor.predict(x_d[first : first + predictor.Np]))
        predictor.update(x[first : first + predictor.Np])
    return (
        np.array([position for window in windows for position in window.x_pb]),
        np.array([position for window in windows for position in window.x_h]),
        np.array([active for window in windows for active in window.active], dtype=bool),
    )


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


@lru_cache(maxsize=1)
def replayed() -> tuple[Array, Array, Array]:
    """Return the paper's run with noise seed 0."""
    return replay(HybridPredictor(MODEL, PredictorSettings(**PAPER)), staircase.commanded(), staircase.measured(0))


def small_signals(n: int, seed: int = 0, start: float = 0.0) -> tuple[Array, Array]:
    """Return a smooth command and a measurement off the model by a smooth residual and noise, (n,), m."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 1e-3
    x_d = start + 0.01 * (np.sin(40 * t) + 0.3 * np.cos(97 * t + seed) - 0.3 * math.cos(seed))
    x = x_d + 1e-4 * np.tanh(3 * np.cos(40 * t)) + 1e-5 * rng.normal(size=n)
    return np.asarray(x_d, dtype=np.float64), np.asarray(x, dtype=np.float64)


def trained(n: int, **changes: Any) -> HybridPredictor:
    """Return a small predictor in mid-run, after n samples."""
    settings_ = {"T_s": 1e-3, "Np": 10, "p": 4, "q": 2, "lam": 1e-9, "t_init": 0.0} | changes
    predictor = HybridPredictor(ModalModel([Mode(25.0, 0.05, 24674.0, 15.7)]), PredictorSettings(**settings_))
    x_d, x = small_signals(n)
    replay(predictor, x_d, x)
    return predictor


class TestStaircase:
    def test_equals_the_oracle(self) -> None:
        x_pb, x_h, active = replayed()
        slow = oracle.run(NUMERATOR, DENOMINATOR, staircase.commanded(), staircase.measured(0), **PAPER)
        np.testing.assert_allclose(x_pb, slow.x_pb, rtol=0, atol=1e-12)
        np.testing.assert_allclose(x_h, slow.x_h, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(active, slow.active)
        assert active.sum() == 6001 - 300

    def test_equals_the_oracle_elsewhere_on_the_axis(self) -> None:
        x_d, x = staircase.commanded() + 0.1, staircase.measured(0) + 0.1
        _, x_h, _ = replay(HybridPredictor(MODEL, PredictorSettings(**PAPER)), x_d, x)
        slow = oracle.run(NUMERATOR, DENOMINATOR, x_d, x, **PAPER)
        np.testing.assert_allclose(x_h, slow.x_h, rtol=0, atol=1e-12)
        np.testing.assert_allclose(x_h - 0.1, replayed()[1], rtol=0, atol=1e-10)

    def test_figures_of_the_paper_and_of_a_warm_start(self) -> None:
        x_d = staircase.commanded()
        physics, cold, warm = [], [], []
        for seed in range(10):
            predictor = HybridPredictor(MODEL, PredictorSettings(**PAPER))
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
    [
        (1, 1, 0, 0.0, 0),
        (7, 7, 0, 0.010, 0),
        (7, 1, 6, 0.0, 3),
        (12, 12, 11, 0.0305, 1),
        (300, 9, 2, 0.1, 0),
    ],
)
def test_equals_the_oracle_with_other_parameters(
    Np: int, p: int, q: int, t_init: float, dead_time: int, hold: str
) -> None:
    modes = [(25.0, 0.05, 20000.0, 15.7), (15.0, 2.0, 1600.0, 3.0)]
    model = ModalModel([Mode(*numbers) for numbers in modes], dead_time)
    x_d, x = small_signals(655, start=0.07)
    parameters: dict[str, Any] = {"T_s": 1e-3, "Np": Np, "p": p, "q": q, "lam": 1e-7, "t_init": t_init}
    x_pb, x_h, active = replay(HybridPredictor(model, PredictorSettings(input_hold=hold, **parameters)), x_d, x)
    slow = oracle.run(*oracle.transfer_function(modes), x_d, x, hold=hold, dead_time=dead_time, **parameters)
    np.testing.assert_allclose(x_pb, slow.x_pb, rtol=0, atol=1e-13)
    np.testing.assert_allclose(x_h, slow.x_h, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(active, slow.active)


@pytest.mark.parametrize(("t_init", "count"), [(0.0, 0), (0.010, 10), (0.0234, 24), (0.1, 100)])
def test_warm_up_counts_samples_inside_a_window(t_init: float, count: int) -> None:
    predictor = trained(0, t_init=t_init)
    x_d, x = small_signals(60)
    assert predictor.predict(x_d[:10]).n_warm_up == min(count, 10)
    x_pb, x_h, active = replay(predictor, x_d, x)
    np.testing.assert_array_equal(active, np.arange(60) >= count)
    np.testing.assert_array_equal(x_h[:count], x_pb[:count])
    # It learns from the first window on: beyond the warm-up the second window already differs.
    late = max(count, 10)
    assert np.all(x_h[late:] != x_pb[late:])
    np.testing.assert_array_equal(x_pb[:10], x_h[:10])


@settings(max_examples=80)
@given(data=st.data(), Np=st.integers(1, 12), windows=st.integers(0, 8), hold=st.sampled_from(["zoh", "foh"]))
def test_operator_equals_predict(data: st.DataObject, Np: int, windows: int, hold: str) -> None:
    p, q = data.draw(st.integers(1, Np), "p"), data.draw(st.integers(0, Np - 1), "q")
    dead_time = data.draw(st.integers(0, 4), "dead_time")
    start = data.draw(st.sampled_from([0.0, 0.25, -1.5]), "start")
    n = data.draw(st.integers(1, 3 * Np), "n")
    model = ModalModel([Mode(25.0, 0.05, 24674.0, 15.7)], dead_time)
    predictor = HybridPredictor(
        model, PredictorSettings(Np=Np, p=p, q=q, lam=1e-6, t_init=0.0, input_hold=hold), start=start
    )
    replay(predictor, *small_signals(windows * Np + data.draw(st.integers(0, Np - 1), "rest"), start=start))
    operator = predictor.operator(n)
    x_d = start + 0.01 * np.random.default_rng(n).normal(size=n)
    predicted = predictor.predict(x_d)
    size = 1e-13 * (1 + abs(start)) * max(1.0, float(np.max(np.abs(operator.g_h))))
    np.testing.assert_allclose(operator(x_d), predicted.x_h, rtol=0, atol=size)
    np.testing.assert_allclose(operator.G_h @ x_d + operator.free, predicted.x_h, rtol=0, atol=size)
    np.testing.assert_allclose(operator.G_pb @ x_d + operator.free_pb, predicted.x_pb, rtol=0, atol=size)


def test_operator_is_lower_triangular_toeplitz_and_of_a_window_by_default() -> None:
    predictor = trained(57)
    operator = predictor.operator()
    assert operator.G_h.shape == (predictor.Np, predictor.Np)
    for G, g in ((operator.G_h, operator.g_h), (operator.G_pb, operator.g_pb)):
        for j in range(predictor.Np):
            np.testing.assert_array_equal(G[j:, j], g[: predictor.Np - j])
            np.testing.assert_array_equal(G[:j, j], 0.0)
    # Column by column, what a unit command changes
    free = predictor.predict(np.zeros(predictor.Np)).x_h
    columns = [predictor.predict(np.eye(predictor.Np)[j]).x_h - free for j in range(predictor.Np)]
    np.testing.assert_allclose(operator.G_h, np.array(columns).T, rtol=0, atol=1e-12)


@settings(max_examples=40)
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
    assert whole.last_residual() == pytest.approx(parts.last_residual(), abs=1e-16)


def test_start_is_the_first_command_unless_given() -> None:
    x_d, x = small_signals(40, start=0.3)
    implicit, explicit = HybridPredictor(MODEL), HybridPredictor(MODEL, start=float(x_d[0]))
    assert implicit.start is None
    for predictor in (implicit, explicit):
        predictor.predict(x_d)
        predictor.update(x)
        assert predictor.start == x_d[0]
    assert implicit.to_bytes() == explicit.to_bytes()
    # At rest elsewhere, the drive first has to travel.
    elsewhere = HybridPredictor(MODEL, start=0.2).predict(np.full(100, 0.3))
    assert elsewhere.x_pb[0] == pytest.approx(0.2, abs=1e-15)
    # Half a period of 40 ms later it has overshot by exp(−ζ ω t), ζ ω = c / 2m.
    assert elsewhere.x_pb[20] == pytest.approx(0.3 + 0.1 * math.exp(-staircase.C / 2 * 0.020), abs=1e-3)


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("way", ["bytes", "file", "copy", "deepcopy", "pickle"])
def test_saved_in_mid_run_continues_bit_for_bit(way: str, measured: bool, tmp_path: Path) -> None:
    x_d, x = small_signals(120)
    model = ModalModel([Mode(25.0, 0.05, 24674.0, 15.7), Mode(90.0, 1.5, -40.0, 0.1)], 2)
    original = HybridPredictor(
        model, PredictorSettings(Np=10, p=4, q=2, lam=1e-9, t_init=0.071, input_hold="foh"), start=0.001
    )
    replay(original, x_d[:63], x[:63])
    if not measured:
        original.predict(x_d[63:73])
    original.save(tmp_path / "predictor.hsep")
    ways: dict[str, Callable[[], HybridPredictor]] = {
        "bytes": lambda: HybridPredictor.from_bytes(original.to_bytes()),
        "file": lambda: HybridPredictor.load(tmp_path / "predictor.hsep"),
        "copy": lambda: copy.copy(original),
        "deepcopy": lambda: copy.deepcopy(original),
        "pickle": lambda: pickle.loads(pickle.dumps(original)),
    }
    twin = ways[way]()
    assert twin.to_bytes() == original.to_bytes()
    if not measured:
        original.update(x[63:73])
        twin.update(x[63:73])
    here, there = replay(original, x_d[73:], x[73:]), replay(twin, x_d[73:], x[73:])
    for mine, yours in zip(here, there, strict=True):
        np.testing.assert_array_equal(mine, yours)
    assert twin.to_bytes() == original.to_bytes()


def test_a_new_run_keeps_the_weights_and_forgets_the_rest() -> None:
    predictor = trained(57)
    weights = predictor.weights.copy()
    predictor.predict(np.zeros(10))
    predictor.restart(0.5, t_init=0.013)
    np.testing.assert_array_equal(predictor.weights, weights)
    assert (predictor.k, predictor.start, predictor.last_residual()) == (0, 0.5, 0.0)
    with pytest.raises(SignalError, match=r"^update must follow predict"):
        predictor.update(np.zeros(10))
    np.testing.assert_array_equal(predictor.predict(np.full(20, 0.5)).active, np.arange(20) >= 13)
    # At rest, with zero residuals, only the constant feature is left: w₀ through the recursion.
    predicted = predictor.predict(np.full(1, 0.5))
    assert predicted.e_h[0] == pytest.approx(weights[0], abs=1e-18)


def test_the_warm_up_of_a_new_run_is_saved() -> None:
    predictor = trained(57, t_init=0.5)
    predictor.restart(t_init=0.013)
    replay(predictor, *small_signals(10))
    twin = HybridPredictor.from_bytes(predictor.to_bytes())
    assert twin.predict(np.zeros(10)).n_warm_up == predictor.predict(np.zeros(10)).n_warm_up == 3


def test_last_residual_is_what_was_measured_last() -> None:
    predictor = trained(50)
    x_d, x = small_signals(60)
    predicted = predictor.predict(x_d[50:])
    predictor.update(x[50:57])
    assert predictor.last_residual() == pytest.approx(x[56] - predicted.x_pb[6], abs=1e-15)


def test_memory_does_not_grow() -> None:
    predictor = trained(50)
    size = len(predictor.to_bytes())
    x_d, x = small_signals(950)
    replay(predictor, x_d, x)
    assert len(predictor.to_bytes()) - size <= 8  # only the digits of the counters


def test_fmi_names() -> None:
    parameters = {"lambda": 1e-9, "T_s": 5e-4, "input_hold": 1, "Np": 8, "p": 3, "q": 1, "t_init": 0.0}
    predictor = HybridPredictor(MODEL, PredictorSettings.from_fmi(parameters), start=0.5)
    assert (predictor.settings.lam, predictor.T_s, predictor.discrete.input_hold) == (1e-9, 5e-4, "foh")
    assert (predictor.Np, predictor.settings.p, predictor.settings.q, predictor.start) == (8, 3, 1, 0.5)
    assert predictor.n_features == len(predictor.weights) == 6
    with pytest.raises(ParameterError, match=r"^input_hold must be 0 … 1, got 2$"):
        HybridPredictor(MODEL, PredictorSettings.from_fmi({"input_hold": 2}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"p": 120}, "p must be 1 … Np = 100, got 120; lower p or raise Np"),
        ({"q": 100}, "q must be 0 … Np − 1 = 99, got 100; lower q or raise Np"),
        ({"Np": 0, "lam": -1.0}, "Np must be 1 … 100000, got 0; lambda must be 1e-40 … 1e+12 m2, got -1.0"),
        ({"T_s": 0.0}, "T_s must be 1e-05 … 1 s, got 0.0"),
        ({"t_init": -0.1}, "t_init must be 0 … 1000000 s, got -0.1"),
        ({"input_hold": "soh"}, "input_hold must be one of zoh, foh, got 'soh'"),
    ],
)
def test_parameters_that_do_not_fit(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        HybridPredictor(MODEL, PredictorSettings(**change))
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda p: p.predict([]), "x_d must have at least one sample, got none"),
        (lambda p: p.predict([0.0, math.nan]), "x_d must be finite, got nan at sample 1"),
        (lambda p: p.predict([[0.0]]), "x_d must be one-dimensional, got shape (1, 1)"),
        (lambda p: p.update([]), "x must have 1 … 10 samples, as predicted, got 0"),
        (lambda p: p.update(np.zeros(11)), "x must have 1 … 10 samples, as predicted, got 11"),
        (lambda p: p.update([0.0, math.inf]), "x must be finite, got inf at sample 1"),
        (lambda p: p.operator(0), "n must be ≥ 1, got 0"),
        (lambda p: p.operator(3)([0.0]), "x_d must have 3 samples, got 1"),
        (lambda p: p.restart(math.nan), "start must be finite, got nan at sample 0"),
        (lambda p: p.restart(0.1, t_init=-1.0), "t_init must be 0 … 1000000 s, got -1.0"),
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


def test_update_must_follow_predict() -> None:
    predictor = trained(50)
    with pytest.raises(SignalError, match=r"^update must follow predict: there is no predicted window to measure$"):
        predictor.update(np.zeros(10))


def test_a_file_that_is_no_predictor(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("t,x_d,x\n" * 10)
    with pytest.raises(StateError, match=r"^a saved state of kind 'predictor' was expected, got 80 bytes of"):
        HybridPredictor.load(path)
