"""Closed loops of the native compensator and drives of two masses, and their conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.two_mass.closed_loop import Result, main, results, rows
from benchmarks.two_mass.conditions import CONDITIONS, RINGING, SOUND
from benchmarks.two_mass.generator import Recipe
from benchmarks.two_mass.loop import closed_loop, settings_of
from benchmarks.two_mass.plant import TwoMassDrive
from hybridsep.base.metrics import largest, rms
from hybridsep.base.signals import Array

SEED = 2
CHEAP = 1
"""A drive at 250 Hz."""

FAULTS = {name: condition for name, condition in CONDITIONS.items() if condition.fault is not None}


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    drawn = Recipe.draw(CHEAP, SEED)
    return replace(drawn, x_d=drawn.x_d[:400], noise=drawn.noise[:400])


@pytest.fixture(scope="module")
def x_d(recipe: Recipe) -> Array:
    return settings_of(recipe)[2]


@pytest.mark.slow
def test_off_is_the_drive_alone(recipe: Recipe, x_d: Array) -> None:
    loop = closed_loop(recipe, recipe.axis, "off")
    assert np.array_equal(loop.x_dm, x_d)
    assert largest(loop.x - TwoMassDrive(recipe.axis, float(x_d[0])).run(x_d)) < 1e-12


@pytest.mark.slow
def test_the_physics_models_plans_do_not_depend_on_the_measurement(recipe: Recipe, x_d: Array) -> None:
    planned = closed_loop(recipe, recipe.axis, "physics")
    assert largest(planned.x_dm - x_d) > 1e-4
    for condition in CONDITIONS.values():
        axis = condition.axis(recipe.axis, x_d)
        loop = closed_loop(recipe, axis, "physics", condition.sensor(x_d, axis.T_s))
        assert np.array_equal(loop.x_dm, planned.x_dm)
        assert largest(loop.x - TwoMassDrive(axis, float(x_d[0])).run(planned.x_dm)) < 1e-12


def test_the_hybrid_follows_better_than_physics(recipe: Recipe, x_d: Array) -> None:
    physics, hybrid = (closed_loop(recipe, recipe.axis, compensate) for compensate in ("physics", "hybrid"))
    assert rms(x_d - hybrid.x) < 0.7 * rms(x_d - physics.x)


def test_a_saturated_motor_has_less_force_than_the_trajectory_needs(recipe: Recipe, x_d: Array) -> None:
    axis = CONDITIONS["motor saturated at 0.6"].axis(recipe.axis, x_d)
    peak = np.abs(np.diff(x_d, 2)).max() / axis.T_s**2
    friction = axis.motor.coulomb + axis.bearing.coulomb
    assert axis.force_max - friction == pytest.approx(0.6 * peak * (1 + max(0.0, axis.changed.added)))
    assert recipe.axis.force_max > peak + friction


@pytest.mark.parametrize("index", range(60))
def test_a_ringing_mode_has_the_damping_ratio_that_it_should(index: int) -> None:
    drawn = Recipe.draw(index, SEED)
    axis = CONDITIONS["begins to ring"].axis(drawn.axis, drawn.x_d)
    assert axis.loop == drawn.axis.loop
    assert axis.change_at == round(0.4 * len(drawn.x_d))
    assert axis.changed.least_damping == pytest.approx(RINGING)


@pytest.mark.parametrize("name", FAULTS)
def test_measurements_fail_in_motion_for_their_time(recipe: Recipe, x_d: Array, name: str) -> None:
    condition, T_s = FAULTS[name], recipe.axis.T_s
    sensor = condition.sensor(x_d, T_s)
    sound = x_d + 1.0
    measured = np.array([sensor(k, x) for k, x in enumerate(sound.tolist())])
    failed = np.flatnonzero(~(measured == sound))
    n = round(condition.duration / T_s)
    assert n - 3 <= len(failed) <= n
    assert failed[0] >= 0.4 * len(x_d)
    assert np.ptp(x_d[failed[0] : failed[0] + n]) > 1e-3
    if name.startswith("encoder held"):
        assert set(measured[failed].tolist()) == {float(sound[failed[0] - 1])}


def test_a_drive_that_the_compensator_refuses_counts_as_infinite() -> None:
    refused = Result(0, SOUND, "", (2.0, 2.0), (1.0, 1.0), (np.inf, np.inf), 0.0)
    fine = Result(1, SOUND, "", (2.0, 2.0), (1.0, 4.0), (0.5, 1.0), 0.1)
    assert (fine.over_physics(0), fine.over_better(1), fine.over_worse(0)) == (0.5, 0.5, 0.25)
    table = list(rows([refused, fine]))
    assert table[-1].split() == ["all", "0.5", "inf", "inf", "0.5", "inf", "inf", "inf", "inf", "inf", "50.0", "%"]


@pytest.mark.slow
def test_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--first", str(CHEAP), "--n", "1", "--only", SOUND, "--processes", "1"])
    printed = capsys.readouterr().out
    found = results(CHEAP, SEED, SOUND)
    assert [result.condition for result in found] == [SOUND]
    assert f"drive {CHEAP}: × physics {found[0].over_physics(0):.3g}" in printed
    assert "kept" in printed
    assert found[0].excess <= 1e-9
