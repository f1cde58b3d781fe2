"""What every implementation refuses, in the same words; that it changes nothing; windows that diverge."""

import math
import re

import numpy as np
import pytest
from driving import T_S, initialise, set_inputs, steps
from library_stream import runaway_predictor
from stream import (
    CANNOT,
    COMPENSATOR,
    DRIVE,
    LOOK_AHEADS,
    MODELS,
    PLANTS,
    PREDICTOR,
    STAGE,
    STAGE_PREDICTOR,
    TRAJECTORY,
    WINDOWS,
    RefusedStreamError,
    Stream,
    Value,
    table_of_model,
)
from streams import StreamMaker, on_adapters, on_all

from hybridsep.base.parameters import Parameter
from hybridsep.fmi.weights import weights_file

Case = tuple[dict[str, Value], str]

TOGETHER: dict[str, list[Case]] = {
    PREDICTOR: [
        ({"p": 120}, "p must be 1 … Np = 100, got 120; lower p or raise Np"),
        ({"q": 100}, "q must be 0 … Np − 1 = 99, got 100; lower q or raise Np"),
        ({"p": 0, "lambda": 0.0}, "p must be 1 … 5000, got 0; lambda must be 1e-40 … 1e+12 m2, got 0.0"),
        *(({"x_d_ahead": x}, f"the start value of x_d_ahead must be finite, got {x}") for x in (math.inf, math.nan)),
        ({"x_d_ahead": -1e6}, "the start value of x_d_ahead must be within ±1000 m, got -1e+06"),
    ],
    COMPENSATOR: [
        ({"preview": 60}, "preview must be ≥ Np + 4·spacing + 3 = 61, got 60"),
        ({"spacing": 3}, "spacing must be ≥ 1 and divide Np = 50, got 3"),
        (
            {"measurement_delay": 4, "averaging": False},
            "measurement_delay of a compensator must be 0 with averaging = false, got 4: only the model with averaging "
            "plans from a late measurement",
        ),
        (
            {"p": 60, "q": 50},
            "p must be 1 … Np = 50, got 60; lower p or raise Np; "
            "q must be 0 … Np − 1 = 49, got 50; lower q or raise Np",
        ),
    ],
    DRIVE: [({"k": 1e12}, "sqrt(k/m) and c/m must be at most 100000 1/s, got 1e+06; lower k or c, or raise m")],
    TRAJECTORY: [({"trajectory": 4}, "trajectory must be 0 … 3, got 4")],
    STAGE: [
        (
            {"mode[1].f_n": 2e4},
            "2 pi f_n and 4 pi f_n zeta of mode[1] must be at most 100000 1/s in a plant, got 125664; "
            "lower f_n or zeta",
        )
    ],
}
"""Refusals of several parameters, or of one because of another, by model."""

ODD = (-1e-12, -123456.789, -1e16, -5e-324, -1e22, -0.25)  # numbers that are written in as many ways


def out_of_range(model: str) -> list[Case]:
    """Return a value below and one above the declared range of each parameter, and no number, with what is said."""
    cases: list[Case] = []
    for i, variable in enumerate(table_of_model(model).variables):
        least, most = variable.minimum, variable.maximum
        if variable.causality != "parameter" or variable.kind == "Boolean" or least is None or most is None:
            continue
        unit = "" if variable.unit in (None, "1") else f" {variable.unit}"
        more = {"nonzero": variable.nonzero, "automatic": variable.automatic}
        declared = Parameter(float, None, least, most, unit, "", variable.name, **more)  # type: ignore[arg-type]
        values: list[Value] = [2.0 * most, ODD[i % len(ODD)] if least >= 0.0 else 2.0 * least, math.nan]
        if variable.kind != "Real":
            values = [int(least) - 1, int(most) + 1]
        for value in values:
            said = f"{declared.range_text}{unit}" if math.isfinite(value) else "finite"
            if abs(value) < 2**31 or variable.kind == "Real":
                cases.append(({variable.name: value}, f"{variable.name} must be {said}, got {value}"))
    return cases


