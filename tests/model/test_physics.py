"""Discretisation of the modal model against the exponential and a differential-equation solver."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from modal_cases import CASES, HOLDS, LIGHT, OVER, TS, UNDER, Array, command, transfer_function
from properties import examples
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from hybridsep.model.discrete import BLOCK_MAX
from hybridsep.model.physics import ModalModel


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
