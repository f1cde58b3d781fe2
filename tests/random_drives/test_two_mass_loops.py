"""Closed loops of the native compensator and drives of two masses, and their conditions."""

from dataclasses import replace

import pytest
from two_mass.generator import Recipe
from two_mass.loop import closed_loop, settings_of

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array

SEED = 2
CHEAP = 1  # a drive at 250 Hz


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    drawn = Recipe.draw(CHEAP, SEED)
    return replace(drawn, x_d=drawn.x_d[:400], noise=drawn.noise[:400])


@pytest.fixture(scope="module")
def x_d(recipe: Recipe) -> Array:
    return settings_of(recipe)[2]


@pytest.mark.slow
def test_the_hybrid_follows_better_than_physics(recipe: Recipe, x_d: Array) -> None:
    physics, hybrid = (closed_loop(recipe, recipe.axis, compensate) for compensate in ("physics", "hybrid"))
    assert rms(x_d - hybrid.x) < 0.7 * rms(x_d - physics.x)
