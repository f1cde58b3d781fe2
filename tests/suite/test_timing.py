"""The timing rule, on every implementation: any communication step gives what steps of ``T_s`` give.

Truth is the rule itself in exact fractions: where the instants are, and which step's inputs each of them latches. The
run in steps of ``T_s`` that gets the inputs so latched must show the same outputs bit for bit.
"""

import math
from bisect import bisect_right
from fractions import Fraction
from itertools import accumulate, pairwise

import numpy as np
import pytest
from driving import T_S, position, set_inputs, steps
from stream import CANNOT, COMPENSATOR, LOOK_AHEADS, PLANTS, PREDICTOR, TRAJECTORY, Array, RefusedStreamError
from streams import StreamMaker, on_adapters, on_all

from hybridsep.base.clock import SampleClock

N_SAMPLES = 160

Clock = list[Fraction]

every = on_all((*LOOK_AHEADS, TRAJECTORY))


def steps_of(pattern: str) -> list[Fraction]:
    """Return step sizes in samples until :data:`N_SAMPLES` are reached."""
    if pattern == "mixture":
        rng = np.random.default_rng(8)
        # Of a prime: no instant lies on the edge of a tolerance.
        sizes = [Fraction(int(rng.integers(1500, 50_000)), 9973) for _ in range(4 * N_SAMPLES)]
    else:
        sizes = [Fraction(pattern)] * math.ceil(N_SAMPLES / Fraction(pattern))
    return sizes[: next(i for i, end in enumerate(accumulate(sizes), start=1) if end >= N_SAMPLES)]


def in_steps(new_stream: StreamMaker, sizes: list[Fraction], start: float) -> tuple[Clock, list[list[float]]]:
    """Return the communication points, in samples, and the outputs at each; inputs are read at the step's start."""
    stream = new_stream.begun(start)
    points, outputs = [Fraction(0)], [stream.outputs()]
    for size in sizes:
        # The importer's time: an exact sum, rounded once.
        set_inputs(stream, float(points[-1]) * T_S)
        stream.step(start + float(points[-1]) * T_S, float(size) * T_S)
        points.append(points[-1] + size)
        outputs.append(stream.outputs())
    return points, outputs


def instants_of(points: Clock) -> Clock:
    """Return the instants of a run, in samples: ``T_s`` apart, but at a communication point within the tolerance."""
    instants = [Fraction(0)]
    for before, point in pairwise(points):
        tolerance = min(Fraction(1, 20), (point - before) / 2)
        last = instants[-1]
        instants += [last + i for i in range(1, math.floor(point + tolerance - last) + 1)]
        if len(instants) > 1 and instants[-1] > before and abs(instants[-1] - point) <= tolerance:
            instants[-1] = point
    return instants


def in_samples(new_stream: StreamMaker, points: Clock, start: float) -> list[list[float]]:
    """Return the outputs at the points in steps of ``T_s``, with the inputs that the other run's instants latch."""
    stream = new_stream.begun(start)
    instants = instants_of(points)
    outputs = [stream.outputs()]
    for k, instant in enumerate(instants[:-1]):
        step = bisect_right(points, instant) - 1  # an instant at a communication point belongs to the step after it
        set_inputs(stream, float(points[step]) * T_S)
        stream.step(start + k * T_S, T_S)
        outputs.append(stream.outputs())
    return [outputs[bisect_right(instants, point) - 1] for point in points]


@pytest.mark.slow
@every
@pytest.mark.parametrize(
    ("pattern", "start"), [*((pattern, 0.0) for pattern in ("0.04", "0.96", "3.7", "230")), ("mixture", 1e9)]
)
def test_outputs_are_those_of_the_last_instant(new_stream: StreamMaker, pattern: str, start: float) -> None:
    points, outputs = in_steps(new_stream, steps_of(pattern), start)
    expected = in_samples(new_stream, points, start)
    for point, shown, truth in zip(points, outputs, expected, strict=True):
        assert shown == truth, f"{float(point)} samples"


