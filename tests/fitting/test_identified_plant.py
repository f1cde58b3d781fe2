"""Plant of a fit, commands to try with, and limits that are estimated: against drives whose numbers are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hybridsep import Limits, ModalModel, Mode, rest_to_rest, simulate
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.fitting.compensation import estimated_limits
from hybridsep.fitting.plant import commands_to_try, identified_plant, plant_words
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
    found = identified_plant(biased, SETTINGS, [recording])
    entries = found["entries"]
    assert entries["f"] == pytest.approx(8e-6, rel=0.03)
    assert entries["kappa"] == pytest.approx(0.05, rel=0.1)
    assert entries["v_friction"] == pytest.approx(4e-3, rel=0.3)
    assert entries["noise_std"] == pytest.approx(5e-7, rel=0.1)
    assert entries["mode"][0]["f_n"] == pytest.approx(35.0, rel=0.01)
    assert found["rms"] < 1.1 * 5e-7
    assert found["rms_pb"] > 5 * found["rms"]
    assert "refitted with the friction and stiffness of the log" in plant_words(found, shown_in("m"))
    assert "no measurement" in plant_words(found, shown_in("m"))


def test_a_linear_drive_keeps_its_model_alone() -> None:
    model = ModalModel([MODE])
    found = identified_plant(model, SETTINGS, [recorded(StageDrive(model, T_s=T_S))])
    assert set(found["entries"]) == {"noise_std"}
    assert found["rms"] == found["rms_pb"] == pytest.approx(5e-7, rel=0.05)


def test_a_model_that_is_too_fast_for_a_plant_has_none() -> None:
    found = identified_plant(ModalModel([Mode(5e4, 0.5, 1.0)]), SETTINGS, [recorded(StageDrive(ModalModel([MODE])))])
    assert found["entries"] == {}
    assert "must be at most 100000 1/s in a plant" in found["reason"]


def test_commands_go_from_rest_to_rest_and_move() -> None:
    x_d = command()
    recording = Recording(x_d, x_d, len(x_d) // 2 + 37)
    tried = commands_to_try([recording])
    assert len(tried) <= len(x_d) // 2
    assert np.ptp(tried) > 0.01
    assert max(abs(np.diff(tried[:2])[0]), abs(np.diff(tried[-2:])[0])) < 1e-3 * np.abs(np.diff(x_d)).max()
    still = np.concatenate((x_d, np.full(3 * len(x_d), x_d[-1])))  # all motion is in the training half
    assert np.ptp(commands_to_try([Recording(still, still, len(still) // 2)])) == np.ptp(x_d)


def test_limits_are_estimated_from_the_motion() -> None:
    recording = recorded(StageDrive(ModalModel([MODE])))
    found = estimated_limits([recording], T_S)
    assert found["velocity"] == pytest.approx(0.125, rel=0.01)
    assert found["acceleration"] == pytest.approx(10.0, rel=0.01)
    assert found["jerk"] == pytest.approx(2500.0, rel=0.02)
    assert found["change_max"] == pytest.approx(2 * np.abs(recording.x_d - recording.x).max(), rel=1e-3)
    assert found["estimated"] is True
    assert estimated_limits([replace(recording, x_d=np.zeros(9), x=np.zeros(9))], T_S) == {}
