"""The physics model against the matrix exponential, an ODE solver, closed forms and python-control."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import control
import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from hybridsep.base.errors import ModelError, ParameterError
from hybridsep.model.discrete import BLOCK_MAX, DiscreteModel
from hybridsep.model.physics import ModalModel, Mode

Array = NDArray[np.float64]

TS = 1e-3
UNDER = Mode(25.0, 0.05, 24674.0, 15.7)
CRITICAL = Mode(20.0, 1.0, 15791.4, 30.0)
OVER = Mode(15.0, 3.0, 8882.6, -4.0)
LIGHT = Mode(80.0, 0.01, -900.0, 0.7)
CASES = {
    "under-damped": ModalModel([UNDER]),
    "critical": ModalModel([CRITICAL]),
    "over-damped": ModalModel([OVER]),
    "three modes": ModalModel([UNDER, OVER, LIGHT]),
}
HOLDS = ("zoh", "foh")


def command(n: int, seed: int = 0) -> Array:
    """Return a rough command that starts away from zero, (n,), m."""
    rng = np.random.default_rng(seed)
    return np.asarray(0.01 * np.cumsum(rng.normal(size=n)) / np.sqrt(n) + 0.003, dtype=np.float64)


def transfer_function(model: ModalModel) -> tuple[Array, Array]:
    return oracle.transfer_function([(mode.f_n, mode.zeta, mode.alpha, mode.beta) for mode in model.modes])


def by_exponential(model: ModalModel, x_d: Array, hold: str) -> Array:
    """Answer from rest by one matrix exponential a sample of states, command and the command's slope together."""
    A, b, c = model.state_space()
    n = len(b)
    augmented = np.zeros((n + 2, n + 2))
    augmented[:n, :n], augmented[:n, n], augmented[n, n + 1] = A, b, 1.0
    step = expm(augmented * TS)
    # A first-order hold comes from 0 one sample earlier, a zero-order hold begins at the first sample.
    before = np.concatenate(([0.0], x_d[:-1]))
    s, x_pb = np.zeros(n), []
    for k in range(len(x_d)):
        if hold == "foh":
            s = (step @ np.concatenate((s, [before[k], (x_d[k] - before[k]) / TS])))[:n]
            x_pb.append(c @ s)
        else:
            x_pb.append(c @ s)
            s = (step @ np.concatenate((s, [x_d[k], 0.0])))[:n]
    return np.array(x_pb)


def by_solver(model: ModalModel, x_d: Array, hold: str) -> Array:
    """Answer from rest by a tight Runge-Kutta solver on each mode's own differential equation."""
    modes = model.modes
    before = np.concatenate(([0.0], x_d[:-1]))
    state = np.zeros(2 * len(modes))
    x_pb = []

    def position(s: Array) -> float:
        # (α + β s) z with z̈ + 2ζω ż + ω² z = x_d
        return math.fsum(mode.alpha * s[2 * i] + mode.beta * s[2 * i + 1] for i, mode in enumerate(modes))

    def advance(s: Array, u: Callable[[float], float]) -> Array:
        def slope(t: float, y: Array) -> list[float]:
            out: list[float] = []
            for i, mode in enumerate(modes):
                z, v = y[2 * i], y[2 * i + 1]
                out += [v, u(t) - 2 * mode.zeta * mode.omega * v - mode.omega**2 * z]
            return out

        solved = solve_ivp(slope, (0.0, TS), s, method="DOP853", rtol=1e-13, atol=1e-20)
        return np.asarray(solved.y[:, -1], dtype=np.float64)

    for k in range(len(x_d)):
        here, there = float(before[k]), float(x_d[k])
        if hold == "foh":
            state = advance(state, lambda t, a=here, b=there: a + (b - a) * t / TS)  # type: ignore[misc]
            x_pb.append(position(state))
        else:
            x_pb.append(position(state))
            state = advance(state, lambda t, b=there: b + 0 * t)  # type: ignore[misc]
    return np.array(x_pb)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("model", CASES.values(), ids=CASES.keys())
