"""Drives of two masses: fixed by seed and index, exact where they are linear, friction as in closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from random_drives.drive import Drive
from two_mass.axis import Axis, Friction, LinearLoop
from two_mass.generator import Recipe, random_drives
from two_mass.plant import INTERNAL_STEP, TwoMassDrive

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array

SEED = 1
N = 30

FEW = (0, 1, 2, 3)
EXPECTED_KINDS = ["segments", "moves", "circle", "sweep"]
EXPECTED_RMS = [749.80903542, 21.72408038, 921.53684028, 802.28915573]
"""Their servo errors, µm, against the measured position."""

LOOP = LinearLoop(
    load=0.4,
    stiffness=1.4e4,
    damping=5.0,
    viscous=1.5,
    k_v=20.0,
    k_p=120.0,
    t_i=0.0,
    feedforward=0.0,
    tau=5e-4,
    at_load=True,
    closed_at_load=False,
)
FRICTION = Friction(coulomb=0.6, stribeck=1.4, v_stribeck=2e-3, presliding=1e-5, micro_damping=100.0)


@pytest.fixture(scope="module")
def recipes() -> list[Recipe]:
    return [Recipe.draw(index, SEED) for index in range(N)]


@pytest.fixture(scope="module")
def drives() -> list[Drive]:
    return random_drives(FEW, SEED)


def axis(loop: LinearLoop = LOOP, T_s: float = 1e-3, **values: float | Friction) -> Axis:
    return replace(Axis(loop, loop, change_at=10**9, T_s=T_s), **values)  # type: ignore[arg-type]


def response(recipe: Recipe, axis: Axis, step: float = INTERNAL_STEP) -> Array:
    return TwoMassDrive(axis, float(recipe.x_d[0]), step).run(recipe.x_d)


def test_the_drives_stay_what_they_are(drives: list[Drive]) -> None:
    """Figures are given for the drives of a seed, so a change of the generator must not pass unseen."""
    assert [drive.kind for drive in drives] == EXPECTED_KINDS
    assert [1e6 * rms(drive.x_meas - drive.x_d) for drive in drives] == pytest.approx(EXPECTED_RMS, rel=1e-6)


@pytest.mark.parametrize("t_i", [0.0, 0.05])
@pytest.mark.parametrize("at_load", [False, True])
def test_a_linear_drive_is_its_modal_model(t_i: float, at_load: bool) -> None:
    loop = replace(LOOP, t_i=t_i, at_load=at_load)
    x_d = 0.01 * np.sin(0.02 * np.arange(2000))
    late = axis(loop, dead_time=2)
    delayed = np.concatenate((np.zeros(2), x_d[:-2]))
    model = loop.model.discretise(1e-3)
    expected = model.forced_response(model.rest(), delayed)[0]
    assert np.abs(TwoMassDrive(late).run(x_d) - expected).max() < 1e-12
    assert np.abs(TwoMassDrive(late, step=2e-5).run(x_d) - expected).max() < 1e-12


def test_sliding_friction_holds_the_axis_back_by_its_closed_form() -> None:
    """P/P: ``K_p (K_v e − v) = F_c + 2 b v`` where the velocity is constant, and both bodies move alike."""
    v = 0.05
    x_d = np.asarray(v * 1e-3 * np.arange(4000), dtype=np.float64)
    drive = TwoMassDrive(axis(replace(LOOP, at_load=False), motor=FRICTION, interpolates=1.0))
    drive.run(x_d)
    x_motor, v_motor, _, v_load, _, force = drive.states()
    assert [v_motor, v_load] == pytest.approx([v, v], rel=1e-5)
    sliding = FRICTION.coulomb * (1 + (FRICTION.stribeck - 1) / (1 + (v / FRICTION.v_stribeck) ** 2))
    assert force == pytest.approx(sliding + 2 * LOOP.viscous * v, rel=1e-4)
    assert x_d[-1] - x_motor == pytest.approx((v + force / LOOP.k_p) / LOOP.k_v, rel=1e-4)


def test_backlash_is_the_play_of_the_load() -> None:
    steps = np.repeat([0.0, 0.01, 0.0], 1500)
    x_d = np.asarray(np.convolve(steps, np.full(300, 1 / 300))[: len(steps)], dtype=np.float64)
    slow = replace(LOOP, k_v=8.0)
    bearing = Friction(coulomb=0.05, presliding=1e-6, micro_damping=50.0)
    tight, loose = (TwoMassDrive(axis(slow, play=play, bearing=bearing)).run(x_d) for play in (0.0, 2e-4))
    assert tight[2999] - loose[2999] == pytest.approx(1e-4, rel=0.05)
    assert tight[-1] - loose[-1] == pytest.approx(-1e-4, rel=0.05)


@pytest.mark.slow
def test_internal_steps_are_short_enough(recipes: list[Recipe]) -> None:
    for recipe in recipes:
        coarse, fine = response(recipe, recipe.axis), response(recipe, recipe.axis, INTERNAL_STEP / 4)
        linear = response(recipe, recipe.axis.linear())
        assert rms(coarse - fine) <= 0.05 * rms(fine - linear) + 3e-8, recipe.index
