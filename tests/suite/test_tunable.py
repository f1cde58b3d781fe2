"""Parameters that change in a run, on every implementation: from the next window on, without a jump of the command."""

import re
from functools import cache

import numpy as np
import pytest
from driving import T_S, TIGHT, initialise, set_inputs, steps
from library_stream import LookAheadStream
from stream import COMPENSATOR, OUTPUTS, Array, RefusedStreamError, Stream
from streams import StreamMaker, on_adapters

TOLERANCE = 1e-9  # of a plan, m: 1 nm

N_RUN = 440
CHANGES = {129: ("compensate", 0), 248: ("compensate", 2), 311: ("change_max", 5e-6), 395: ("change_max", 1e-3)}
"""What is set before which sample; windows begin at multiples of 20."""

LIMITS = {"v_max": 0.5, "a_max": 30.0, "j_max": 3000.0}

averages = pytest.mark.parametrize("averaging", [True, False])
compensators = on_adapters((COMPENSATOR,))


def changed_run(stream: Stream, first: int = 0, last: int = N_RUN) -> Array:
    outputs = []
    for k in range(first, last):
        if k in CHANGES:
            stream.set(*CHANGES[k])
        set_inputs(stream, k * T_S)
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
    return np.array(outputs)


@cache
def of_the_library(averaging: bool) -> Array:
    library = LookAheadStream(COMPENSATOR)
    initialise(library, averaging=averaging, **LIMITS)
    return changed_run(library)


def column(outputs: Array, name: str) -> Array:
    return outputs[:, OUTPUTS[COMPENSATOR].index(name)]


@averages
@compensators
def test_changes_act_from_the_next_window_on_and_fade(new_stream: StreamMaker, averaging: bool) -> None:
    stream = new_stream()
    initialise(stream, averaging=averaging, **LIMITS)
    outputs, expected = changed_run(stream), of_the_library(averaging)
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
    for order, (name, bound) in enumerate(LIMITS.items(), start=1):
        largest = np.max(np.abs(np.diff(x_dm[100:], order))) / T_S**order
        assert largest <= bound * (1 + 1e-6), name


@compensators
def test_a_saved_state_carries_what_was_changed(new_stream: StreamMaker) -> None:
    stream = new_stream()
    initialise(stream, **TIGHT)
    changed_run(stream, 0, 135)  # off from 140 on
    blob = stream.save()
    expected = steps(stream, 135, 200)
    stream.restore(blob)
    assert steps(stream, 135, 200) == expected
    other = new_stream()
    initialise(other, **TIGHT)
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
    stream, untroubled = new_stream(), new_stream()
    for each in (stream, untroubled):
        initialise(each)
        steps(each, 0, 50)
    with pytest.raises(RefusedStreamError, match=re.escape(message)):
        stream.set(name, value)
    assert steps(stream, 50, 90) == steps(untroubled, 50, 90)


def gap_run(stream: Stream, timeout: float) -> Array:
    """Step with measurements missing from 130 to 259."""
    initialise(stream, measurement_timeout=timeout, **LIMITS)
    outputs = []
    for k in range(N_RUN):
        set_inputs(stream, k * T_S)
        if 130 <= k < 260:
            stream.set("x_meas", float("nan"))
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
    return np.array(outputs)


@cache
def gap_of_the_library(timeout: float) -> Array:
    return gap_run(LookAheadStream(COMPENSATOR), timeout)


@compensators
@pytest.mark.parametrize("timeout", [0.05, 0.0])
def test_the_change_fades_while_no_measurement_comes(new_stream: StreamMaker, timeout: float) -> None:
    outputs, expected = gap_run(new_stream(), timeout), gap_of_the_library(timeout)
    x_dm, x_d, lost = (column(outputs, name) for name in ("x_dm", "x_d", "no_measurement"))
    first = slice(0, 280)  # after so long without a measurement, plans of the rest are more apart than the tolerance
    np.testing.assert_allclose(x_dm[first], column(expected, "x_dm")[first], rtol=0, atol=TOLERANCE)
    assert lost.tolist() == column(expected, "no_measurement").tolist()
    delta = np.abs(x_dm - x_d)
    # the 50th is missing at 179, before the window from 180 on; 260 is measured, before that from 280 on
    assert np.flatnonzero(lost).tolist() == (list(range(179, 260)) if timeout else [])
    assert (np.max(delta[238:279]) < 1e-15) == (timeout > 0.0)
    assert np.max(delta[290:340]) > 2e-5
    for order, (name, bound) in enumerate(LIMITS.items(), start=1):
        largest = np.max(np.abs(np.diff(x_dm[100:], order))) / T_S**order
        assert largest <= bound * (1 + 1e-6), name
