"""The timing rule, on every implementation: any communication step gives what steps of ``T_s`` give.

Truth is the rule itself in exact fractions: which instants a step has reached, and which step's inputs each of them
latches. The run in steps of ``T_s`` that gets the inputs so latched must show the same outputs bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from itertools import accumulate

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from streams import (
    DRIVE,
    LOOK_AHEADS,
    PLANTS,
    PREDICTOR,
    STAGE,
    TRAJECTORY,
    WITHOUT_SLOPES,
    RefusedStreamError,
    Stream,
    StreamMaker,
    cases,
)

T_S = 1e-3  # s
N_SAMPLES = 420
SHORT: dict[str, dict[str, float | int | bool]] = {
    "HybridPredictor": {"Np": 20, "p": 6, "q": 2, "t_init": 0.05},
    "SepCompensator": {"Np": 20, "p": 6, "q": 2, "t_init": 0.05, "preview": 60},
    TRAJECTORY: {"trajectory": 0},
}
"""Windows short enough for many of them; the C core plays trajectory 3, the one its resources hold."""

Clock = list[Fraction]

every = pytest.mark.parametrize("new_stream", cases((*LOOK_AHEADS, TRAJECTORY)), indirect=True)
every_look_ahead = pytest.mark.parametrize("new_stream", cases(LOOK_AHEADS), indirect=True)
every_plant = pytest.mark.parametrize("new_stream", cases(PLANTS), indirect=True)


def position(t: float) -> float:
    """Return a smooth command, m."""
    return 0.01 * (1 - math.cos(9 * t)) + 1e-3 * math.sin(40 * t)


def measured(t: float) -> float:
    return position(t - 0.03) + 2e-5 * math.sin(300 * t)


def steps_of(pattern: str) -> list[Fraction]:
    """Return step sizes in samples until :data:`N_SAMPLES` are reached."""
    if pattern == "mixture":
        rng = np.random.default_rng(8)
        sizes = [Fraction(int(rng.integers(1, 5000)), 1000) for _ in range(4 * N_SAMPLES)]
    else:
        sizes = [Fraction(pattern)] * math.ceil(N_SAMPLES / Fraction(pattern))
    ends = list(accumulate(sizes))
    return sizes[: next(i for i, end in enumerate(ends, start=1) if end >= N_SAMPLES)]


def initialise(stream: Stream, new_stream: StreamMaker, start: float) -> None:
    values = dict(SHORT[new_stream.model])
    if new_stream.implementation == "C core" and new_stream.model == TRAJECTORY:
        values = {"trajectory": 3}
    stream.initialise(values, start=start)


def set_inputs(stream: Stream, new_stream: StreamMaker, t: float) -> None:
    if new_stream.model in LOOK_AHEADS:
        stream.set("x_d_ahead", position(t))
        stream.set("x_meas", measured(t))


def in_steps(new_stream: StreamMaker, sizes: list[Fraction], start: float) -> tuple[Clock, list[list[float]]]:
    """Return the communication points, in samples, and the outputs at each; inputs are those of the step's start."""
    stream = new_stream()
    initialise(stream, new_stream, start)
    points, outputs = [Fraction(0)], [stream.outputs()]
    for size in sizes:
        # The importer's time: an exact sum, rounded once.
        set_inputs(stream, new_stream, float(points[-1]) * T_S)
        stream.step(start + float(points[-1]) * T_S, float(size) * T_S)
        points.append(points[-1] + size)
        outputs.append(stream.outputs())
    return points, outputs


def in_samples(new_stream: StreamMaker, points: Clock, start: float) -> list[list[float]]:
    """Return the outputs of a run in steps of ``T_s`` whose inputs are those that the other run's instants latch."""
    stream = new_stream()
    initialise(stream, new_stream, start)
    outputs = [stream.outputs()]
    step = 0
    for k in range(math.floor(points[-1])):
        while points[step + 1] <= k:  # an instant at a communication point belongs to the step that begins there
            step += 1
        set_inputs(stream, new_stream, float(points[step]) * T_S)
        stream.step(start + k * T_S, T_S)
        outputs.append(stream.outputs())
    return outputs


@every
@pytest.mark.parametrize(
    ("pattern", "start"),
    [
        *((pattern, 0.0) for pattern in ("0.3", "0.4", "0.5", "1", "2", "3.7", "8", "12.2", "370", "mixture")),
        *((pattern, start) for start in (1e6, 1e9) for pattern in ("0.3", "12.2", "mixture")),
    ],
)
def test_outputs_are_those_of_the_last_instant(new_stream: StreamMaker, pattern: str, start: float) -> None:
    points, outputs = in_steps(new_stream, steps_of(pattern), start)
    expected = in_samples(new_stream, points, start)
    for point, shown in zip(points, outputs, strict=True):
        assert shown == expected[math.floor(point)], f"{float(point)} samples"


