"""Features without lags against the disturbances' formulas, filtered over the whole signal at once."""

from itertools import pairwise

import numpy as np
import oracle
import pytest

from hybridsep.base.signals import Array
from hybridsep.base.state import numbers_of
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.averaging.constants import CONSTANTS
from hybridsep.predict.averaging.features import N_FRICTION, N_LASTING, N_STOPS, StaticFeatures
from hybridsep.predict.window import ResidualWindow

TS, N = 1e-3, 800
MODES = [(25.0, 0.05, 24674.0, 15.7), (90.0, 0.6, -400.0, 3.0)]
SCALE = 0.05  # m/s
SPREAD = CONSTANTS.friction_least * CONSTANTS.friction_ratio ** np.arange(N_FRICTION)
DISTANCES = SCALE * CONSTANTS.stop_least * CONSTANTS.stop_ratio ** np.arange(N_STOPS)  # m
PERIOD, ORIGIN = 1.7e-3, 0.0123  # m


def features(hold: str, dead_time: int, q: int, period: float = 0.0) -> StaticFeatures:
    model = ModalModel([Mode(*one) for one in MODES], dead_time)
    return StaticFeatures(model.discretise(TS, hold, block=100), q, period)


def signals() -> tuple[Array, Array]:
    """Return a command that starts, turns and rests, and a position near it, (N,), m."""
    t = np.arange(N) * TS
    x_d = np.where(t < 0.6, 0.004 * np.sin(12 * t) ** 3, 0.004 * np.sin(7.2) ** 3)
    return x_d, 0.98 * x_d + 2e-5 * np.sin(80 * t)


def stop(x_d: Array, distance: float) -> Array:
    """Return a stop operator by what it is: the command less the middle of a play that it drags along."""
    found, middle = [], 0.0
    for command in x_d.tolist():
        middle = min(max(middle, command - distance), command + distance)
        found.append((command - middle) / distance)
    return np.array(found)


def formula(x_d: Array, x_pb: Array, x: Array, hold: str, dead_time: int, period: float = 0.0) -> tuple[Array, Array]:
    """Return the filtered disturbances and their first differences, (N, n) each."""
    modes = oracle.transfer_function(MODES)
    v_d, v_pb = np.diff(x_d, prepend=0.0) / TS, np.diff(x_pb, prepend=0.0) / TS
    disturbances = [*(np.tanh(v_d / (SCALE * one)) for one in SPREAD), *(stop(x_d, one) for one in DISTANCES)]
    disturbances += [x * abs(x), v_pb * abs(v_pb)]
    if period:
        angle, at_start = 2 * np.pi * (ORIGIN + x) / period, 2 * np.pi * ORIGIN / period
        disturbances += [np.sin(angle) - np.sin(at_start), np.cos(angle) - np.cos(at_start)]
    answers = [oracle.physics(*modes, one.tolist(), T_s=TS, hold=hold, dead_time=dead_time) for one in disturbances]
    return np.array(answers).T, np.diff(answers, prepend=0.0).T


@pytest.mark.parametrize("period", [0.0, PERIOD])
@pytest.mark.parametrize(("hold", "dead_time", "q"), [("zoh", 0, 3), ("foh", 0, 0), ("zoh", 5, 1), ("foh", 3, 40)])
def test_each_column_in_windows_of_any_length(hold: str, dead_time: int, q: int, period: float) -> None:
    static, count = features(hold, dead_time, q, period), N_LASTING + (2 if period else 0)
    x_d, x = signals()
    x_pb, _ = static.discrete.forced_response(static.discrete.rest(), x_d)
    state, rows, first = static.rest(), [], 0
    for n in (100, 1, 7, 2, 300, 3, 387):
        window = slice(first, first + n)
        before = numbers_of(state)
        of_residual = ResidualWindow(x_d[window], x_pb[window], ORIGIN, x_d[window])
        more, after, *_ = static.rows(state, of_residual, x[window], SCALE)
        np.testing.assert_array_equal(numbers_of(state), before)  # the state is not changed
        rows.append(more)
        state, first = after, first + n
    assert first == N
    found = np.concatenate(rows)
    differences, column = min(q, 3), 1
    assert found.shape == (N, static.n) == (N, static.n_linear + 2 * count)
    np.testing.assert_array_equal(found[:, 0], 1.0)
    padded = np.concatenate((np.zeros(3), x_pb))  # at rest before
    for order in range(differences + 1):
        np.testing.assert_allclose(found[:, column], np.diff(padded, order)[3 - order :], rtol=0, atol=1e-15)
        column += 1
    ahead = 40 - static.command.dead_time
    acted = np.concatenate((np.zeros(40), x_d))  # at rest before
    for begin, end in pairwise((0, 3, 9, 27)):
        change = acted[ahead - begin :][:N] - acted[ahead - end :][:N]
        np.testing.assert_array_equal(found[:, column], change)
        column += 1
    filtered, differenced = formula(x_d, x_pb, x, hold, dead_time, period)
    size = np.abs(filtered).max(axis=0)
    assert (size > 0.0).all()
    np.testing.assert_allclose(found[:, column : column + count] / size, filtered / size, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:, column + count :] / size, differenced / size, rtol=0, atol=1e-9)


def test_peak_velocity_is_of_what_the_numbers_resolve() -> None:
    static, ulp = features("zoh", 0, 3), np.spacing(0.17)
    assert static.peak_velocity(np.array([0.0, 2e-6, 1e-6]), 0.17) == pytest.approx(2e-3)
    assert static.peak_velocity(np.array([0.0, 10.0 * ulp, 0.0]), 0.17) == 0.0
    assert static.peak_velocity(np.array([0.0, 10.0 * ulp, 0.0]), 0.0) > 0.0


def test_at_rest_only_the_constant_is_left() -> None:
    static = features("foh", 2, 3)
    still = np.zeros(50)
    rows, *_ = static.rows(static.rest(), ResidualWindow(still, still, ORIGIN, still), still, 0.0)
    np.testing.assert_array_equal(rows[:, 0], 1.0)
    np.testing.assert_array_equal(rows[:, 1:], 0.0)