class TestDiscretisation:
    def test_is_the_matrix_exponential(self, model: ModalModel, hold: str) -> None:
        x_d = command(400)
        discrete = model.discretise(TS, hold)
        x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
        np.testing.assert_allclose(x_pb, by_exponential(model, x_d, hold), rtol=0, atol=1e-15)

    def test_is_the_differential_equation(self, model: ModalModel, hold: str) -> None:
        x_d = command(60, seed=1)
        discrete = model.discretise(TS, hold)
        x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
        np.testing.assert_allclose(x_pb, by_solver(model, x_d, hold), rtol=0, atol=1e-14)

    def test_is_the_oracle(self, model: ModalModel, hold: str) -> None:
        x_d = command(300, seed=2)
        behind = ModalModel(model.modes, dead_time=7)
        discrete = behind.discretise(TS, hold)
        x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
        expected = oracle.physics(*transfer_function(model), x_d.tolist(), T_s=TS, hold=hold, dead_time=7)
        np.testing.assert_allclose(x_pb, expected, rtol=0, atol=1e-14)

    def test_settles_at_the_dc_gain(self, model: ModalModel, hold: str) -> None:
        discrete = model.discretise(TS, hold)
        x_pb, _ = discrete.forced_response(discrete.rest(), np.full(6000, 0.02))
        assert x_pb[-1] == pytest.approx(0.02 * model.dc_gain, rel=1e-9)

    def test_does_not_change_what_it_is_given(self, model: ModalModel, hold: str) -> None:
        discrete = model.discretise(TS, hold)
        _, state = discrete.forced_response(discrete.rest(), command(10))
        x_d = command(300)
        kept = state.copy(), x_d.copy()
        discrete.forced_response(state, x_d)
        np.testing.assert_array_equal(state, kept[0])
        np.testing.assert_array_equal(x_d, kept[1])


@settings(max_examples=60)
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
    state, pieces = discrete.rest(), []
    for piece in np.split(x_d, np.cumsum(lengths)[:-1]):
        x_pb, state = discrete.forced_response(state, piece)
        pieces.append(x_pb)
    np.testing.assert_allclose(np.concatenate(pieces), whole, rtol=0, atol=1e-16)
    np.testing.assert_allclose(state, end, rtol=0, atol=1e-16)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("dead_time", [1, 4, 300])
def test_dead_time_is_a_shift(dead_time: int, hold: str) -> None:
    x_d = command(700)
    plain = ModalModel([UNDER]).discretise(TS, hold)
    late = ModalModel([UNDER], dead_time).discretise(TS, hold)
    x_pb, _ = plain.forced_response(plain.rest(), x_d)
    x_late, state = late.forced_response(late.rest(), x_d)
    assert len(state) == late.n_state == plain.n_state + dead_time
    np.testing.assert_array_equal(x_late[:dead_time], 0.0)
    np.testing.assert_allclose(x_late[dead_time:], x_pb[:-dead_time], rtol=0, atol=1e-16)


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


def test_first_order_hold_is_exact_on_a_ramp() -> None:
    # A ramp of slope v from rest: x_pb → v (t − c/k) + v β/ω² with β/ω² = c/k, so the drive follows it exactly.
    discrete = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0).discretise(TS, "foh")
    ramp = 0.05 * TS * np.arange(3000)
    x_pb, _ = discrete.forced_response(discrete.rest(), np.asarray(ramp, dtype=np.float64))
    np.testing.assert_allclose(x_pb[2500:], ramp[2500:], rtol=0, atol=1e-11)


def test_spring_mass_damper_is_eq_11() -> None:
    m, c, k = 2.0, 15.7, 24674.0
    model = ModalModel.spring_mass_damper(m, c, k)
    f = np.array([0.0, 1.0, 20.0, 25.0, 300.0])
    s = 2j * np.pi * f
    np.testing.assert_allclose(model.frequency_response(f), (c * s + k) / (m * s**2 + c * s + k), rtol=1e-13)
    assert model.dc_gain == pytest.approx(1.0, rel=1e-14)
    (mode,) = model.modes
    assert mode.omega**2 == pytest.approx(k / m, rel=1e-14)
    assert 2 * mode.zeta * mode.omega == pytest.approx(c / m, rel=1e-14)
    assert (mode.alpha, mode.beta) == (k / m, c / m)


@pytest.mark.parametrize("model", CASES.values(), ids=CASES.keys())
def test_frequency_response_is_that_of_python_control(model: ModalModel) -> None:
    f = np.geomspace(0.1, 400.0, 60)
    expected = np.asarray(control.tf(*transfer_function(model))(2j * np.pi * f))
    np.testing.assert_allclose(model.frequency_response(f), expected, rtol=1e-11)
    np.testing.assert_allclose(np.asarray(model.to_control()(2j * np.pi * f)), expected, rtol=1e-11)


def test_frequency_response_keeps_its_shape_and_delays() -> None:
    f = np.array([[1.0, 10.0], [20.0, 200.0]])
    plain = ModalModel([UNDER]).frequency_response(f)
    late = ModalModel([UNDER], 4).frequency_response(f, TS)
    np.testing.assert_allclose(late, plain * np.exp(-2j * np.pi * f * 4 * TS), rtol=1e-13)
    with pytest.raises(ParameterError, match=r"^T_s is needed: dead_time = 4 is counted in samples$"):
        ModalModel([UNDER], 4).frequency_response(f)


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
    system = ModalModel(model.modes).to_control()
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
    f = np.geomspace(0.05, 200.0, 40)
    np.testing.assert_allclose(model.frequency_response(f), np.asarray(system(2j * np.pi * f)), rtol=1e-6)


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("dead_time", [0, 1, 6])
def test_discrete_python_control_system_answers_the_same(dead_time: int, hold: str) -> None:
    model = ModalModel([UNDER, OVER], dead_time)
    system = model.to_control(TS, hold)
    assert system.dt == TS
    x_d = command(300)
    discrete = model.discretise(TS, hold)
    x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
    answer = control.forced_response(system, np.arange(300) * TS, x_d)
    np.testing.assert_allclose(answer.outputs, x_pb, rtol=0, atol=1e-14)


