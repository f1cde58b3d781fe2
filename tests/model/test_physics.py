"""Modal models: eq. (11), frequency response, conversion from and to python-control, ranges; their discretisation."""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.base.errors import ModelError, ParameterError
from hybridsep.base.signals import Array
from hybridsep.model.discrete import BLOCK_MAX, DiscreteModel
from hybridsep.model.physics import ModalModel, Mode

TS = 1e-3
UNDER = Mode(25.0, 0.05, 24674.0, 15.7)
CRITICAL = Mode(20.0, 1.0, 15791.4, 30.0)
OVER = Mode(15.0, 3.0, 8882.6, -4.0)
LIGHT = Mode(80.0, 0.01, -900.0, 0.7)
CASES = {
    "under-damped": ModalModel([UNDER]),
    "critical": ModalModel([CRITICAL]),
    "over-damped": ModalModel([OVER]),
    "three modes": ModalModel(iter([UNDER, OVER, LIGHT])),
}
HOLDS = ("zoh", "foh")


def transfer_function(model: ModalModel) -> tuple[Array, Array]:
    return oracle.transfer_function([(mode.f_n, mode.zeta, mode.alpha, mode.beta) for mode in model.modes])


def test_spring_mass_damper_is_eq_11() -> None:
    m, c, k = 2.0, 15.7, 24674.0
    model = ModalModel.spring_mass_damper(m, c, k)
    omega = 2 * np.pi * np.array([0.0, 1.0, 20.0, 25.0, 300.0])
    s = 1j * omega
    of_pandas: Any = SimpleNamespace(index=omega, to_numpy=lambda: omega)
    np.testing.assert_allclose(model.frequency_response(of_pandas), (c * s + k) / (m * s**2 + c * s + k), rtol=1e-13)
    assert model.dc_gain == pytest.approx(1.0, rel=1e-14)
    (mode,) = model.modes
    assert mode.omega**2 == pytest.approx(k / m, rel=1e-14)
    assert 2 * mode.zeta * mode.omega == pytest.approx(c / m, rel=1e-14)
    assert (mode.alpha, mode.beta) == (k / m, c / m)


@pytest.mark.parametrize("model", CASES.values(), ids=CASES.keys())
def test_frequency_response_is_that_of_python_control(model: ModalModel) -> None:
    omega = 2 * np.pi * np.geomspace(0.1, 400.0, 60)
    expected = np.asarray(control.tf(*transfer_function(model)).frequency_response(omega, squeeze=True).complex)
    np.testing.assert_allclose(model.frequency_response(omega), expected, rtol=1e-11)


def test_frequency_response_keeps_its_shape_and_delays() -> None:
    omega = 2 * np.pi * np.array([[1.0, 10.0], [20.0, 200.0]])
    plain = ModalModel([UNDER]).frequency_response(omega)
    late = ModalModel([UNDER], 4).frequency_response(omega, TS)
    np.testing.assert_allclose(late, plain * np.exp(-1j * omega * 4 * TS), rtol=1e-13)
    with pytest.raises(ParameterError, match=r"^T_s is needed: dead_time = 4 is counted in samples$"):
        ModalModel([UNDER], 4).frequency_response(omega)


def assert_same_modes(actual: ModalModel, expected: ModalModel, rtol: float) -> None:
    def key(mode: Mode) -> tuple[float, float]:
        return mode.f_n, mode.zeta

    assert len(actual.modes) == len(expected.modes)
    for here, there in zip(sorted(actual.modes, key=key), sorted(expected.modes, key=key), strict=True):
        assert (here.f_n, here.zeta) == pytest.approx((there.f_n, there.zeta), rel=rtol)
        # The numerator counts by its size at the natural frequency.
        size = abs(complex(there.alpha, there.beta * there.omega))
        assert here.alpha == pytest.approx(there.alpha, rel=0, abs=rtol * size)
        assert here.beta * here.omega == pytest.approx(there.beta * there.omega, rel=0, abs=rtol * size)


