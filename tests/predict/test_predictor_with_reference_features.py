"""The predictor with features of the reference: truth, operator, states, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_feature_cases import TS, V_S, formula, reversing

from hybridsep.base.errors import ParameterError, SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.machines.paper import paper_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.encoder import Encoder
from hybridsep.plants.plant import simulate
from hybridsep.plants.trajectory import spiral
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.reference_features import N_REFERENCE

MODES = [(25.0, 0.05, 24674.0, 15.7)]


MODEL = ModalModel([Mode(*numbers) for numbers in MODES])


def small(**changes: Any) -> HybridPredictor:
    values = {"T_s": TS, "Np": 20, "p": 5, "q": 3, "lam": 1e-9, "t_init": 0.0, "v_friction": V_S} | changes
    start = values.pop("start", None)
    return HybridPredictor(MODEL, PredictorSettings(**{"trust": False, **values}), start=start)


@lru_cache(maxsize=1)
def signals() -> tuple[Array, Array, Array]:
    """Return a reference, a command that differs from it, and a position that jumps where the reference turns."""
    rng = np.random.default_rng(5)
    r = reversing(700)
    x_d = r + 2e-5 * np.sin(0.11 * np.arange(700))
    speed = np.diff(r, prepend=r[0]) / TS
    lag = np.convolve(np.tanh(speed / V_S), np.full(12, 1 / 12))[:700]
    x, _ = MODEL.discretise(TS, "zoh").forced_response(MODEL.discretise(TS, "zoh").rest(), x_d - 5e-5 * lag)
    return r, x_d, x + 1e-6 * rng.normal(size=700)


def follow(
    predictor: HybridPredictor, first: int, last: int, *, n: int = 20, ahead: int = 700, with_reference: bool = True
) -> Array:
    """Predict and measure samples ``first … last − 1`` in windows of ``n``; return x_h."""
    r, x_d, x = signals()
    found = []
    for k in range(first, last, n):
        stop = min(k + n, last)
        reference = r[k : min(stop + ahead, len(r))] if with_reference else None
        found.append(predictor.predict(x_d[k:stop], reference=reference).x_h)
        predictor.update(x[k:stop])
    return np.concatenate(found)


@pytest.mark.parametrize("ahead", [0, 15, 60])
def test_weights_are_the_directly_solved_ridge_problem(ahead: int) -> None:
    """Eq. (6) with thirteen more columns."""
    predictor = small()
    r, x_d, x = signals()
    follow(predictor, 0, 600, ahead=ahead)
    start = float(x_d[0])
    x_pb = oracle.physics(*oracle.transfer_function(MODES), (x_d[:600] - start).tolist(), T_s=TS)
    e_pb = (x[:600] - start - np.array(x_pb)).tolist()
    rows = np.array([oracle.features(x_pb, e_pb, k, 5, 3) for k in range(600)])
    psi = [formula(r.tolist(), start, k, 20, min(k + 20 + ahead, 700)) for k in range(0, 600, 20)]
    rows = np.column_stack((rows, np.concatenate(psi)))
    exact = oracle.ridge_extended(rows, np.array(e_pb), predictor.settings.lam).astype(np.float64)
    assert predictor.n_features == len(exact) == 2 + 3 + 5 + N_REFERENCE
    assert np.linalg.norm(predictor.weights - exact) <= 1e-9 * np.linalg.norm(exact)
    np.testing.assert_array_equal(predictor.residual_weights, predictor.weights[5:10])
    assert np.abs(predictor.weights[10:]).max() > 1e-4  # something was learned of the path


@pytest.mark.parametrize("ahead", [0, 30, 700])
def test_a_batch_equals_its_rows_one_by_one(ahead: int) -> None:
    """Eq. (4), sample by sample with each its own prediction as the next one's residual."""
    predictor = small()
    r, x_d, x = signals()
    follow(predictor, 0, 300, ahead=ahead)
    start, stop = float(x_d[0]), min(320 + ahead, 700)
    x_pb = oracle.physics(*oracle.transfer_function(MODES), (x_d[:320] - start).tolist(), T_s=TS)
    guessed = (x[:300] - start - np.array(x_pb[:300])).tolist()
    path = formula(r.tolist(), start, 300, 20, stop)
    for k in range(300, 320):
        phi = np.array([*oracle.features(x_pb, guessed, k, 5, 3), *path[k - 300]])
        guessed.append(float(predictor.weights @ phi))
    predicted = predictor.predict(x_d[300:320], reference=r[300:stop])
    np.testing.assert_allclose(predicted.e_h, guessed[300:], rtol=0, atol=1e-12)


