"""What plans leave with several look-aheads, which ``fit`` prints with the drive's limits."""

from dataclasses import replace

import numpy as np
import pytest
from identification_cases import T_S

from hybridsep import ModalModel, Mode, SepCompensator, rest_to_rest
from hybridsep.base.metrics import rms
from hybridsep.base.settings import Limits
from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.fitting.expected import Trial
from hybridsep.fitting.replay import Recording
from hybridsep.fitting.stretch import Ahead, LookAheads, Stretch
from hybridsep.identify.model import machine_of
from hybridsep.logs.units import shown_in
from hybridsep.machines.machine import Machine
from hybridsep.plants.stage_drive import StageDrive

SERVO = ModalModel([Mode(6.0, 0.8, (12 * np.pi) ** 2)])  # it lags by 42 ms
MOVES = rest_to_rest([0.0, 0.01, -0.008], Limits(0.1, 1.0, 50.0), T_S, start_times=[0.3, 0.7], duration=1.2)


def axis(model: ModalModel, preview: int, **changed: float) -> Machine:
    limits = {"velocity": 0.3, "acceleration": 3.0, "jerk": 500.0, "change_max": 0.02, **changed}
    return machine_of(
        *(model, "zoh", T_S, "axis", "Axis"),
        unit="m",
        sources=["drawn"],
        predictor={"Np": 50, "p": 10},
        compensator={"preview": preview},
        drive_limits=limits,
    )


def looked(machine: Machine, recording: Recording) -> LookAheads:
    with Trial.of(machine) as trial:
        stretch = Stretch.of(trial, [recording])
        assert stretch is not None
        return stretch.look_aheads()


@pytest.fixture(scope="module")
def found() -> LookAheads:
    discrete = SERVO.discretise(T_S)
    recording = Recording(MOVES, discrete.forced_response(discrete.rest(), MOVES)[0], 500)
    return looked(axis(SERVO, 50), recording)


def test_a_look_ahead_leaves_what_a_loop_on_the_model_does(found: LookAheads) -> None:
    assert [one.preview for one in found.tried] == sorted({25, 50, 100, 200, 400, SERVO.needed_preview(T_S)})
    assert found.duration == pytest.approx(len(MOVES) * T_S)
    machine = axis(SERVO, 100)
    settings = replace(machine.compensator_settings, compensate="physics")
    compensator = SepCompensator(machine.new_predictor(machine.compensator_predictor), settings)
    run = cosimulate(compensator, StageDrive(SERVO, f=0.0, kappa=0.0, T_s=T_S), MOVES)
    left = {one.preview: one.left for one in found.tried}
    # of 0.2 % that plans beyond the preview leave; windows begin at other samples of the moves in the loop
    assert left[100] == pytest.approx(rms(run.error), rel=0.1)
    assert left[100] < 0.01 * found.off
    assert left[25] > 0.2 * found.off
    assert left[400] < 0.02 * found.off


def test_a_look_ahead_that_is_too_short_is_said_with_the_gain_of_a_longer_one(found: LookAheads) -> None:
    _, head, rows = found.figures(shown_in("mm"))
    assert [len(row) for row in rows] == [len(head)] * len(rows)
    binds = {row[0]: row[3] for row in rows}
    assert binds["50, chosen"].startswith("look-ahead, ")
    assert "j_max" in binds["50, chosen"]
    assert "look-ahead" not in binds["400"]
    here, there = found.tried[1], found.longer(found.tried[1])
    assert there is not None
    assert there.left < 0.1 * here.left
    (line,) = found.lines()
    assert f"plans leave {here.left / found.off:.2g} × the error without compensation" in line
    assert f"{there.left / found.off:.2g} ×. If the controller has it: --look-ahead {there.preview}ms." in line
    assert replace(found, chosen=there.preview).lines() == []


def test_settings_that_bind_are_told_of_commands_of_a_few_samples() -> None:
    """A galvanometer of 1.5 kHz at 20 kHz: no limit binds, and what is left is the plans' own, the more the longer."""
    T_s, model = T_S / 20, ModalModel([Mode(1500.0, 0.7, (3000 * np.pi) ** 2)])
    moves = rest_to_rest([0.0, 1e-4, -1e-4], Limits(0.5, 5e3, 2e8), T_s, start_times=[0.005, 0.0075], duration=0.02)
    machine = replace(axis(model, 200, velocity=10.0, acceleration=1e6, jerk=1e9), T_s=T_s)
    discrete = model.discretise(T_s)
    found = looked(machine, Recording(moves, discrete.forced_response(discrete.rest(), moves)[0], 100))
    assert {row[0]: row[3] for row in found.figures(shown_in("m"))[2]}["10, chosen"] == "jerk_weight"