THIRD = 1 / 3000  # s


@pytest.mark.parametrize(
    ("times", "warned"),
    [
        (np.arange(301) * (round(THIRD * 1e9) * 1e-9), 0),
        ((99.0 + np.arange(301) * THIRD).astype(np.float32).astype(np.float64), 1),
        (np.cumsum(np.full(301, THIRD)), 0),
    ],
    ids=["whole nanoseconds", "single precision", "sum of steps"],
)
@on_adapters((PREDICTOR, COMPENSATOR))
def test_figures_with_an_importers_times_are_of_exact_steps(new_stream: StreamMaker, times: Array, warned: int) -> None:
    """Every sample arrives once: the same outputs to the last bit; rounding of single precision is said once."""
    runs = []
    for exact in (True, False):
        stream = new_stream.begun(times[0], T_s=THIRD)
        outputs = []
        for k, (t, h) in enumerate(zip(times[:-1], np.diff(times), strict=True)):
            set_inputs(stream, k * T_S)
            stream.step(*((times[0] + k * THIRD, THIRD) if exact else (float(t), float(h))))
            outputs.append(stream.outputs())
        runs.append(outputs)
    assert runs[0] == runs[1]
    warnings = stream.warnings()
    if (new_stream.implementation, "warnings") in CANNOT:
        return
    assert (min(len(warnings), 1) if (new_stream.implementation, "one warning") in CANNOT else len(warnings)) == warned
    assert all("a sampling instant, which is taken there" in warning for warning in warnings)


@on_all(LOOK_AHEADS, needs="warnings")
def test_each_kind_of_warning_is_given_once(new_stream: StreamMaker) -> None:
    stream = new_stream.begun()
    now = 0.0
    for h in (1.03e-3, 0.98e-3, 1.02e-3, 8e-3, 8e-3, 1.02e-3):
        stream.step(now, h)
        now += h
    warnings = stream.warnings()
    assert "point 0.00103 s is 0.03 samples of T_s = 0.001 s behind a sampling instant, which is taken" in warnings[0]
    if (new_stream.implementation, "one warning") not in CANNOT:
        assert len(warnings) == 2
        assert "the step from 0.00303 s by 0.008 s contains sampling instants of T_s = 0.001 s" in warnings[1]
        assert "x_meas is read up to 0.007 s late" in warnings[1]
    else:
        assert "is 0.02 samples of T_s = 0.001 s before a sampling instant" in warnings[1]


@on_all((*LOOK_AHEADS,), needs="warnings")
@pytest.mark.parametrize("delay", [-1, 0, 1])
def test_a_measurement_that_is_to_come_early_is_said_once(new_stream: StreamMaker, delay: int) -> None:
    """No importer says in which order it steps, and the figures look right: only who set it knows."""
    stream = new_stream()
    stream.initialise({"averaging": True, "measurement_delay": delay})
    for k in range(3):
        stream.step(k * T_S, T_S)
    warnings = stream.warnings()
    assert len(warnings) == (delay < 0)
    assert all("measurement_delay = -1 holds x_meas for a sample" in warning for warning in warnings)


@on_all((*LOOK_AHEADS, TRAJECTORY))
def test_a_restored_state_has_the_grid_that_it_was_saved_with(new_stream: StreamMaker) -> None:
    stream = new_stream.begun()
    steps(stream, 0, 3)
    t, tails = 3 * T_S, []
    for _ in range(60):  # the grid moves by 2.4 samples
        set_inputs(stream, t)
        stream.step(t, 1.04 * T_S)
        t += 1.04 * T_S
    set_inputs(stream, t)
    stream.step(t, 0.4 * T_S)
    blob = stream.save()
    for _ in range(2):
        stream.restore(blob)
        tail, now = [], t + 0.4 * T_S
        for _ in range(90):
            set_inputs(stream, now)
            stream.step(now, 0.4 * T_S)
            tail.append(stream.outputs())
            now += 0.4 * T_S
        tails.append(tail)
    assert tails[0] == tails[1]