@settings(max_examples=40)
@given(n=st.integers(1, 60), learned=st.integers(0, 300), more=st.integers(0, 80), seed=st.integers(0, 2**31))
def test_operator_equals_predict(n: int, learned: int, more: int, seed: int) -> None:
    """The path is a part of the free response: whatever the commands, the same one."""
    predictor = small(start=0.0)
    if learned:
        follow(predictor, 0, learned)
    rng = np.random.default_rng(seed)
    x_d, path = 1e-3 * rng.normal(size=n), np.cumsum(rng.normal(0, V_S * TS, n + more))
    operator = predictor.operator(n, reference=path[:n])
    predicted = predictor.predict(x_d, reference=path[:n])
    size = 1e-13 * max(1.0, float(np.max(np.abs(operator.g_h))))
    np.testing.assert_allclose(operator(x_d), predicted.x_h, rtol=0, atol=size)
    np.testing.assert_allclose(operator.G_h @ x_d + operator.free, predicted.x_h, rtol=0, atol=size)
    # What follows the window is seen by its last samples alone.
    longer = predictor.predict(x_d, reference=path)
    np.testing.assert_array_equal(longer.x_h[: max(n - 40, 0)], predicted.x_h[: max(n - 40, 0)])


def test_a_path_at_rest_is_meant_where_an_operator_gets_none() -> None:
    predictor = small()
    follow(predictor, 0, 300)
    assert predictor.start is not None
    held = np.full(30, predictor.start)
    np.testing.assert_array_equal(predictor.operator(30).free, predictor.operator(30, reference=held).free)
    moving = predictor.operator(30, reference=held + 1e-5 * np.arange(30))
    assert np.max(np.abs(moving.free - predictor.operator(30).free)) > 1e-6
    np.testing.assert_array_equal(moving.free_pb, predictor.operator(30).free_pb)  # physics knows no friction


def test_the_command_is_its_own_reference_unless_another_is_given() -> None:
    _, x_d, x = signals()
    first, second = small(), small()
    for k in range(0, 200, 20):
        left_out = first.predict(x_d[k : k + 20])
        given_ = second.predict(x_d[k : k + 20], reference=x_d[k : k + 20])
        np.testing.assert_allclose(left_out.x_h, given_.x_h, rtol=0, atol=1e-15)
        for predictor in (first, second):
            predictor.update(x[k : k + 20])


def test_the_features_of_the_paper_know_no_reference() -> None:
    first, second = small(v_friction=0.0), small(v_friction=0.0)
    assert first.n_features == 2 + 3 + 5
    np.testing.assert_array_equal(follow(first, 0, 300), follow(second, 0, 300, with_reference=False))
    np.testing.assert_array_equal(first.weights, second.weights)
    np.testing.assert_array_equal(first.residual_weights, first.weights[5:])


