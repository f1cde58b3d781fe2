"""Parameters that change in a run, on every implementation: from the next window on, without a jump of the command.

And the monitor of the following error: what trips it, how the change fades, and the reset.
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import pytest
from driving import SHORT, T_S, TIGHT, initialise, position, set_inputs, steps
from library_stream import LookAheadStream
from stream import COMPENSATOR, OUTPUTS, Array, RefusedStreamError, Stream, Value
from streams import StreamMaker, on_adapters, on_all

TOLERANCE = 1e-9  # of a plan, m: 1 nm

N_RUN = 500
CHANGES = {129: ("compensate", 0), 248: ("compensate", 2), 311: ("change_max", 5e-6), 395: ("change_max", 1e-3)}
CHANGES[427] = ("compensate", 1)
"""What is set before which sample; windows begin at multiples of 20."""

LIMITS = {"v_max": 0.5, "a_max": 30.0, "j_max": 3000.0}

averages = pytest.mark.parametrize("averaging", [True, False])
compensators = on_adapters((COMPENSATOR,))


def stepped(stream: Stream, setting: Callable[[int], Mapping[str, Value]], first: int = 0, last: int = N_RUN) -> Array:
    """Step through the smooth motion with what is set before each sample besides."""
    outputs = []
    for k in range(first, last):
        set_inputs(stream, k * T_S)
        for name, value in setting(k).items():
            stream.set(name, value)
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
    return np.array(outputs)


def changed_run(stream: Stream, first: int = 0, last: int = N_RUN) -> Array:
    return stepped(stream, lambda k: dict([CHANGES[k]]) if k in CHANGES else {}, first, last)


@cache
def of_the_library(run: Callable[[Stream], Array], **values: Value) -> Array:
    library = LookAheadStream(COMPENSATOR)
    initialise(library, **values, **LIMITS)
    return run(library)


def column(outputs: Array, name: str) -> Array:
    return outputs[:, OUTPUTS[COMPENSATOR].index(name)]


def assert_limits(x_dm: Array) -> None:
    for order, (name, bound) in enumerate(LIMITS.items(), start=1):
        largest = np.max(np.abs(np.diff(x_dm[100:], order))) / T_S**order
        assert largest <= bound * (1 + 1e-6), name


@averages
@compensators
def test_changes_act_from_the_next_window_on_and_fade(new_stream: StreamMaker, averaging: bool) -> None:
    stream = new_stream.begun(averaging=averaging, **LIMITS)
    outputs, expected = changed_run(stream), of_the_library(changed_run, averaging=averaging)
    x_dm, x_d, state = (column(outputs, name) for name in ("x_dm", "x_d", "sep_state"))
    np.testing.assert_allclose(x_dm, column(expected, "x_dm"), rtol=0, atol=TOLERANCE)
    assert state.tolist() == column(expected, "sep_state").tolist()
    delta = np.abs(x_dm - x_d)
    # Row i is written after sample i and holds the outputs of sample i + 1: off in the window that begins at 140, gone
    # a preview later,
    assert np.max(delta[100:139]) > 2e-5
    assert np.all(state[130:139] > 0)
    assert np.all(state[159:259] == 0)
    assert delta[145] > 1e-6
    assert np.max(delta[199:259]) < 1e-15
    # on from 260; bounded from 320 on, when what was planned before has ended at 360, and free again from 400 on.
    assert np.max(delta[270:319]) > 2e-5
    assert np.max(delta[359:399]) <= 5e-6 * (1 + 1e-6)
    assert np.max(delta[410:]) > 1e-5
    assert np.max(state[459:]) == 1.0  # physics at best
    assert_limits(x_dm)


@compensators
def test_a_saved_state_carries_what_was_changed(new_stream: StreamMaker) -> None:
    stream = new_stream.begun(**TIGHT)
    changed_run(stream, 0, 135)  # off from 140 on
    blob = stream.save()
    expected = steps(stream, 135, 200)
    stream.restore(blob)
    assert steps(stream, 135, 200) == expected
    other = new_stream.begun(**TIGHT)
    other.restore(blob)
    assert steps(other, 135, 200) == expected
    blob = stream.save()  # while it is off
    stream.set("compensate", 2)
    steps(stream, 200, 250)
    stream.restore(blob)
    tail = np.array(steps(stream, 200, 250))
    assert column(tail, "sep_state").tolist() == [0] * 50


@on_adapters((COMPENSATOR,), needs="setters")
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("compensate", 3, "compensate must be 0 … 2, got 3"),
        ("change_max", -1.0, "change_max must be 1e-12 … 10 m, got -1.0"),
        ("change_max", float("nan"), "change_max must be finite, got nan"),
        ("following_error_max", -1.0, "following_error_max must be 0 or 1e-12 … 10 m, got -1.0"),
    ],
)
def test_a_value_out_of_range_is_refused_when_it_is_set(
    new_stream: StreamMaker, name: str, value: float, message: str
) -> None:
    stream, untroubled = new_stream.begun(), new_stream.begun()
    for each in (stream, untroubled):
        steps(each, 0, 50)
    with pytest.raises(RefusedStreamError, match=re.escape(message)):
        stream.set(name, value)
    assert steps(stream, 50, 90) == steps(untroubled, 50, 90)


def gap_run(stream: Stream) -> Array:
    """Step with measurements missing from 130 to 259."""
    return stepped(stream, lambda k: {"x_meas": math.nan} if 130 <= k < 260 else {})


@compensators
@pytest.mark.parametrize("timeout", [0.05, 0.0])
def test_the_change_fades_while_no_measurement_comes(new_stream: StreamMaker, timeout: float) -> None:
    outputs = gap_run(new_stream.begun(measurement_timeout=timeout, **LIMITS))
    expected = of_the_library(gap_run, measurement_timeout=timeout)
    x_dm, x_d, lost = (column(outputs, name) for name in ("x_dm", "x_d", "no_measurement"))
    first = slice(0, 280)  # after so long without a measurement, plans of the rest are more apart than the tolerance
    np.testing.assert_allclose(x_dm[first], column(expected, "x_dm")[first], rtol=0, atol=TOLERANCE)
    assert lost.tolist() == column(expected, "no_measurement").tolist()
    delta = np.abs(x_dm - x_d)
    # the 50th is missing at 179, before the window from 180 on; 260 is measured, before that from 280 on
    assert np.flatnonzero(lost).tolist() == (list(range(179, 260)) if timeout else [])
    assert (np.max(delta[238:279]) < 1e-15) == (timeout > 0.0)
    assert np.max(delta[290:340]) > 2e-5
    assert_limits(x_dm)


# The monitor ------------------------------------------------------------------------------------------------------


ALLOWED, BEYOND = 0.02, 0.05
"""``following_error_max``, m, which the motion does not reach; and where a measurement is beside it."""

OVER, MISSING = {140, 141, 171, 173, 174, 310, 311, 312}, {172}
RESET = {260: True, 330: False, 340: True}


def tripping_run(stream: Stream, first: int = 0, last: int = N_RUN, *, averaging: bool = True) -> Array:
    """Step through a motion that is measured beside the command now and then; windows begin at multiples of 20."""

    def setting(k: int) -> dict[str, Value]:
        found: dict[str, Value] = {"x_meas": position(k * T_S) + BEYOND} if k in OVER else {}
        if k in MISSING and averaging:
            found["x_meas"] = math.nan
        return found | ({"reset": RESET[k]} if k in RESET else {})

    return stepped(stream, setting, first, last)


@compensators
def test_a_trip_fades_and_ends_with_a_rising_reset(new_stream: StreamMaker) -> None:
    stream = new_stream.begun(following_error_max=ALLOWED, **LIMITS)
    outputs, expected = tripping_run(stream), of_the_library(tripping_run, following_error_max=ALLOWED)
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
    assert_limits(x_dm)


@compensators
def test_what_is_measured_above_the_limit_and_until_the_reset_is_not_learned(new_stream: StreamMaker) -> None:
    seen = []
    for beside in (BEYOND, -10 * BEYOND):

        def setting(k: int, beside: float = beside) -> dict[str, Value]:
            return {"reset": k == 300} | ({"x_meas": position(k * T_S) + beside} if 200 <= k < 290 else {})

        stream = new_stream.begun(following_error_max=ALLOWED, **LIMITS)
        seen.append(stepped(stream, setting))
        stream.close()
    for name in ("x_dm", "x_h", "x_h_std", "sep_state", "alarm"):
        np.testing.assert_array_equal(column(seen[0], name), column(seen[1], name))
    assert column(seen[0], "alarm").nonzero()[0].tolist() == [*range(202, 300)]
    assert column(seen[0], "sep_state")[300:].any()


@on_all((COMPENSATOR,))
def test_the_papers_model_trips_alike(new_stream: StreamMaker) -> None:
    stream = new_stream.begun(averaging=False, following_error_max=ALLOWED, **LIMITS)
    assert not column(tripping_run(stream, 0, 279, averaging=False), "alarm").any()  # 172 is measured
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
        stream = new_stream.begun(measurement_delay=delay, following_error_max=1e-9)
        for k in range(170):
            stream.set("x_d_ahead", position(k * T_S))
            stream.set("x_meas", position(max(0, k - preview - delay + beside) * T_S))
            stream.step(k * T_S, T_S)
        assert (stream.outputs()[-1] == 1.0) == tripped
        stream.close()


@compensators
@pytest.mark.parametrize(("compensate", "delay", "first"), [(0, 0, 168), (2, 0, 165), (0, 5, 164), (2, 5, 161)])
def test_a_change_that_does_not_move_the_axis_trips_sooner(
    new_stream: StreamMaker, compensate: int, delay: int, first: int
) -> None:
    stream = new_stream.begun(following_error_max=2.5e-3, measurement_delay=delay, compensate=compensate, **LIMITS)
    assert np.argmax(column(stepped(stream, lambda k: {}, 0, 170), "alarm")) == first


@compensators
def test_a_saved_state_carries_a_trip_and_the_level_of_the_reset(new_stream: StreamMaker) -> None:
    stream, other = (new_stream.begun(following_error_max=ALLOWED, **LIMITS) for _ in range(2))
    for first, last in ((0, 173), (173, 250), (250, 320)):
        tripping_run(stream, first, last)
        blob = stream.save()
        expected = tripping_run(stream, last, last + 30)
        other.restore(blob)
        np.testing.assert_array_equal(tripping_run(other, last, last + 30), expected)
        stream.restore(blob)


@compensators
def test_the_limit_may_change_in_a_run(new_stream: StreamMaker) -> None:
    stream = new_stream.begun()
    first = 0
    for allowed, last, alarm in ((0.0, 170, 0), (1e-6, 171, 0), (1e-6, 175, 1), (0.0, 200, 1), (0.0, 320, 0)):
        stream.set("following_error_max", allowed)
        assert tripping_run(stream, first, last)[-1, -1] == alarm
        first = last