@on_adapters((*LOOK_AHEADS, STAGE_PREDICTOR, *PLANTS, TRAJECTORY))
def test_bad_parameters_are_named_and_others_live_on(new_stream: StreamMaker) -> None:
    good, bad, fresh = new_stream(), new_stream(), new_stream()
    good.initialise({})
    expected = steps(good, 0, 3)
    refused = [*TOGETHER.get(new_stream.model, ()), *out_of_range(new_stream.model)]
    for values, message in (*refused, refused[-1]):  # a second failure of one kind ends nothing either
        with pytest.raises(RefusedStreamError, match=rf"(^|: ){re.escape(message)}$"):
            bad.initialise(values)
        bad.reset()
    for each in (bad, fresh):
        each.initialise({})
        assert steps(each, 0, 3) == expected
    assert len(steps(good, 3, 6)) == 3


def assert_refused(stream: Stream, t: float, h: float, message: str) -> None:
    """Step; the stream must refuse with the message, and be as it was."""
    before, outputs = stream.save(), stream.outputs()
    with pytest.raises(RefusedStreamError, match=re.escape(message)):
        stream.step(t, h)
    assert stream.save() == before
    assert stream.outputs() == outputs


@on_adapters(MODELS)
@pytest.mark.parametrize("h", [0.0, -T_S, math.nan, math.inf, 100.5])
def test_a_step_size_that_cannot_be_changes_nothing(new_stream: StreamMaker, h: float) -> None:
    stream = new_stream.begun()
    steps(stream, 0, 50)
    assert_refused(stream, 0.05, h, f"the communication step size must be > 0 and ≤ 100 s, got {h}")
    stream.step(0.05, T_S)


OTHER_TIMES = pytest.mark.parametrize("t", [0.0, 0.0506, 0.0494, math.nan, math.inf])


@on_adapters((*LOOK_AHEADS, TRAJECTORY))
@OTHER_TIMES
def test_a_step_from_another_time_changes_nothing(new_stream: StreamMaker, t: float) -> None:
    stream = new_stream.begun()
    steps(stream, 0, 50)
    assert_refused(stream, t, T_S, f"the communication point must be 0.05 s, where the last step ended, got {t} s")
    stream.step(0.0496 if t < 0.05 else 0.0504, T_S)  # rounding, of an importer that means it badly


@on_adapters(PLANTS, needs="a plant's time")
@OTHER_TIMES
def test_a_plants_step_from_another_time_changes_nothing(new_stream: StreamMaker, t: float) -> None:
    test_a_step_from_another_time_changes_nothing(new_stream, t)


@on_adapters(PLANTS, needs="a plant's time")
def test_a_plant_goes_back_by_a_saved_state_alone(new_stream: StreamMaker) -> None:
    stream = new_stream()
    stream.initialise({}, start=5.0)
    stream.step(5.0, 2 * T_S)
    blob = stream.save()
    stream.step(5.002, T_S)
    assert_refused(stream, 5.002, T_S, "the communication point must be 5.003 s, where the last step ended, got 5.002")
    stream.restore(blob)
    assert_refused(stream, 5.003, T_S, "the communication point must be 5.002 s, where the last step ended, got 5.003")
    stream.step(5.002, T_S)


BAD_POSITIONS = pytest.mark.parametrize(
    ("value", "expected"), [(math.nan, "finite"), (-math.inf, "finite"), (1e30, "within ±1000 m")]
)


@pytest.mark.slow
@on_adapters(LOOK_AHEADS)
@pytest.mark.parametrize("name", ["x_d_ahead", "x_meas"])
@BAD_POSITIONS
def test_an_input_that_is_no_position_changes_nothing(
    new_stream: StreamMaker, name: str, value: float, expected: str
) -> None:
    stream, untroubled = new_stream(), new_stream()
    for each in (stream, untroubled):
        initialise(each, averaging=not math.isnan(value))  # with averaging a measurement may be missing
        steps(each, 0, 145)
        each.step(0.145, 0.4 * T_S)
        set_inputs(each, 0.146)
    stream.set(name, value)
    # The step's later instants are checked before its first one is executed.
    assert_refused(stream, 0.1454, 8 * T_S, f"{name} must be {expected}, got {value:g} at sample 146")
    if name == "x_load":
        stream.set(name, 0.0)
    for each in (stream, untroubled):
        set_inputs(each, 0.146)
        each.step(0.1454, 0.6 * T_S)
    assert steps(stream, 146, 230) == steps(untroubled, 146, 230)
    assert stream.save() == untroubled.save()