def test_windows_of_fifty_and_of_a_hundred_learn_the_same() -> None:
    """Where both know the whole path: in windows of one batch or two, or measured to the middle only."""
    r, x_d, x = signals()
    whole, halves, part = (small(Np=50) for _ in range(3))
    follow(whole, 0, 400, n=100)
    follow(halves, 0, 400, n=50)
    for k in range(0, 400, 50):
        part.predict(x_d[k : k + 100], reference=r[k:])
        part.update(x[k : k + 50])
    np.testing.assert_array_equal(part.weights, halves.weights)
    np.testing.assert_allclose(whole.weights, halves.weights, rtol=1e-9, atol=1e-9)
    predicted = [one.predict(x_d[400:450], reference=r[400:]).x_h for one in (whole, halves, part)]
    np.testing.assert_allclose(predicted[0], predicted[1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(predicted[1], predicted[2])


@pytest.mark.parametrize("measured", [True, False])
@pytest.mark.parametrize("learned", [0, 30, 310])
def test_saved_in_mid_run_continues_bit_for_bit(learned: int, measured: bool) -> None:
    r, x_d, x = signals()
    original = small()
    if learned:
        follow(original, 0, learned)
    if not measured:
        original.predict(x_d[learned : learned + 20], reference=r[learned : learned + 65])
    twin = HybridPredictor.from_bytes(original.to_bytes())
    assert twin.to_bytes() == original.to_bytes()
    assert twin.settings.v_friction == V_S
    if not measured:
        for predictor in (original, twin):
            predictor.update(x[learned : learned + 13])
        learned += 13
    np.testing.assert_array_equal(follow(twin, learned, 600), follow(original, learned, 600))
    assert twin.to_bytes() == original.to_bytes()


def test_elsewhere_on_the_axis_the_features_are_the_same() -> None:
    r, x_d, x = signals()
    here, there = small(start=0.0), small(start=0.25)
    for k in range(0, 300, 20):
        one = here.predict(x_d[k : k + 20], reference=r[k:])
        other = there.predict(x_d[k : k + 20] + 0.25, reference=r[k:] + 0.25)
        np.testing.assert_allclose(other.x_h - 0.25, one.x_h, rtol=0, atol=1e-10)
        here.update(x[k : k + 20])
        there.update(x[k : k + 20] + 0.25)


@pytest.mark.parametrize(("v_friction", "most"), [(1e-3, 63.0), (V_S, 60.0), (5e-3, 69.0)])
def test_friction_is_predicted_better(v_friction: float, most: float) -> None:
    """The stage's Y axis over the spiral: RMS against the measured position, µm; its own friction has 2 mm/s."""
    assert 97.0 < stage_y_prediction_error(0.0) < 98.5
    assert stage_y_prediction_error(v_friction) < most


@lru_cache(maxsize=4)
def stage_y_prediction_error(v_friction: float) -> float:
    machine = paper_machine("als25010_y")
    r, encoder = spiral()[1], Encoder(1e-6, 0)
    x = encoder.measure_all(simulate(machine.new_plant(), r, TS))
    predictor = machine.new_predictor(replace(machine.predictor_settings, v_friction=v_friction))
    errors = []
    for k in range(0, len(r), 100):
        errors.append(x[k : k + 100] - predictor.predict(r[k : k + 100], reference=r[k : k + 200]).x_h)
        predictor.update(x[k : k + 100])
    return 1e6 * float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda p: p.predict(np.zeros(20), reference=np.zeros(19)), "reference must have at least the 20 samples of "),
        (lambda p: p.predict(np.zeros(2), reference=[0.0, math.nan]), "reference must be finite, got nan at sample 1"),
        (lambda p: p.predict(np.zeros(2), reference=[[0.0, 1.0]]), "reference must be one-dimensional, got shape"),
        (lambda p: p.operator(20, reference=np.zeros(19)), "reference must have 20 samples, got 19"),
        (lambda p: p.operator(2, reference=[0.0, math.inf]), "reference must be finite, got inf at sample 1"),
    ],
)  # fmt: skip
def test_a_reference_that_does_not_fit_is_refused(use: Callable[[HybridPredictor], object], message: str) -> None:
    r, x_d, _ = signals()
    predictor = small()
    follow(predictor, 0, 60)
    predictor.predict(x_d[60:80], reference=r[60:])
    before = predictor.to_bytes()
    with pytest.raises(SignalError) as caught:
        use(predictor)
    assert str(caught.value).startswith(message)
    assert predictor.to_bytes() == before


@pytest.mark.parametrize(
    ("v_friction", "message"),
    [
        (-1e-3, "v_friction must be 0 or 1e-09 … 10000 m/s, got -0.001"),
        (math.nan, "v_friction must be finite, got nan"),
        (math.inf, "v_friction must be finite, got inf"),
    ],
)
def test_a_velocity_out_of_range_is_refused(v_friction: float, message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        small(v_friction=v_friction)
    assert str(caught.value) == message
