"""Following-error monitor, on every implementation: what trips it, how the change fades, and the reset."""

import math
from functools import cache

import numpy as np
import pytest
from driving import SHORT, T_S, initialise, position, set_inputs
from library_stream import LookAheadStream
from stream import COMPENSATOR, OUTPUTS, Array, Stream
from streams import StreamMaker, on_adapters, on_all

LIMITS = {"v_max": 0.5, "a_max": 30.0, "j_max": 3000.0}

ALLOWED, BEYOND = 0.02, 0.05
"""``following_error_max``, m, which the motion does not reach; and where a measurement is beside it."""

OVER, MISSING = {140, 141, 171, 173, 174, 310, 311, 312}, {172}
RESET = {260: True, 330: False, 340: True}
N_RUN = 440


def tripping_run(stream: Stream, first: int = 0, last: int = N_RUN, *, averaging: bool = True) -> Array:
    """Step through a motion that is measured beside the command now and then; windows begin at multiples of 20."""
    outputs = []
    for k in range(first, last):
        set_inputs(stream, k * T_S)
        if k in OVER:
            stream.set("x_meas", position(k * T_S) + BEYOND)
        elif k in MISSING and averaging:
            stream.set("x_meas", math.nan)
        if k in RESET:
            stream.set("reset", RESET[k])
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
    return np.array(outputs)


@cache
def of_the_library() -> Array:
    library = LookAheadStream(COMPENSATOR)
    initialise(library, following_error_max=ALLOWED, **LIMITS)
    return tripping_run(library)


def column(outputs: Array, name: str) -> Array:
    return outputs[:, OUTPUTS[COMPENSATOR].index(name)]


@on_adapters((COMPENSATOR,))
def test_a_trip_fades_and_ends_with_a_rising_reset(new_stream: StreamMaker) -> None:
    stream = new_stream()
    initialise(stream, following_error_max=ALLOWED, **LIMITS)
    outputs, expected = tripping_run(stream), of_the_library()
    x_dm, x_d, state, alarm = (column(outputs, name) for name in ("x_dm", "x_d", "sep_state", "alarm"))
    np.testing.assert_allclose(x_dm, column(expected, "x_dm"), rtol=0, atol=1e-9)
    assert state.tolist() == column(expected, "sep_state").tolist()
    # Row i is written after sample i. Two samples are none, a missing one among three is passed over.
    assert np.flatnonzero(alarm).tolist() == [*range(174, 260), *range(312, 340)]
    assert ((state == 3.0) == (alarm == 1.0)).all()
    assert set(state[260:279]) == {0.0}
    assert set(state[280:312]) > {0.0}
    # off in the window that begins at 180, gone a preview later; on again from 280 on
    delta = np.abs(x_dm - x_d)
    assert np.max(delta[160:179]) > 2e-5
    assert np.max(delta[179 + 60 : 279]) < 1e-15
    assert np.max(delta[290:312]) > 2e-5
    for order, (name, bound) in enumerate(LIMITS.items(), start=1):
        largest = np.max(np.abs(np.diff(x_dm[100:], order))) / T_S**order
        assert largest <= bound * (1 + 1e-6), name


@on_adapters((COMPENSATOR,))
def test_what_is_measured_above_the_limit_and_until_the_reset_is_not_learned(new_stream: StreamMaker) -> None:
    seen = []
    for beside in (BEYOND, -10 * BEYOND):
        stream = new_stream()
        initialise(stream, following_error_max=ALLOWED, **LIMITS)
        outputs = []
        for k in range(N_RUN):
            set_inputs(stream, k * T_S)
            if 200 <= k < 290:
                stream.set("x_meas", position(k * T_S) + beside)
            stream.set("reset", k == 300)
            stream.step(k * T_S, T_S)
            outputs.append(stream.outputs())
        seen.append(np.array(outputs))
        stream.close()
    for name in ("x_dm", "x_h", "x_h_std", "sep_state", "alarm"):
        np.testing.assert_array_equal(column(seen[0], name), column(seen[1], name))
    assert column(seen[0], "alarm").nonzero()[0].tolist() == [*range(202, 300)]
    assert column(seen[0], "sep_state")[300:].any()


@on_all((COMPENSATOR,))
def test_the_papers_model_trips_alike(new_stream: StreamMaker) -> None:
    stream = new_stream()
    initialise(stream, averaging=False, following_error_max=ALLOWED, **LIMITS)
    outputs = tripping_run(stream, 0, 279, averaging=False)
    assert np.flatnonzero(column(outputs, "alarm")).tolist() == []  # 172 is measured
    stream.reset()
    initialise(stream, averaging=False, following_error_max=1e-3, **LIMITS)
    outputs = tripping_run(stream, 0, 259, averaging=False)
    assert column(outputs, "alarm")[-1] == 1.0
    assert np.max(np.abs(column(outputs, "x_dm") - column(outputs, "x_d"))[-10:]) < 1e-15


@on_all((COMPENSATOR,))
@pytest.mark.parametrize("delay", [-1, 0, 5])
def test_a_measurement_is_compared_with_the_command_of_its_time(new_stream: StreamMaker, delay: int) -> None:
    preview = int(SHORT[COMPENSATOR]["preview"])
    for beside, tripped in ((0, False), (1, True)):
        stream = new_stream()
        initialise(stream, measurement_delay=delay, following_error_max=1e-9)
        for k in range(170):
            stream.set("x_d_ahead", position(k * T_S))
            stream.set("x_meas", position(max(0, k - preview - delay + beside) * T_S))
            stream.step(k * T_S, T_S)
        assert (stream.outputs()[-1] == 1.0) == tripped
        stream.close()


@on_adapters((COMPENSATOR,))
def test_a_saved_state_carries_a_trip_and_the_level_of_the_reset(new_stream: StreamMaker) -> None:
    stream, other = new_stream(), new_stream()
    for each in (stream, other):
        initialise(each, following_error_max=ALLOWED, **LIMITS)
    for first, last in ((0, 173), (173, 250), (250, 320)):
        tripping_run(stream, first, last)
        blob = stream.save()
        expected = tripping_run(stream, last, last + 30)
        other.restore(blob)
        np.testing.assert_array_equal(tripping_run(other, last, last + 30), expected)
        stream.restore(blob)


@on_adapters((COMPENSATOR,))
def test_the_limit_may_change_in_a_run(new_stream: StreamMaker) -> None:
    stream = new_stream()
    initialise(stream)
    tripping_run(stream, 0, 170)
    stream.set("following_error_max", 1e-6)
    tripping_run(stream, 170, 171)
    assert stream.outputs()[-1] == 0.0
    tripping_run(stream, 171, 175)
    assert stream.outputs()[-1] == 1.0
    stream.set("following_error_max", 0.0)
    tripping_run(stream, 175, 200)
    assert stream.outputs()[-1] == 1.0
    tripping_run(stream, 200, 320)
    assert stream.outputs()[-1] == 0.0