@pytest.mark.parametrize(
    ("model", "rtol"),
    [
        (ModalModel([UNDER]), 1e-12),
        (ModalModel([OVER]), 1e-12),
        (ModalModel([CRITICAL]), 1e-9),
        (ModalModel([UNDER, OVER, LIGHT]), 1e-9),
        (ModalModel([Mode(f, 0.02, f, 0.0) for f in (20.0, 20.2, 20.4, 50.0, 51.0, 300.0)]), 1e-7),
        (ModalModel([Mode(f, 0.02, 10.0 * f, 0.1) for f in (3.0, 30.0, 33.0, 400.0)], dead_time=2), 1e-9),
    ],
)
@pytest.mark.parametrize("kind", ["state space", "transfer function"])
def test_round_trip_through_python_control(model: ModalModel, rtol: float, kind: str) -> None:
    A, b, c = model.state_space()
    system = control.ss(A, b[:, None], c[None, :], [[0.0]])
    back = ModalModel.from_control(system if kind == "state space" else control.tf(system), model.dead_time)
    assert back.dead_time == model.dead_time
    assert_same_modes(back, model, rtol)


@pytest.mark.parametrize(
    ("zeros", "poles"),
    [
        ([], [-30.0]),
        ([-5.0], [-200.0, -40.0, -3.0]),
        ([], [-60.0, -40.0, -40.0]),
        ([], [-60.0, -60.0, -40.0]),
        ([-7.0], [-90.0, -50.0, -50.0, -10.0]),
        ([20.0], [-70.0, -10 + 150j, -10 - 150j]),
        ([-100.0, -80.0], [-300.0, -200.0, -90.0, -20 + 100j, -20 - 100j]),
    ],
)
def test_real_poles_in_any_number(zeros: list[float], poles: list[complex]) -> None:
    system = control.tf(1e3 * np.real(np.poly(zeros)), np.real(np.poly(poles)))
    model = ModalModel.from_control(system)
    assert len(model.modes) == (len(poles) + 1) // 2
    omega = 2 * np.pi * np.geomspace(0.05, 200.0, 40)
    np.testing.assert_allclose(model.frequency_response(omega), np.asarray(system(1j * omega)), rtol=1e-6)


REFUSED: list[tuple[Any, str]] = [
    (control.tf([1.0], [1.0, -1.0, 3.0]), "G_pb must be stable, got a pole at 0.5"),
    (control.tf([1.0], [1.0, 0.0]), "G_pb must be stable, got a pole at 0"),
    (control.tf([2.0], [1.0]), "numerator of degree 0 over a denominator of degree 0"),
    (control.tf([1.0, 0.0, 0.0], [1.0, 1.0, 3.0]), "numerator of degree 2 over a denominator of degree 2"),
    (control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.5]]), "G_pb must be strictly proper"),
    (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "one input and one output, got 2 and 2"),
    (control.tf([1.0], [1.0, 0.5], TS), "G_pb must be continuous, got a discrete system"),
    (control.tf([1.0], np.polymul([1.0, 1.0, 3.0], [1.0, 1.0, 3.0])), "G_pb has repeated modes"),
    *((control.tf([1.0], np.poly([-3.0] * n)), "G_pb has repeated modes") for n in (3, 8)),
    *((control.tf([1.0], np.real(np.poly([-1 + 5j, -1 - 5j] * n))), "G_pb has repeated modes") for n in (3, 8)),
    (control.tf([0.0], [1.0, 1.0]), "G_pb must not be zero, got a zero transfer function"),
    (control.tf([math.nan], [1.0, 1.0]), "must have finite coefficients"),
    (control.ss([[math.nan]], [[1.0]], [[1.0]], [[0.0]]), "must have finite coefficients"),
    (control.frd([1.0, 2.0], [1.0, 2.0]), "must be a TransferFunction or StateSpace, got FrequencyResponseData"),
]