@pytest.mark.slow
@on_adapters((COMPENSATOR,))
@BAD_POSITIONS
def test_a_load_that_is_no_position_changes_nothing(new_stream: StreamMaker, value: float, expected: str) -> None:
    test_an_input_that_is_no_position_changes_nothing(new_stream, "x_load", value, expected)


@on_adapters(PLANTS)
@BAD_POSITIONS
def test_a_plants_command_that_is_no_position_changes_nothing(
    new_stream: StreamMaker, value: float, expected: str
) -> None:
    stream, untroubled = new_stream.begun(), new_stream.begun()
    for each in (stream, untroubled):
        steps(each, 0, 3)
    stream.set("x_d", value)
    timeless = (new_stream.implementation, "a plant's time") in CANNOT
    assert_refused(stream, 0.003, T_S, f"x_d must be {expected}, got {value:g}{'' if timeless else ' at t = 0.003 s'}")
    assert steps(stream, 3, 50) == steps(untroubled, 3, 50)


@on_adapters(PLANTS, needs="a plant's time")
@BAD_POSITIONS
def test_a_plants_start_that_is_no_position_is_refused(new_stream: StreamMaker, value: float, expected: str) -> None:
    with pytest.raises(RefusedStreamError, match=f"the start value of x_d must be {expected}, got"):
        new_stream().initialise({"x_d": value})


@on_adapters((DRIVE,))
def test_a_step_too_long_for_a_fast_plant_is_refused(new_stream: StreamMaker) -> None:
    stream = new_stream()
    stream.initialise({"k": 9e9})
    assert_refused(stream, 0.0, 50.0, "the step size must be at most 0.658808 s for a drive as fast as 94868.3 1/s")
    stream.step(0.0, T_S)


SAID = re.escape("x_h must stay within ±1e+100 m: the learned recursion diverges; raise lambda, lower p or reset")


@on_all((PREDICTOR,))
def test_a_window_that_diverges_is_refused_until_another_state_is_set(new_stream: StreamMaker) -> None:
    stream, other = (new_stream.planted(weights_file(runaway_predictor())) for _ in range(2))
    stream.initialise({"t_init": 0.0, "x_d_ahead": 0.01})
    beginning = stream.save()
    first = steps(stream, 0, 99)
    before, outputs = stream.save(), stream.outputs()
    windows = [stream.window(name) for name in WINDOWS]
    for k in range(99, 103):
        with pytest.raises(RefusedStreamError, match=SAID):
            stream.step(k * T_S, T_S)
        assert stream.outputs() == outputs
        np.testing.assert_array_equal([stream.window(name) for name in WINDOWS], windows)
    diverged = stream.save()
    # It may be saved, and stays what it is.
    for state in (diverged, before):
        other.restore(state)
        with pytest.raises(RefusedStreamError, match=SAID):
            other.step(99 * T_S, T_S)
    stream.restore(beginning)
    assert steps(stream, 0, 99) == first


@on_all((PREDICTOR,))
def test_the_warm_up_hides_what_diverges(new_stream: StreamMaker) -> None:
    stream = new_stream.planted(weights_file(runaway_predictor()))
    stream.initialise({"t_init": 0.1})
    for row in steps(stream, 0, 199):
        assert row[1] == row[2]
        assert np.isfinite(row).all()
    with pytest.raises(RefusedStreamError, match=SAID):
        stream.step(199 * T_S, T_S)
    stream.reset()
    stream.initialise({"t_init": 1e3})
    steps(stream, 0, 300)
