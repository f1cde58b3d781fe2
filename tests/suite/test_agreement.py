"""The implementations against the library, output by output and sample by sample, in closed loops of the library.

1e-12 m for a predictor with averaging, 1e-11 m for the paper's and for a compensator with its usual limits, 1e-9 m for
all other parameters of a compensator, whose loop amplifies what is rounded apart.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from driving import SHORT, T_S, TIGHT, Loop, closed_loop, named, replay
from library_stream import PlantStream
from staircase_data import commanded
from stream import (
    COMPENSATOR,
    LOOK_AHEADS,
    OUTPUTS,
    PLANTS,
    PREDICTOR,
    STAGE_COMPENSATOR,
    STAGE_PREDICTOR,
    TRAJECTORY,
    Value,
    kind_of,
)
from streams import StreamMaker, on_all

from hybridsep.plants.trajectory import staircase

PAPER: dict[str, Any] = {"averaging": False, "Np": 100, "p": 50, "q": 3, "lambda": 1e-12, "t_init": 0.3}
BEST = PAPER | {"Np": 50, "q": 40, "lambda": 1e-8, "t_init": 0.1}
"""The paper's model, and the settings of a compensator that are best for it."""


LONGER: dict[str, Value] = {"Np": 20, "p": 10, "preview": 60, "horizon": 200}
"""Plans longer than the preview."""


def assert_agreement(new_stream: StreamMaker, n: int, values: dict[str, Value], tolerance: float, **how: Any) -> Loop:
    """Replay a closed loop of the library, whose outputs must be the same, and return it."""
    loop, stream = closed_loop(new_stream.model, n, values, **how), new_stream()
    stream.initialise(loop.values, start=12.5)
    shown = replay(stream, loop, start_time=12.5)
    for name, output, expected in zip(OUTPUTS[kind_of(new_stream.model)], shown.T, loop.outputs.T, strict=True):
        whole = name in ("batch", "n_rejected", "hybrid_active", "sep_state")
        np.testing.assert_allclose(output, expected, rtol=0, atol=0 if whole else tolerance, err_msg=name)
    return loop


@pytest.mark.slow
@on_all((PREDICTOR,), needs="agreement")
@pytest.mark.parametrize(("p", "q", "n", "start"), [(50, 3, 3000, 0.0), (100, 99, 1500, 0.1)])
def test_the_staircase_is_predicted_as_by_the_library(
    new_stream: StreamMaker, p: int, q: int, n: int, start: float
) -> None:
    loop = assert_agreement(new_stream, n, {"p": p, "q": q}, 1e-11, start=start)
    assert 5e-6 < loop.column(PREDICTOR, "rms_h")[-1] < 1.5e-5


@on_all((PREDICTOR,), needs="agreement")
def test_the_staircase_is_predicted_with_averaging_as_by_the_library(new_stream: StreamMaker) -> None:
    loop = assert_agreement(new_stream, 2550, {"averaging": True, "t_init": -1.0}, 1e-12)
    assert (loop.column(PREDICTOR, "hybrid_active")[100:] == 1.0).all()  # no warm-up
    assert loop.column(PREDICTOR, "rms_h")[-1] < 0.5 * loop.column(PREDICTOR, "rms_pb")[-1]


AVERAGING: dict[str, Value] = {"averaging": True}


@pytest.mark.slow
@on_all((STAGE_PREDICTOR,), needs="agreement")
@pytest.mark.parametrize(
    "values",
    [
        {"Np": 7, "p": 7, "q": 6},
        {"Np": 1, "p": 1, "q": 0},
        {"Np": 30, "p": 2, "q": 1, "t_init": 0.0},
        {"p": 10, "q": 2, "t_init": 0.2505, "lambda": 1e-9},
        {"p": 10, "input_hold": 1, "dead_time": 3},
        {"p": 10, "dead_time": 150, "t_init": 1e6},
        {"T_s": 2e-3, "p": 20, "t_init": -1.0},
        {"mode[1].zeta": 0.3, "mode[2].f_n": 70.0},
        AVERAGING,
        AVERAGING | {"Np": 7, "p": 7, "q": 6, "t_init": -1.0},
        AVERAGING | {"Np": 1, "p": 1, "q": 0},
        AVERAGING | {"Np": 30, "p": 1, "q": 0, "t_init": 0.2505},
        AVERAGING | {"p": 10, "input_hold": 1, "dead_time": 3},
        AVERAGING | {"p": 10, "dead_time": 150},
        AVERAGING | {"p": 20, "effect": 1e-4, "noise_std": 1e-6, "forgetting": 0.2},
        AVERAGING | {"p": 20, "q": 2, "lambda": 1e-30, "forgetting": 1e-3, "T_s": 2e-3},
        AVERAGING | {"p": 20, "period": 3e-3},
    ],
    ids=named,
)
def test_every_parameter_predicts_as_in_the_library(new_stream: StreamMaker, values: dict[str, Value]) -> None:
    if values.get("averaging"):
        assert_agreement(new_stream, 150 if values.get("Np") == 1 else 650, values, 1e-12, path="spiral")
    else:
        assert_agreement(new_stream, 700, values, 1e-11)