@pytest.mark.parametrize(("system", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_systems_that_are_no_sum_of_modes(system: Any, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        ModalModel.from_control(system)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ModalModel([]), "a modal model needs at least one mode, got none"),
        (lambda: ModalModel([UNDER], -1), "dead_time must be 0 … 100000, got -1"),
        (lambda: Mode(25.0, -0.1, 1.0, 0.0), "zeta must be 1e-06 … 10000, got -0.1"),
        (lambda: ModalModel.spring_mass_damper(1.0, 1.0, -1.0), "k must be 1e-06 … 1e+15 N/m, got -1.0"),
        (
            lambda: ModalModel.spring_mass_damper(1.0, 1.0, 1e-6),
            "m = 1 kg, c = 1 N.s/m, k = 1e-06 N/m give a mode out of range: f_n must be 0.001 … 100000 Hz, "
            "got 0.00015915494309189535",
        ),
        (lambda: ModalModel([UNDER]).discretise(0.0), "T_s must be 1e-05 … 1 s, got 0.0"),
        (lambda: DiscreteModel(ModalModel([UNDER]).state_space(), 0, -1.0), "T_s must be 1e-05 … 1 s, got -1.0"),
        (lambda: ModalModel([UNDER]).discretise(TS, "soh"), "input_hold must be one of zoh, foh, got 'soh'"),
    ],
)
def test_models_out_of_range(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        make()
    assert str(caught.value) == message


# Discretised ---------------------------------------------------------------------------------------------------------


def command(n: int, seed: int = 0) -> Array:
    """Return a rough command that starts away from zero, (n,), m."""
    rng = np.random.default_rng(seed)
    return np.asarray(0.01 * np.cumsum(rng.normal(size=n)) / np.sqrt(n) + 0.003, dtype=np.float64)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("model", CASES.values(), ids=CASES.keys())
def test_a_discrete_model_is_the_oracle(model: ModalModel, hold: str) -> None:
    x_d = command(400)
    kept = x_d.copy()
    for dead_time in (0, 7):
        discrete = ModalModel(model.modes, dead_time).discretise(TS, hold)
        x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
        expected = oracle.physics(*transfer_function(model), x_d.tolist(), T_s=TS, hold=hold, dead_time=dead_time)
        np.testing.assert_allclose(x_pb, expected, rtol=0, atol=1e-14)
        assert len(discrete.rest()) == discrete.n_state == 2 * len(model.modes) + dead_time
    np.testing.assert_array_equal(x_d, kept)


@examples(60)
@given(
    lengths=st.lists(st.integers(1, 2 * BLOCK_MAX + 3), min_size=1, max_size=6),
    dead_time=st.sampled_from([0, 1, 5, 300]),
    hold=st.sampled_from(HOLDS),
    block=st.integers(1, 2 * BLOCK_MAX),
)
def test_pieces_equal_one_piece(lengths: list[int], dead_time: int, hold: str, block: int) -> None:
    model = ModalModel([UNDER, OVER], dead_time)
    discrete = model.discretise(TS, hold, block=block)
    x_d = command(sum(lengths))
    whole, end = model.discretise(TS, hold).forced_response(discrete.rest(), x_d)
    np.testing.assert_allclose([*map(discrete.stepper(), x_d.tolist())], whole, rtol=0, atol=1e-16)
    state, pieces = discrete.rest(), []
    for piece in np.split(x_d, np.cumsum(lengths)[:-1]):
        x_pb, state = discrete.forced_response(state, piece)
        pieces.append(x_pb)
    np.testing.assert_allclose(np.concatenate(pieces), whole, rtol=0, atol=1e-16)
    np.testing.assert_allclose(state, end, rtol=0, atol=1e-16)


@pytest.mark.parametrize("hold", HOLDS)
def test_impulse_response_is_the_first_column(hold: str) -> None:
    discrete = ModalModel([UNDER, LIGHT], 3).discretise(TS, hold)
    n = 40
    G = np.column_stack([discrete.forced_response(discrete.rest(), np.eye(n)[j])[0] for j in range(n)])
    g = discrete.impulse_response(n)
    np.testing.assert_array_equal(g, G[:, 0])
    for j in range(n):
        np.testing.assert_allclose(G[j:, j], g[: n - j], rtol=0, atol=1e-16)
        np.testing.assert_array_equal(G[:j, j], 0.0)
    assert np.flatnonzero(g)[0] == (3 if hold == "foh" else 4)


def test_a_look_ahead_counts_the_modes_that_matter() -> None:
    """Periods of the lowest mode, time to 95 % with dead time, a floor; a mode of a thousandth counts for nothing."""
    fast, slow = Mode(25.0, 0.5, (2 * np.pi * 25.0) ** 2, 0.0), Mode(2.0, 0.05, 0.1 * (2 * np.pi * 2.0) ** 2, 0.0)
    trace = Mode(1.33, 1.0, 0.001 * (2 * np.pi * 1.33) ** 2, 0.0)
    assert ModalModel((fast,)).needed_preview(TS) == 200
    assert ModalModel((fast, trace)).needed_preview(TS) == 200
    assert ModalModel((fast, slow)).needed_preview(TS) == 750
    omega = 2 * np.pi * 1.45
    assert (
        ModalModel((fast, Mode(1.45, 1.0, 0.034 * omega**2, 0.034 * omega))).needed_preview(TS) == 200
    )  # it only creeps
    late = ModalModel((fast,), dead_time=100).needed_preview(TS)
    assert 3 * (100 + 10) < late < 3 * (100 + 30)
