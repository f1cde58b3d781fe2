"""Replay of predictors on random drives, and the table of the results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.random_drives.core import core_replay
from benchmarks.random_drives.faults import FAULTS, JITTER, OFFSET_STEP
from benchmarks.random_drives.generator import RandomDrive, Recipe
from benchmarks.random_drives.replay import _hold, library_replay, replay, replay_faults
from benchmarks.random_drives.run import main
from benchmarks.random_drives.simulation import simulate
from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor


@pytest.fixture(scope="module")
def drive() -> RandomDrive:
    recipe = Recipe.draw(0, 1)
    short = replace(recipe, x_d=recipe.x_d[:3000], noise=recipe.noise[:3000])
    return short.drive(*simulate([short.true.model], [short.disturbances], [short.x_d]))


def physics_only(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    discrete = model.discretise(1e-3)
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


def refusing(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    raise SignalError("x_h diverges")


def diverging(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    return x_meas + np.linspace(0.0, 1.1, len(x_d))


@pytest.mark.slow
def test_figures_are_those_of_backtest(drive: RandomDrive) -> None:
    result = replay(drive, "paper")
    scores = backtest(HybridPredictor(drive.model, PredictorSettings(trust=False)), drive.x_d, drive.x_meas)
    assert result.rms_pb == pytest.approx(scores.overall.rms_pb, rel=1e-9)
    assert result.rms_h == pytest.approx(scores.overall.rms_h, rel=1e-12)
    # Backtest publishes x_pb during the warm-up.
    hold = _hold(scores.x_pb, drive.x_meas, 100)
    assert np.abs((hold - scores.x_hold)[scores.active]).max() < 1e-12
    assert result.rms_hold == pytest.approx(float(np.sqrt(np.mean((drive.x_meas - hold) ** 2))))


@pytest.mark.parametrize("predictor", ["default", "paper"])
def test_the_c_core_replays_as_the_library(drive: RandomDrive, predictor: str) -> None:
    given = predictor, drive.model, drive.settings, drive.x_d, drive.x_meas
    np.testing.assert_allclose(core_replay(*given), library_replay(*given), rtol=0, atol=1e-12)


def test_physics_is_the_measure(drive: RandomDrive) -> None:
    result = replay(drive, "", physics_only)
    assert result.ratio == pytest.approx(1.0, rel=1e-9)
    assert not result.diverged


def test_divergence_and_refusal_are_counted(drive: RandomDrive) -> None:
    assert replay(drive, "", diverging).diverged
    refused = replay(drive, "", refusing)
    assert refused.diverged
    assert refused.ratio == np.inf


def test_hold_before_the_first_measurement_is_physics() -> None:
    x_pb, x_meas = np.zeros(7), np.arange(1.0, 8.0)
    assert _hold(x_pb, x_meas, 3).tolist() == [0, 0, 0, 3, 3, 3, 6]


def test_faults_are_scored_after_the_last_faulty_sample(drive: RandomDrive) -> None:
    for result in replay_faults(drive, 1, "", physics_only):
        assert result.ratio == pytest.approx(1.0, rel=0.05 if result.fault == JITTER else 1e-9)
        assert result.change < 1e-9
        assert not result.refused


def test_missing_samples_are_refused_by_the_paper_s_model(drive: RandomDrive) -> None:
    results = {result.fault: result for result in replay_faults(drive, 1, "paper", library_replay)}
    assert set(results) == set(FAULTS)
    assert results["1 % missing"].refused
    assert not results[OFFSET_STEP].refused


@pytest.mark.slow
def test_command_line(capsys: pytest.CaptureFixture[str], tmp_path_factory: pytest.TempPathFactory) -> None:
    cache = tmp_path_factory.mktemp("drives") / "positions.npz"
    arguments = ["--n", "1", "--processes", "1", "--core", "--faults", "--cache", str(cache)]
    main(arguments)
    first = capsys.readouterr().out
    assert "1 random drives, predictor: default" in first
    assert "diverged: " in first
    assert all(fault in first for fault in FAULTS)
    arguments.remove("--faults")
    main(arguments)  # from the file
    again = capsys.readouterr().out
    assert "1 random drives, predictor: default" in again
    assert first.startswith(again)