@pytest.mark.slow
@on_adapters((PREDICTOR, TRAJECTORY))
def test_a_time_that_accumulates_rounding_is_no_error(new_stream: StreamMaker) -> None:
    # At 1e10 s the sum of t += T_s drifts by half a sample in a thousand steps.
    stream, exact = new_stream.begun(1e10), new_stream.begun(1e10)
    t = 1e10
    for k in range(1200):
        for each, now in ((stream, t), (exact, 1e10 + k * T_S)):
            if k % 7 == 0:
                set_inputs(each, k * T_S)
            each.step(now, T_S)
        t += T_S
    assert abs(t - (1e10 + 1200 * T_S)) > 0.5 * T_S
    assert stream.outputs() == exact.outputs()


@on_all(LOOK_AHEADS)
def test_inputs_are_read_at_instants_only(new_stream: StreamMaker) -> None:
    stream, whole = new_stream.begun(2.5), new_stream.begun(2.5)
    for k in range(130):
        for part in range(4):
            if part == 0:
                set_inputs(stream, k * T_S)
            else:
                stream.set("x_d_ahead", math.nan)
                stream.set("x_meas", math.inf)
            before = stream.outputs()
            stream.step(2.5 + (k + part / 4) * T_S, T_S / 4)
            if part < 3:
                assert stream.outputs() == before
        set_inputs(whole, k * T_S)
        whole.step(2.5 + k * T_S, T_S)
        assert stream.outputs() == whole.outputs()
    assert stream.warnings() == []


@on_all(LOOK_AHEADS)
def test_a_ramp_with_derivatives_is_that_of_single_samples(new_stream: StreamMaker) -> None:
    if (new_stream.implementation, "slopes") in CANNOT:
        with pytest.raises(RefusedStreamError):
            new_stream().set_slope("x_d_ahead", 1.0)
        return
    ramp, slope = (0.002, 0.05), (0.04, 0.035)  # m, m/s of x_d_ahead and x_meas
    long, single = new_stream.begun(), new_stream.begun()
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


@pytest.mark.slow
@on_all(PLANTS)
@pytest.mark.parametrize("step", ["0.3", "2", "12.2", "37"])
def test_plants_move_the_same_in_any_steps(new_stream: StreamMaker, step: str) -> None:
    # The command changes where both runs have a communication point.
    size = Fraction(step)
    hold = size * size.denominator // math.gcd(size.numerator, 1)
    runs = []
    for h in (Fraction(1), size):
        stream = new_stream()
        stream.initialise({})
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


@pytest.mark.parametrize("step", [333_333e-9, float(np.float32(THIRD)), 0.1 + THIRD - 0.1])
def test_rounded_steps_neither_lose_nor_double_a_sample(step: float) -> None:
    """Whole nanoseconds, single precision and differences of times over 10⁶ samples, in steps of ten."""
    clock = SampleClock.begin(0.0, THIRD)
    for _ in range(100_000):
        after = clock.stepped(clock.end, 10 * step)
        assert (after.n_samples, after.n_latched, after.first) == (10, 10, 0.0)
        clock = after.after
    assert (clock.k, clock.latched) == (1_000_000, False)


@pytest.mark.parametrize("T_s", [1e-3, 5e-4, 1.25e-4])
def test_times_in_single_precision_up_to_100_s(T_s: float) -> None:
    for begin in (0.0, 10.0, 99.0):
        times = (begin + np.arange(3000) * T_s).astype(np.float32).astype(float)
        clock = SampleClock.begin(times[0], T_s)
        for t, h in zip(times[:-1].tolist(), np.diff(times).tolist(), strict=True):
            after = clock.stepped(t, h)
            assert (after.n_samples, after.n_latched, after.first) == (1, 1, 0.0)
            clock = after.after
