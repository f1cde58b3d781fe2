"""Where a run begins and ends, on every implementation."""

import math
import re

import numpy as np
import pytest
from driving import T_S, initialise, steps
from stream import (
    COMPENSATOR,
    DRIVE,
    FMI3,
    LOOK_AHEADS,
    MODELS,
    OUTPUTS,
    PLANTS,
    PREDICTOR,
    TRAJECTORY,
    WINDOWS,
    RefusedStreamError,
    Value,
)
from streams import StreamMaker, on_adapters


@on_adapters(MODELS, needs="stop time")
def test_the_stop_time_is_reached_in_rounded_sums(new_stream: StreamMaker) -> None:
    stream = new_stream()
    stream.initialise({}, stop=0.1)
    t = 0.0
    for _ in range(100):
        stream.step(t, T_S)
        t += T_S
    assert t != 0.1
    with pytest.raises(RefusedStreamError, match=r"a step must begin before the stop time 0.1 s, got one from 0.1"):
        stream.step(t, T_S)


@on_adapters((*LOOK_AHEADS, TRAJECTORY))
@pytest.mark.parametrize(
    ("start", "message"),
    [
        (1e13, "small enough to resolve samples of T_s = 0.001 s, got 1e+13 s"),
        (-1e300, "small enough to resolve samples of T_s = 0.001 s, got -1e+300 s"),
        *((start, "ime must be finite") for start in (math.inf, -math.inf, math.nan)),
    ],
)
def test_a_start_time_that_cannot_be_counted_from(new_stream: StreamMaker, start: float, message: str) -> None:
    with pytest.raises(RefusedStreamError, match=message.replace("+", r"\+")):
        initialise(new_stream(), start)


AT_REST: dict[str, dict[str, Value]] = {
    PREDICTOR: {"x_d_ahead": 0.25, "Np": 60},
    COMPENSATOR: {"x_d_ahead": 0.25},
    DRIVE: {"x_d": 0.25, "noise_std": 0.0},
}
"""Start values of a system that is at rest at 0.25 m."""


def at_rest(model: str, **others: float) -> list[float]:
    """Return the outputs that belong to :data:`AT_REST`; a compensator has predicted its first window."""
    others = {"x_h_std": 5e-6, **others} if model == COMPENSATOR else others  # 5 roots of lambda
    shown = {**dict.fromkeys(("x_dm", "x_d", "x_pb", "x_h", "x", "x_meas"), 0.25), **others}
    return [shown.get(name, 0.0) for name in OUTPUTS[model]]


@on_adapters((*LOOK_AHEADS, DRIVE))
def test_outputs_right_after_the_initialization(new_stream: StreamMaker) -> None:
    stream = new_stream()
    stream.initialise(AT_REST[new_stream.model])
    assert stream.outputs() == at_rest(new_stream.model, sep_state=1.0)
    if new_stream.model == COMPENSATOR:
        for compensate in (0, 1):  # the model that plans first
            stream.reset()
            stream.initialise({**AT_REST[COMPENSATOR], "compensate": compensate})
            assert stream.outputs() == at_rest(COMPENSATOR, sep_state=compensate)
    if new_stream.model == PREDICTOR:
        for name in WINDOWS:
            known = 0.0 if name == "x_h_std_window" else 0.25
            past = 0 if new_stream.implementation == FMI3 else 40  # whose arrays are of Np samples
            np.testing.assert_array_equal(stream.window(name), [known] * 60 + [0.0] * past)


@on_adapters((*LOOK_AHEADS, DRIVE), needs="outputs before")
def test_outputs_before_the_initialization_has_ended(new_stream: StreamMaker) -> None:
    shown = new_stream().outputs_before(AT_REST[new_stream.model])
    assert shown == at_rest(new_stream.model, sep_state=1.0)


@on_adapters((*LOOK_AHEADS, *PLANTS), needs="outputs before")
@pytest.mark.parametrize(
    ("start", "reason"),
    [
        (math.inf, "must be finite, got inf"),
        (-math.inf, "must be finite, got -inf"),
        (math.nan, "must be finite, got nan"),
        (1e308, "must be within ±1000 m, got 1e+308"),
    ],
)
def test_no_output_follows_from_a_start_that_is_no_position(new_stream: StreamMaker, start: float, reason: str) -> None:
    command = "x_d" if "FeedDrive" in new_stream.model else "x_d_ahead"
    with pytest.raises(RefusedStreamError, match=re.escape(f"the start value of {command} {reason}")):
        new_stream().outputs_before({command: start})


@on_adapters((*LOOK_AHEADS, *PLANTS))
def test_a_reset_forgets_everything(new_stream: StreamMaker) -> None:
    stream, fresh = new_stream(), new_stream()
    initialise(fresh)
    expected = steps(fresh, 0, 160)
    for values in (
        {"x_d_ahead": 0.1, "q": 1, "averaging": True},
        {"x_d_ahead": -0.2, "lambda": 1e-9, "averaging": False},
    ):
        other = {"x_d": 0.1, "seed": 5} if "FeedDrive" in new_stream.model else values
        initialise(stream, **other)
        steps(stream, 0, 130)
        stream.reset()
    initialise(stream)
    assert steps(stream, 0, 160) == expected
    default, reset = new_stream(), new_stream()
    initialise(reset)
    reset.reset()
    for each in (default, reset):
        each.initialise({})
    assert steps(default, 0, 130) == steps(reset, 0, 130)
