"""Random drives: fixed by seed and index, exact where they are linear, at rest where they should be."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_drives.disturbances import Disturbances
from random_drives.generator import RandomDrive, Recipe, random_drives
from random_drives.simulation import simulate
from scipy.signal import cont2discrete, dlsim

from hybridsep.base.signals import Array

SEED = 1
N = 40

SHORTEST = (3, 18, 57)  # drives of about 6 s, which take the least time

EXPECTED_KINDS = ["cycles", "cycles", "spiral"]
EXPECTED_RMS = [51.24528299, 580.85925701, 30.61436502]  # their servo errors, µm, against the measured position


@pytest.fixture(scope="module")
def drives() -> list[RandomDrive]:
    return random_drives(SHORTEST, SEED)


@pytest.fixture(scope="module")
def recipes() -> list[Recipe]:
    return [Recipe.draw(index, SEED) for index in range(N)]


def simulated(recipes: list[Recipe], commands: list[Array], **changes: Any) -> list[Array]:
    disturbances = [replace(recipe.disturbances, **changes) for recipe in recipes]
    return simulate([recipe.true.model for recipe in recipes], disturbances, commands)


def test_the_drives_stay_what_they_are(drives: list[RandomDrive]) -> None:
    """Figures are given for the drives of a seed, so a change of the generator must not pass unseen."""
    assert [drive.kind for drive in drives] == EXPECTED_KINDS
    found = [1e6 * float(np.sqrt(np.mean((drive.x_meas - drive.x_d) ** 2))) for drive in drives]
    assert found == pytest.approx(EXPECTED_RMS, rel=1e-6)


@pytest.mark.slow
def test_a_linear_drive_is_its_modal_model(recipes: list[Recipe]) -> None:
    some = recipes[:12]
    commands = [recipe.x_d[:1500] for recipe in some]
    x = simulate([recipe.true.model for recipe in some], [Disturbances()] * len(some), commands)
    for recipe, x_d, position in zip(some, commands, x, strict=True):
        response = np.zeros_like(x_d)
        for mode in recipe.true.model.modes:
            A = np.array([[0.0, 1.0], [-(mode.omega**2), -2 * mode.zeta * mode.omega]])
            output = np.array([[mode.alpha, mode.beta]])
            system = cont2discrete((A, np.array([[0.0], [1.0]]), output, np.zeros((1, 1))), 1e-3, "zoh")
            response += dlsim(system, x_d - x_d[0])[1].ravel()
        assert np.ptp(response) > 1e-5
        assert np.abs(position - x_d[0] - response).max() < 1e-9


@pytest.mark.slow
def test_sub_steps_are_short_enough(recipes: list[Recipe]) -> None:
    some = recipes
    commands = [recipe.x_d[400:800] for recipe in some]
    models, disturbances = [recipe.true.model for recipe in some], [recipe.disturbances for recipe in some]
    coarse, fine = (simulate(models, disturbances, commands, sub_steps) for sub_steps in (8, 24))
    linear = simulate(models, [Disturbances()] * len(some), commands)
    for x, y, z in zip(coarse, fine, linear, strict=True):
        assert np.sqrt(np.mean((x - y) ** 2)) <= 0.03 * np.sqrt(np.mean((y - z) ** 2)) + 1e-11