UNSTABLE = control.tf([1.0], [1.0, -1.0, 3.0])
REFUSED: list[tuple[Any, str]] = [
    (UNSTABLE, "G_pb must be stable, got a pole at 0.5"),
    (control.tf([1.0], [1.0, 0.0]), "G_pb must be stable, got a pole at 0"),
    (control.tf([1.0], [1.0, 0.0, 9.0]), "G_pb must be stable, got a pole at"),
    (control.tf([2.0], [1.0]), "numerator of degree 0 over a denominator of degree 0"),
    (control.tf([1.0, 0.0, 0.0], [1.0, 1.0, 3.0]), "numerator of degree 2 over a denominator of degree 2"),
    (control.tf([1.0, 0, 0, 0], [1.0, 1.0, 3.0]), "numerator of degree 3 over a denominator of degree 2"),
    (control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.5]]), "G_pb must be strictly proper"),
    (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "one input and one output, got 2 and 2"),
    (control.tf([1.0], [1.0, 0.5], TS), "G_pb must be continuous, got a discrete system"),
    (control.tf([1.0], [1.0, 0.5], True), "G_pb must be continuous, got a discrete system"),
    (control.tf([1.0], np.polymul([1.0, 1.0, 3.0], [1.0, 1.0, 3.0])), "G_pb has repeated modes"),
    *((control.tf([1.0], np.poly([-3.0] * n)), "G_pb has repeated modes") for n in (3, 4, 5, 6, 8)),
    *((control.tf([1.0], np.real(np.poly([-1 + 5j, -1 - 5j] * n))), "G_pb has repeated modes") for n in (3, 4, 6, 8)),
    (control.tf([0.0], [1.0, 1.0]), "a transfer function of zero"),
    (control.tf([math.nan], [1.0, 1.0]), "must have finite coefficients"),
    (control.tf([1.0], [1.0, math.inf, 1.0]), "must have finite coefficients"),
    (control.ss([[math.nan]], [[1.0]], [[1.0]], [[0.0]]), "must have finite coefficients"),
    (control.frd([1.0, 2.0], [1.0, 2.0]), "must be a TransferFunction or StateSpace, got FrequencyResponseData"),
]


@pytest.mark.parametrize(("system", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_systems_that_are_no_sum_of_modes(system: Any, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        ModalModel.from_control(system)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((25.0, 0.0, 1.0, 0.0), "zeta must be 1e-06 … 10000, got 0.0"),
        ((25.0, -0.1, 1.0, 0.0), "zeta must be 1e-06 … 10000, got -0.1"),
        ((0.0, 0.1, 1.0, 0.0), "f_n must be 0.001 … 100000 Hz, got 0.0"),
        ((25.0, 0.1, math.nan, 0.0), "alpha must be finite, got nan"),
        ((25.0, 0.1, 1.0, math.inf), "beta must be finite, got inf"),
    ],
)
def test_modes_out_of_range(values: tuple[float, float, float, float], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Mode(*values)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ModalModel([]), "a modal model needs at least one mode, got none"),
        (lambda: ModalModel([UNDER], -1), "dead_time must be 0 … 100000, got -1"),
        (lambda: ModalModel([UNDER], 0.5), "dead_time must be a whole number, got 0.5"),  # type: ignore[arg-type]
        (lambda: ModalModel.spring_mass_damper(0.0, 1.0, 1.0), "m must be 1e-06 … 1000000 kg, got 0.0"),
        (lambda: ModalModel.spring_mass_damper(1.0, 0.0, 1.0), "c must be 1e-09 … 1e+12 N.s/m, got 0.0"),
        (lambda: ModalModel.spring_mass_damper(1.0, 1.0, -1.0), "k must be 1e-06 … 1e+15 N/m, got -1.0"),
        (lambda: ModalModel([UNDER]).discretise(0.0), "T_s must be 1e-05 … 1 s, got 0.0"),
        (lambda: DiscreteModel(ModalModel([UNDER]).state_space(), 0, -1.0), "T_s must be 1e-05 … 1 s, got -1.0"),
        (lambda: ModalModel([UNDER]).discretise(TS, "soh"), "input_hold must be one of zoh, foh, got 'soh'"),
    ],
)
def test_models_out_of_range(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        make()
    assert str(caught.value) == message


def test_a_dead_time_has_no_continuous_form() -> None:
    with pytest.raises(ModelError, match=r"^a dead time of 3 samples has no continuous rational form; give T_s for"):
        ModalModel([UNDER], 3).to_control()
