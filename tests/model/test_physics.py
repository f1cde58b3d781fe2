"""Discretisation of the modal model against the exponential and a differential-equation solver."""

import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from modal_cases import CASES, HOLDS, LIGHT, OVER, TS, UNDER, command, transfer_function
from properties import examples
from scipy.linalg import expm

from hybridsep.base.signals import Array
from hybridsep.model.discrete import BLOCK_MAX
from hybridsep.model.physics import ModalModel, Mode


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


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("model", CASES.values(), ids=CASES.keys())
def test_a_discrete_model_is_the_matrix_exponential_and_the_oracle(model: ModalModel, hold: str) -> None:
    x_d = command(400)
    kept = x_d.copy()
    discrete = model.discretise(TS, hold)
    x_pb, _ = discrete.forced_response(discrete.rest(), x_d)
    np.testing.assert_allclose(x_pb, by_exponential(model, x_d, hold), rtol=0, atol=1e-15)
    behind = ModalModel(model.modes, dead_time=7).discretise(TS, hold)
    rest = behind.rest()
    late, _ = behind.forced_response(rest, x_d)
    expected = oracle.physics(*transfer_function(model), x_d.tolist(), T_s=TS, hold=hold, dead_time=7)
    np.testing.assert_allclose(late, expected, rtol=0, atol=1e-14)
    assert len(rest) == behind.n_state == discrete.n_state + 7
    np.testing.assert_array_equal(rest, behind.rest())
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
    assert ModalModel((fast,)).look_ahead(TS) == 200
    assert ModalModel((fast, trace)).look_ahead(TS) == 200
    assert ModalModel((fast, slow)).look_ahead(TS) == 750
    late = ModalModel((fast,), dead_time=100).look_ahead(TS)
    assert 3 * (100 + 10) < late < 3 * (100 + 30)
