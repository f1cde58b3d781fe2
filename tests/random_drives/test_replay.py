"""Replay of predictors on random drives, and the table of the results."""

from dataclasses import replace

import numpy as np
import pytest
from random_drives.generator import RandomDrive, Recipe
from random_drives.replay import core_replay, library_replay
from random_drives.simulation import simulate


@pytest.fixture(scope="module")
def drive() -> RandomDrive:
    recipe = Recipe.draw(0, 1)
    short = replace(recipe, x_d=recipe.x_d[:1800], noise=recipe.noise[:1800])
    return short.drive(*simulate([short.true.model], [short.disturbances], [short.x_d]))


def test_the_c_core_replays_as_the_library(drive: RandomDrive) -> None:
    given = "default", drive.model, drive.settings, drive.x_d, drive.x_meas
    np.testing.assert_allclose(core_replay(*given), library_replay(*given), rtol=0, atol=1e-12)
