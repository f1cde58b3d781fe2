"""Plant of a fit, commands to try with, and limits that are estimated: against drives whose numbers are known."""

from dataclasses import replace

import numpy as np
import pytest

from hybridsep import Limits, ModalModel, Mode, rest_to_rest, simulate
from hybridsep.base.metrics import peak_derivatives
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.fitting.identified_plant import commands_to_try, identified_plant
from hybridsep.fitting.limits import estimated_limits, far_words, held_for, largest_motion, rounding_of, usual_error
from hybridsep.fitting.replay import Recording
from hybridsep.logs.units import shown_in
from hybridsep.plants.stage_drive import StageDrive

T_S = 1e-3
MODE = Mode(35.0, 0.4, (70 * np.pi) ** 2)
LIMITS = Limits(velocity=0.1, acceleration=5.0, jerk=500.0)
SETTINGS = PredictorSettings(T_s=T_S)


def command() -> Array:
    targets = np.concatenate(([0.0], np.random.default_rng(0).uniform(-0.02, 0.02, 9)))
    return rest_to_rest(targets, LIMITS, T_S, dwell=0.05)


def recorded(plant: StageDrive) -> Recording:
    x_d = command()
    x = simulate(plant, x_d, T_S) + 5e-7 * np.random.default_rng(1).standard_normal(len(x_d))
    return Recording(x_d, x, len(x) // 2)


def test_friction_and_stiffness_are_found_and_the_plant_follows_the_drive() -> None:
    recording = recorded(StageDrive(ModalModel([MODE]), 8e-6, 0.05, T_S, v_friction=4e-3))
    biased = ModalModel([Mode(34.0, 0.43, 0.99 * (68 * np.pi) ** 2)])  # as identified where friction is not known
    found = identified_plant(biased, SETTINGS, [recording], [recording])
    entries = found.entries
    assert entries["f"] == pytest.approx(8e-6, rel=0.03)
    assert entries["kappa"] == pytest.approx(0.05, rel=0.1)
    assert entries["v_friction"] == pytest.approx(4e-3, rel=0.3)
    assert entries["noise_std"] == pytest.approx(5e-7, rel=0.1)
    assert entries["mode"][0]["f_n"] == pytest.approx(35.0, rel=0.01)
    assert found.rms < 1.1 * 5e-7
    assert found.rms_pb > 5 * found.rms
    assert "refitted with the friction and stiffness of the log" in found.words(shown_in("m"))
    assert "no measurement" in found.words(shown_in("m"))


def test_a_linear_drive_keeps_its_model_alone() -> None:
    model = ModalModel([MODE])
    recording = recorded(StageDrive(model, T_s=T_S))
    found = identified_plant(model, SETTINGS, [recording], [recording])
    assert set(found.entries) == {"noise_std"}
    assert found.rms == found.rms_pb == pytest.approx(5e-7, rel=0.05)


def test_a_model_that_is_too_fast_for_a_plant_has_none() -> None:
    recording = recorded(StageDrive(ModalModel([MODE])))
    found = identified_plant(ModalModel([Mode(5e4, 0.5, 1.0)]), SETTINGS, [recording], [recording])
    assert found.entries == {}
    assert "must be at most 100000 1/s in a plant" in found.reason


def test_commands_begin_where_the_log_began_and_end_at_rest() -> None:
    """Stiffness of the plant, and what is learned of the position, count from there."""
    x_d = command()[:-20]  # it ends in motion
    rest = np.full(30_000, x_d[0])
    tried = commands_to_try([Recording(one := np.concatenate((rest, x_d)), one, len(one) // 2)])
    assert tried[0] == x_d[0]
    assert np.ptp(tried) == pytest.approx(np.ptp(x_d), rel=0.3)
    assert np.abs(np.diff(tried[-2:])[0]) < 1e-3 * np.abs(np.diff(x_d)).max()
    assert len(commands_to_try([Recording(rest, rest, 9)])) == 20_000


@pytest.mark.parametrize("held", [1, 4])
@pytest.mark.parametrize("rounded", [0.0, 1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("rest", [0.2, 20.0])
def test_motion_is_estimated_without_what_holds_or_rounds_a_command(held: int, rounded: float, rest: float) -> None:
    """At 4 kHz, where 1 µm is 16 m/s² and 64 000 m/s³ from sample to sample; mostly at rest, too."""
    T_s, limits = 2.5e-4, Limits(0.5, 10.0, 700.0)
    x_d = rest_to_rest([0.0, 0.09, 0.03, 0.15], limits, T_s, start_times=[rest, rest + 0.5, rest + 1.0])
    x_d = x_d[np.arange(len(x_d)) // held * held]
    assert held_for(x_d) == held
    x_d = rounded * np.round(x_d / rounded) if rounded else x_d
    peaks, _ = largest_motion([Recording(x_d, x_d, 9)], T_s)
    assert peaks == pytest.approx([0.5, 10.0, 700.0], rel=0.2)


def test_steps_are_estimated_as_they_are() -> None:
    """A step of the velocity between samples of one speed is no rounding, a step of the position no hold."""
    k = np.arange(3000.0)
    for x_d in (1e-3 * np.minimum(k % 300, 300 - k % 300), 0.01 * np.floor(k / 500 % 2)):
        peaks, _ = largest_motion([Recording(x_d, x_d, 9)], T_S)
        assert peaks == pytest.approx(peak_derivatives(x_d, T_S))


@pytest.mark.parametrize(("rounded", "held"), [(0.0, 1), (1e-6, 1), (0.0, 4)])
def test_commands_that_begin_in_motion_have_a_lead_in_from_rest(rounded: float, held: int) -> None:
    """A compensator tripped at the first samples of commands that a plant at rest was to follow at once."""
    x_d = command()
    most = np.abs(np.diff(x_d, 2)).max() if held > 1 else 0.0
    x_d = x_d[np.arange(len(x_d)) // held * held]
    x_d = x_d[int(np.argmax(np.abs(np.diff(x_d)))) :]
    if rounded:
        x_d = rounded * np.round(x_d / rounded)
    tried = commands_to_try([Recording(x_d, x_d, len(x_d) // 2)])
    n = int(np.flatnonzero(tried == x_d[0])[0])
    np.testing.assert_array_equal(tried[n:], x_d[: len(tried) - n])
    steps, most = np.abs(np.diff(tried)), most or np.abs(np.diff(x_d, 2)).max()
    assert steps[0] <= 1.01 * most
    assert np.abs(np.diff(tried, 2))[: n - 2].max() <= (0.51 if held == 1 else 0.7) * most
    assert n < 500


@pytest.mark.parametrize(("offset", "counts"), [(0.05, False), (5e-4, True)])
def test_zeros_that_are_apart_are_no_servo_error(offset: float, counts: bool) -> None:
    """A compensator was allowed to move an axis by 0.1 m, and did."""
    one = recorded(StageDrive(ModalModel([MODE])))
    one.x[5] = one.x_d[5] - offset  # a sensor that is not ready does not decide it
    (_, error), (_, found) = (largest_motion([replace(one, x=one.x + by)], T_S) for by in (0.0, offset))
    assert found == pytest.approx(error + offset if counts else error, rel=0.3)


def test_limits_are_estimated_from_the_motion() -> None:
    recording = recorded(StageDrive(ModalModel([MODE])))
    found = estimated_limits([recording], T_S)
    assert found["velocity"] == pytest.approx(0.125, rel=0.01)
    assert found["acceleration"] == pytest.approx(10.0, rel=0.01)
    assert found["jerk"] == pytest.approx(2500.0, rel=0.02)
    assert found["change_max"] == pytest.approx(2 * np.abs(recording.x_d - recording.x).max(), rel=1e-3)
    assert found["estimated"] is True
    assert estimated_limits([replace(recording, x_d=np.zeros(9), x=np.zeros(9))], T_S) == {}


@pytest.mark.parametrize(("runaway", "told"), [(0.0, ""), (0.08, "80.48 mm, is 167 times")])
def test_limits_leave_out_errors_far_above_the_usual(runaway: float, told: str) -> None:
    one = recorded(StageDrive(ModalModel([MODE])))
    largest, x = np.abs(one.x_d - one.x).max(), one.x + runaway * (np.arange(len(one.x)) // 100 == 9)
    usual = usual_error([log := replace(one, x=x), replace(one, x=np.full(len(x), np.nan))], T_S)
    assert usual == pytest.approx(largest, rel=0.2)
    found, error = estimated_limits([log], T_S, usual), largest + runaway
    limits = found["change_max"], found["following_error_max"]
    assert limits == pytest.approx((2.0 * error, 1.3 * min(error, 3.0 * usual)), rel=1e-2)
    assert told in far_words(error, usual, shown_in("mm"))


def test_the_error_of_the_only_fast_move_is_usual() -> None:
    slow = rest_to_rest([0.0, 0.01] * 15, Limits(0.02, 1.0, 100.0), T_S)
    x_d = np.concatenate((slow, rest_to_rest([slow[-1], 0.06, 0.0], Limits(0.2, 10.0, 1000.0), T_S), slow))
    short = rest_to_rest([0.0, 1e-3] * 120, Limits(0.02, 10.0, 1000.0), T_S)  # accelerate as the fast move does
    for one in (x_d, np.concatenate((short, x_d[len(slow) : -len(slow)] - slow[-1] + short[-1]))):
        error = 0.02 * np.gradient(one, T_S)
        assert usual_error([Recording(one, one - error, 9)], T_S) > 0.9 * np.abs(error).max()
    assert usual_error([Recording(x_d[-99:], x_d[-99:], 9)] * 2, T_S) == np.inf  # too few pieces move


@pytest.mark.parametrize("rounding", [0.0, 1e-7])
def test_rounding_is_seen(rounding: float) -> None:
    k = np.arange(12_000)
    smooth = 0.03 * np.sin(k / 400.0) * np.cos(k / 2900.0)
    told = np.round(smooth / rounding) * rounding if rounding else smooth
    assert rounding_of(told) == pytest.approx(rounding, rel=0.2, abs=1e-10)