@pytest.mark.parametrize("new_stream", cases((PREDICTOR, TRAJECTORY)), indirect=True)
def test_a_time_that_accumulates_rounding_is_no_error(new_stream: StreamMaker) -> None:
    # At 1e9 s the sum of t += T_s drifts by half a sample in 10 701 steps.
    stream, exact = new_stream(), new_stream()
    for each in (stream, exact):
        initialise(each, new_stream, 1e9)
    t = 1e9
    for k in range(11_500):
        for each, now in ((stream, t), (exact, 1e9 + k * T_S)):
            if k % 7 == 0:
                set_inputs(each, new_stream, k * T_S)
            each.step(now, T_S)
        t += T_S
    assert abs(t - (1e9 + 11_500 * T_S)) > 0.5 * T_S
    assert stream.outputs() == exact.outputs()


@every
def test_rollback_in_mid_sample(new_stream: StreamMaker) -> None:
    def run(stream: Stream, first: int, last: int) -> list[list[float]]:
        outputs = []
        for i in range(first, last):  # steps of 0.3 samples
            set_inputs(stream, new_stream, 3e-4 * i)
            stream.step(3e-4 * i, 3e-4)
            outputs.append(stream.outputs())
        return outputs

    stream, other = new_stream(), new_stream()
    initialise(stream, new_stream, 0.0)
    initialise(other, new_stream, 0.0)
    run(stream, 0, 611)
    blob = stream.save()
    expected = run(stream, 611, 900)
    stream.restore(blob)
    assert stream.save() == blob
    assert run(stream, 611, 900) == expected
    other.restore(blob)
    assert run(other, 611, 900) == expected


@every_look_ahead
def test_inputs_are_read_at_instants_only(new_stream: StreamMaker) -> None:
    stream, whole = new_stream(), new_stream()
    for each in (stream, whole):
        initialise(each, new_stream, 2.5)
    for k in range(130):
        for part in range(4):
            if part == 0:
                set_inputs(stream, new_stream, k * T_S)
            else:
                stream.set("x_d_ahead", math.nan)
                stream.set("x_meas", math.inf)
            before = stream.outputs()
            stream.step(2.5 + (k + part / 4) * T_S, T_S / 4)
            if part < 3:
                assert stream.outputs() == before
        set_inputs(whole, new_stream, k * T_S)
        whole.step(2.5 + k * T_S, T_S)
        assert stream.outputs() == whole.outputs()
    assert stream.warnings() == []


@every_look_ahead
def test_one_warning_where_an_instant_is_no_communication_point(new_stream: StreamMaker) -> None:
    stream = new_stream()
    initialise(stream, new_stream, 0.0)
    for i in range(3):
        stream.step(i * 8e-3, 8e-3)
    warnings = stream.warnings()
    # What is one an instance is the adapter's; the library and the core tell it each time.
    assert len(warnings) == (1 if "FMU" in new_stream.implementation else 3)
    assert "the step from 0 s by 0.008 s passes instants of T_s = 0.001 s" in warnings[0]
    assert "x_meas is read up to 0.007 s late" in warnings[0]


@every_look_ahead
def test_a_ramp_with_derivatives_is_that_of_single_samples(new_stream: StreamMaker) -> None:
    if new_stream.implementation in WITHOUT_SLOPES:
        with pytest.raises((NotImplementedError, RefusedStreamError)):
            new_stream().set_slope("x_d_ahead", 1.0)
        return
    ramp, slope = (0.002, 0.05), (0.04, 0.035)  # m, m/s of x_d_ahead and x_meas
    long, single = new_stream(), new_stream()
    for each in (long, single):
        initialise(each, new_stream, 0.0)
    for k in range(400):
        # Summed as in a long step, because a plan passes on the rounding of its inputs enlarged.
        inputs = [a + b * ((k - k % 8) * T_S) + b * (k % 8 * T_S) for a, b in zip(ramp, slope, strict=True)]
        for each in (long, single) if k % 8 == 0 else (single,):
            for name, value, rate in zip(("x_d_ahead", "x_meas"), inputs, slope, strict=True):
                each.set(name, value)
                if each is long:
                    each.set_slope(name, rate)
        if k % 8 == 0:
            long.step(k * T_S, 8 * T_S)
        single.step(k * T_S, T_S)
        if k % 8 == 7:
            np.testing.assert_allclose(long.outputs(), single.outputs(), rtol=0, atol=1e-15)
    blob = long.save()
    expected = []
    for _ in range(2):  # a derivative counts for one step
        long.restore(blob)
        long.step(0.4, 8 * T_S)
        expected.append(long.outputs())
    assert expected[0] == expected[1]


@every_plant
@pytest.mark.parametrize("step", ["0.3", "0.4", "0.5", "2", "3.7", "8", "12.2", "37"])
def test_plants_move_the_same_in_any_steps(new_stream: StreamMaker, step: str) -> None:
    # The command changes where both runs have a communication point.
    size = Fraction(step)
    hold = size * size.denominator // math.gcd(size.numerator, 1)
    runs = []
    for h in (Fraction(1), size):
        stream = new_stream()
        stream.initialise({} if new_stream.implementation == "library" else {"noise_std": 0.0})
        now, outputs = Fraction(0), []
        while now < 300:
            if now % hold == 0:
                stream.set("x_d", position(float(now) * T_S))
            stream.step(float(now) * T_S, float(h) * T_S)
            now += h
            if now % hold == 0:
                outputs.append(stream.outputs()[0])
        runs.append(outputs)
    n = min(map(len, runs))
    np.testing.assert_allclose(runs[0][:n], runs[1][:n], rtol=0, atol=1e-9)
    assert np.ptp(runs[0]) > 1e-3