def faulty(k: int, x_meas: float, last: float) -> float:
    """Miss some samples, jump, stay, read 0 for a while, and shift in the end."""
    if k % 37 == 5 or 1450 <= k < 1460 or 75 <= k % 700 < 83:  # and where a solution begins
        return math.nan
    if k in (777, 1130, 1131):
        return x_meas + 1e-3 * (k - 1100)
    if 1030 <= k < 1080:
        return 0.0123
    if 2040 <= k < 2090:
        return 0.0
    return x_meas + (2e-4 if k > 2300 else 0.0)


@pytest.mark.slow
@on_all((PREDICTOR,), needs="agreement")
def test_faulty_measurements_are_judged_as_by_the_library(new_stream: StreamMaker) -> None:
    given: dict[str, Value] = {"averaging": True, "t_init": -1.0}
    loop = assert_agreement(new_stream, 2850, given, 1e-12, sensor=faulty)
    sound = closed_loop(new_stream.model, 2850, given)
    change = np.abs(loop.column(PREDICTOR, "x_h") - loop.column(PREDICTOR, "x_pb"))
    assert change.max() < 2 * np.abs(sound.x - sound.column(PREDICTOR, "x_pb")[:-1]).max()
    assert np.isfinite(loop.outputs).all()
    n_rejected = loop.column(PREDICTOR, "n_rejected")
    assert 150 < n_rejected[-1] < 500
    assert not closed_loop(new_stream.model, 2850, {}).column(PREDICTOR, "n_rejected").any()  # without averaging


@pytest.mark.slow
@on_all((COMPENSATOR,), needs="agreement")
def test_the_staircase_is_compensated_as_by_the_library(new_stream: StreamMaker) -> None:
    # The limits act in some windows.
    loop = assert_agreement(new_stream, 1300, PAPER, 1e-11)
    assert set(loop.column(COMPENSATOR, "sep_state")) == {1.0, 2.0}
    assert 4e-6 < loop.column(COMPENSATOR, "rms_e")[-1] < 1.5e-5


@pytest.mark.slow
@on_all((STAGE_COMPENSATOR,), needs="agreement")
def test_the_stage_is_compensated_as_by_the_library(new_stream: StreamMaker) -> None:
    for values in (BEST | TIGHT, TIGHT):
        assert_agreement(new_stream, 800, values, 1e-9)


@pytest.mark.slow
@on_all((COMPENSATOR,), needs="agreement")
def test_the_staircase_is_compensated_with_averaging_as_by_the_library(new_stream: StreamMaker) -> None:
    loop = assert_agreement(new_stream, 1600, {}, 1e-11, start=0.1)
    assert set(loop.column(COMPENSATOR, "sep_state")) == {1.0, 2.0}
    assert loop.column(COMPENSATOR, "rms_e")[-1] < 1.1e-5
    assert (loop.column(COMPENSATOR, "x_h_std") > 0.0).all()


@pytest.mark.slow
@on_all((COMPENSATOR,), needs="agreement")
@pytest.mark.parametrize(
    "values",
    [
        BEST | TIGHT,
        PAPER | TIGHT,  # nearly every plan is bounded
        PAPER | {"change_max": 2e-4, "t_init": -1.0},
        PAPER | {"no_reversal": 0, "t_init": 0.1},
        PAPER | {"compensate": 0},
        PAPER | {"compensate": 1, "spacing": 5},
        PAPER | {"spacing": 1, "preview": 130, "p": 7, "q": 0},
        PAPER | {"Np": 12, "p": 7, "q": 5, "spacing": 3, "preview": 77, "t_init": 0.05},
        PAPER | {"Np": 1, "p": 1, "q": 0, "spacing": 1, "preview": 60, "t_init": 0.05},
        PAPER | {"input_hold": 1, "dead_time": 3, "p": 10},
        PAPER | {"jerk_weight": 300.0, "lambda": 1e-6},
        TIGHT,
        {"compensate": 1, "spacing": 5},
        {"Np": 100, "p": 20, "t_init": 0.25},
        {"p": 10, "q": 40, "change_max": 2e-4, "jerk_weight": 30.0},
        {"p": 10, "input_hold": 1, "dead_time": 3},
        {"p": 10, "effect": 1e-4, "noise_std": 1e-6, "forgetting": 0.2, "lambda": 1e-10},
        {"Np": 16, "p": 5, "spacing": 16, "preview": 90, "no_reversal": 0},  # nothing of a plan is decided before
        {"Np": 2, "p": 1, "q": 0, "spacing": 1, "preview": 40},
        {"p": 10, "period": 3e-3},
        {"measurement_delay": 5, "p": 10, "input_hold": 1, "dead_time": 3, "t_init": 0.25},
        {"measurement_delay": 70, "p": 10, "q": 40, "period": 3e-3},  # later than a window
        {"measurement_delay": 250, "p": 10},  # and than a plan
        {"measurement_delay": 12, "Np": 12, "p": 7, "q": 2, "spacing": 3, "preview": 77},
        {"measurement_delay": 3, "Np": 16, "p": 5, "spacing": 16, "preview": 90, "no_reversal": 0},
        LONGER,
        LONGER | TIGHT,  # few plans have a stop
        LONGER | {"measurement_delay": 5, "compensate": 1},
        LONGER | PAPER | TIGHT | {"Np": 20, "p": 10},
    ],
    ids=named,
)
def test_every_parameter_compensates_as_in_the_library(new_stream: StreamMaker, values: dict[str, Value]) -> None:
    delay = int(values.get("measurement_delay", 0))
    n = 90 if values.get("Np") in (1, 2) else 500
    start = 0.1 if delay and "spacing" in values else 0.0
    tolerance = 1e-8 if values.get("Np") == 12 else 1e-9  # rounding grows from one of so short windows to the next
    assert_agreement(new_stream, n, values, tolerance, start=start, delay=delay)


