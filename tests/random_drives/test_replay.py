"""Replay of predictors on random drives, and the table of the results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_drives.generator import RandomDrive, Recipe
from random_drives.replay import _hold, core_replay, library_replay, replay
from random_drives.simulation import simulate

from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor


@pytest.fixture(scope="module")
def drive() -> RandomDrive:
    recipe = Recipe.draw(0, 1)
    short = replace(recipe, x_d=recipe.x_d[:1800], noise=recipe.noise[:1800])
    return short.drive(*simulate([short.true.model], [short.disturbances], [short.x_d]))


@pytest.mark.slow
def test_figures_are_those_of_backtest(drive: RandomDrive) -> None:
    result = replay(drive, "paper")
    scores = backtest(HybridPredictor(drive.model, PredictorSettings(averaging=False)), drive.x_d, drive.x_meas)
    assert result.rms_pb == pytest.approx(scores.overall.rms_pb, rel=1e-9)
    assert result.rms_h == pytest.approx(scores.overall.rms_h, rel=1e-12)
    # Backtest publishes x_pb during the warm-up.
    hold = _hold(scores.x_pb, drive.x_meas, 100)
    assert np.abs((hold - scores.x_hold)[scores.active]).max() < 1e-12
    assert result.rms_hold == pytest.approx(float(np.sqrt(np.mean((drive.x_meas - hold) ** 2))))


def test_the_c_core_replays_as_the_library(drive: RandomDrive) -> None:
    given = "default", drive.model, drive.settings, drive.x_d, drive.x_meas
    np.testing.assert_allclose(core_replay(*given), library_replay(*given), rtol=0, atol=1e-12)