@every
@pytest.mark.parametrize(
    ("t", "h", "message"),
    [
        (0.05, 0.0, "the communication step size must be > 0 and ≤ 100 s, got 0.0"),
        (0.05, -T_S, "the communication step size must be > 0 and ≤ 100 s, got -0.001"),
        (0.05, math.nan, "the communication step size must be > 0 and ≤ 100 s, got nan"),
        (0.05, 100.5, "the communication step size must be > 0 and ≤ 100 s, got 100.5"),
        (0.0506, T_S, "s, where the last step ended, got 0.0506 s"),
        (0.0494, T_S, "s, where the last step ended, got 0.0494 s"),
        (math.nan, T_S, "s, where the last step ended, got nan s"),
        (math.inf, T_S, "s, where the last step ended, got inf s"),
    ],
)
def test_a_refused_step_changes_nothing(new_stream: StreamMaker, t: float, h: float, message: str) -> None:
    stream = new_stream()
    initialise(stream, new_stream, 0.0)
    for k in range(50):
        set_inputs(stream, new_stream, k * T_S)
        stream.step(k * T_S, T_S)
    before = stream.save()
    with pytest.raises(RefusedStreamError) as refused:
        stream.step(t, h)
    assert message in str(refused.value)
    assert stream.save() == before
    stream.step(0.05, T_S)


@every_look_ahead
@pytest.mark.parametrize("name", ["x_d_ahead", "x_meas"])
def test_an_input_that_is_no_number_changes_nothing(new_stream: StreamMaker, name: str) -> None:
    stream = new_stream()
    initialise(stream, new_stream, 0.0)
    for k in range(45):
        set_inputs(stream, new_stream, k * T_S)
        stream.step(k * T_S, T_S)
    stream.step(0.045, 0.4 * T_S)
    for value, sample in ((math.nan, 46), (-math.inf, 46), (1e30, 46)):
        set_inputs(stream, new_stream, 0.046)
        stream.set(name, value)
        before = stream.save()
        with pytest.raises(RefusedStreamError, match=rf"{name} must be .* at sample {sample}"):
            stream.step(0.0454, 8 * T_S)
        assert stream.save() == before


@every
@pytest.mark.parametrize(
    ("start", "message"),
    [(1e13, "small enough to count samples of T_s = 0.001 s from, got 1e+13 s"), (math.inf, "time must be finite")],
)
def test_a_start_time_too_large_to_count_from(new_stream: StreamMaker, start: float, message: str) -> None:
    with pytest.raises((RefusedStreamError, FMICallException)) as refused:
        initialise(new_stream(), new_stream, start)
    if isinstance(refused.value, RefusedStreamError):
        assert message in str(refused.value)
    else:  # by fmi2SetupExperiment already
        assert not math.isfinite(start)


fmus = pytest.mark.parametrize(
    "new_stream",
    [case for case in cases((*LOOK_AHEADS, TRAJECTORY, DRIVE, STAGE)) if "FMU" in str(case.id)],
    indirect=True,
)


@fmus
def test_a_step_begins_before_the_stop_time(new_stream: StreamMaker) -> None:
    stream = new_stream()
    stream.initialise({}, stop=0.0305)
    t = 0.0
    while t < 0.0304:
        stream.step(t, 4e-3)  # the last one ends beyond the stop time
        t += 4e-3
    with pytest.raises(
        RefusedStreamError, match=r"a step must begin before the stop time 0.0305 s, got one from 0.032"
    ):
        stream.step(t, 4e-3)


@fmus
def test_the_stop_time_is_reached_in_rounded_sums(new_stream: StreamMaker) -> None:
    stream = new_stream()
    stream.initialise({}, stop=0.1)
    t = 0.0
    for _ in range(100):
        stream.step(t, T_S)
        t += T_S
    assert t != 0.1
    with pytest.raises(RefusedStreamError, match="before the stop time"):
        stream.step(t, T_S)


def run_for(stream: Stream, inputs: Callable[[int], None], n: int) -> None:
    for k in range(n):
        inputs(k)
        stream.step(k * T_S, T_S)


@pytest.mark.parametrize("new_stream", cases((PREDICTOR,)), indirect=True)
def test_many_windows_in_one_step(new_stream: StreamMaker) -> None:
    # One step of 2 s is 100 windows, each solved in turn.
    long, single = new_stream(), new_stream()
    for each in (long, single):
        initialise(each, new_stream, 0.0)
        run_for(each, lambda k, each=each: set_inputs(each, new_stream, k * T_S), 200)  # type: ignore[misc]
        set_inputs(each, new_stream, 0.2)
    long.step(0.2, 2.0)
    for k in range(2000):
        single.step(0.2 + k * T_S, T_S)
    assert long.outputs() == single.outputs()