@on_all((COMPENSATOR,), needs="agreement")
@pytest.mark.parametrize(
    "values", [{"compensate": 1, "spacing": 5}, LONGER | {"preview": 150}], ids=("physics turns", "longer recalls")
)
def test_the_spiral_is_compensated_as_by_the_library(new_stream: StreamMaker, values: dict[str, Value]) -> None:
    assert_agreement(new_stream, 500, values, 1e-11, path="spiral")


@on_all(LOOK_AHEADS)
def test_a_measurement_that_comes_a_sample_early_is_held(new_stream: StreamMaker) -> None:
    """As a sequential master carries it; the outputs are as with measurements in time, bit for bit."""
    values = SHORT[kind_of(new_stream.model)]
    loop = closed_loop(new_stream.model, 300, values, sensor=lambda k, x_meas, last: x_meas if k else last)
    early = replace(loop, x=np.append(loop.x[1:], loop.x[-1]))
    in_time, held = new_stream(), new_stream()
    in_time.initialise(loop.values)
    held.initialise({**loop.values, "measurement_delay": -1})
    np.testing.assert_array_equal(replay(held, early), replay(in_time, loop))


@pytest.mark.slow
@on_all((COMPENSATOR,), needs="agreement")
@pytest.mark.parametrize("delay", [0, 5])
def test_faulty_measurements_are_compensated_as_by_the_library(new_stream: StreamMaker, delay: int) -> None:
    values: dict[str, Value] = {"p": 20, "measurement_delay": delay}
    loop = assert_agreement(new_stream, 1500, values, 1e-9, sensor=faulty, delay=delay)
    assert np.isfinite(loop.outputs).all()
    assert 50 < loop.column(COMPENSATOR, "n_rejected")[-1] < 500


def growing(k: int, x_meas: float, last: float) -> float:
    return x_meas + (1e-6 * 1.1 ** (k - 250) if 250 <= k < 300 else 0.0)


@on_all((COMPENSATOR,), needs="agreement")
def test_an_unstable_recursion_never_plans(new_stream: StreamMaker) -> None:
    values = PAPER | {"Np": 50, "p": 2, "q": 0, "t_init": 0.0}
    loop = assert_agreement(new_stream, 700, values, 1e-9, size=0.0, sensor=growing)
    assert (loop.column(COMPENSATOR, "sep_state")[300:350] == 1.0).all()


@on_all(PLANTS, needs="agreement")
@pytest.mark.parametrize("h", [1e-3, 2.5e-3, 0.7e-4])
def test_plants_move_as_the_librarys_do(new_stream: StreamMaker, h: float) -> None:
    # 1e-12 m in position and measurement, 1e-10 m/s in velocity.
    library, stream = PlantStream(new_stream.model), new_stream()
    for each in (stream, library):
        each.initialise({"x_d": 0.1, "seed": 12345})
    rows: list[list[list[float]]] = [[], []]
    for k, command in enumerate((commanded()[:600] + 0.1).tolist()):
        for each, outputs in zip((stream, library), rows, strict=True):
            outputs.append(each.outputs())
            each.set("x_d", command)
            each.step(k * h, h)
    x, v, x_meas = (np.array(rows[0]) - np.array(rows[1])).T
    for difference, tolerance in ((x, 1e-12), (v, 1e-10), (x_meas, 1e-12)):
        assert np.max(np.abs(difference)) <= tolerance
    assert len({row[2] - row[0] for row in rows[0]}) == 600  # a new draw each communication step


@on_all((TRAJECTORY,))
@pytest.mark.parametrize("parts", [1, 2])
def test_a_trajectory_is_played_and_held_at_its_end(new_stream: StreamMaker, parts: int) -> None:
    stream, expected = new_stream(), staircase()
    stream.initialise({}, start=3.0)
    assert stream.outputs() == [expected[0]]
    for k in range(len(expected) + 5):
        for part in range(parts):
            assert stream.outputs() == [expected[min(k, len(expected) - 1)]]
            stream.step(3.0 + (k + part / parts) * T_S, T_S / parts)