@pytest.mark.parametrize(
    ("left", "chosen", "shortest"),
    [
        ({50: 0.0, 200: 0.005, 400: 0.008, 900: 0.001}, 900, 200),  # below a hundredth all are alike
        ({200: 0.2, 400: 0.1, 900: 0.1}, 900, 400),
        ({200: 0.102, 400: 0.1, 900: 0.1}, 900, 200),
        ({200: 0.1, 390: 0.1}, 390, 390),  # more than half of it
        ({200: 0.15, 400: 0.05, 960: 0.15}, 960, 400),  # as none of them is to be too short
    ],
)
def test_the_shortest_look_ahead_that_leaves_as_little(left: dict[int, float], chosen: int, shortest: int) -> None:
    tried = tuple(Ahead(preview, share, {}) for preview, share in left.items())
    found = LookAheads(tried, chosen, 1.0, 1.0, T_S)
    assert found.shortest == shortest
    assert replace(found, chosen=shortest).lines() == []


def test_a_shorter_look_ahead_that_leaves_as_little_is_advised_and_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridsep.fitting.stretch._AHEAD", (0.1, 0.2, 0.4))
    slow = ModalModel([Mode(2.0, 0.9, (4 * np.pi) ** 2)])
    moves = rest_to_rest([0.0, 0.02, -0.01], Limits(0.05, 0.3, 6.0), T_S, start_times=[0.3, 2.0], duration=4.0)
    discrete, needed = slow.discretise(T_S), slow.needed_preview(T_S)
    recording = Recording(moves, discrete.forced_response(discrete.rest(), moves)[0], 500)
    long, short = (looked(axis(slow, preview), recording) for preview in (needed, 200))
    assert needed > 600
    (line,) = long.lines()
    assert "--look-ahead 200ms" in line
    assert short.lines() == []
    assert all(one.left < 0.01 * found.off for found in (long, short) for one in found.tried if one.preview >= 200)


def test_plans_go_on_where_the_limits_are_slow_to_take_the_error_back() -> None:
    moves = rest_to_rest([0.0, 0.05], Limits(0.2, 1.0, 3.0), T_S, start_times=[0.3], duration=1.6)
    machine = axis(SERVO, SERVO.needed_preview(T_S), acceleration=4.0, jerk=6.0, change_max=0.011)
    stretch = Stretch.of(Trial(machine), [Recording(moves, moves, 500)])
    assert stretch is not None
    left = stretch.expected(machine.compensator_settings, machine.compensator_predictor.Np).compensated
    assert rms(left) < 0.05 * stretch.off  # 0.7 in plans that end with the preview


def test_slow_axes_are_tried_with_longer_ones() -> None:
    crane, T_s = ModalModel([Mode(0.25, 0.3, (0.5 * np.pi) ** 2)]), 10 * T_S
    found = looked(replace(axis(crane, 50), T_s=T_s), Recording(MOVES, np.zeros(len(MOVES)), 500))
    assert [one.preview for one in found.tried][-6:] == [20, 40, 50, 80, 160, crane.needed_preview(T_s)]


def test_the_most_demanding_stretch_is_taken_wherever_it_is() -> None:
    """At 250 Hz, where the shortest plans have windows of three samples; the quick move comes after a slow one."""
    T_s = 4 * T_S
    x_d = rest_to_rest([0.0, 1e-4, 0.01], Limits(0.1, 1.0, 50.0), T_s, start_times=[0.1, 8.0], duration=13.0)
    discrete = SERVO.discretise(T_s)
    x = discrete.forced_response(discrete.rest(), x_d)[0]
    found = looked(replace(axis(SERVO, 50), T_s=T_s), Recording(x_d, x, 500))
    assert [one.preview for one in found.tried][:3] == [12, 25, 50]
    n = round(found.duration / T_s)
    assert n < len(x_d) // 2
    assert found.off == pytest.approx(max(rms((x_d - x)[i : i + n]) for i in range(len(x_d) - n)), rel=1e-3)


@pytest.mark.parametrize(
    ("x_d", "most"),
    [(0.02 * T_S * np.arange(6000.0), 1e-4), (0.005 * np.sin(2 * np.pi * 1.7 * T_S * np.arange(6000.0)), 0.1)],
    ids=["feed", "sine"],  # whose plans wait where it turns
)
def test_a_stretch_that_is_cut_out_of_motion_is_led_in_and_out_at_rest(x_d: Array, most: float) -> None:
    """A command that never rests: the largest error was that of its step to rest, where the stretch ends."""
    with Trial.of(axis(SERVO, SERVO.needed_preview(T_S))) as trial:
        stretch = Stretch.of(trial, [Recording(x_d, x_d, 3000)])
        assert stretch is not None
        found = stretch.look_aheads()
    speed = np.abs(np.diff(stretch.x_d)) / T_S
    assert max(speed[0], speed[-1]) < 1e-3 * speed.max()
    assert found.tried[-1].left < most * found.off
    assert found.lines() == []


def test_nothing_is_said_without_motion_or_of_an_error_that_the_model_does_not_know() -> None:
    fast = ModalModel([Mode(400.0, 0.7, (800 * np.pi) ** 2)])
    assert Stretch.of(Trial(axis(fast, 100)), [Recording(MOVES, MOVES + 0.01 * np.sign(MOVES), 500)]) is None
    assert Stretch.of(Trial(axis(SERVO, 100)), [Recording(np.zeros(900), np.zeros(900), 500)]) is None
