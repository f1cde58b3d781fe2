"""A late measurement: windows that begin where it ends, in predictor and backtest."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from predictor_cases import MODEL, averaged_model, cycles, physics

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor

NP, DELAY, N = 40, 6, 400

SETTINGS: list[dict[str, Any]] = [{"averaging": True}, *({"averaging": False, "t_init": t} for t in (0.0, 0.063))]


def drive() -> tuple[Array, Array]:
    """Return commands and positions with a residual that a prediction can follow, (N,), m."""
    x_d = 0.3 + cycles(N) ** 2 / 5e-3
    return x_d, physics(x_d) + 1e-5 * np.sin(np.arange(N) / 17) + np.random.default_rng(4).normal(0.0, 1e-7, N)


def late(delay: int) -> Array:
    """Return what has arrived of the positions, (N,), m; at rest before."""
    x_d, x = drive()
    return np.concatenate((np.full(delay, x_d[0]), x))[:N]


def new(delay: int, **settings: Any) -> HybridPredictor:
    return HybridPredictor(MODEL, PredictorSettings(Np=NP, p=12, q=2, measurement_delay=delay, **settings))


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("delay", [DELAY, NP + 7])
def test_windows_are_predicted_from_the_last_measurement_on(delay: int, settings: dict[str, Any]) -> None:
    """By a predictor without delay that predicts the samples not measured yet as well, and starts so much earlier."""
    x_d, x_meas = drive()[0], late(delay)
    predictor, peer = new(delay, **settings), new(0, **settings)
    if settings["averaging"]:  # only what is published is judged
        model = replace(averaged_model(peer), settings=predictor.settings)
        peer.state = replace(peer.state, residual=model)
    commands = np.concatenate((np.full(delay, x_d[0]), x_d))
    for k in range(0, N, NP):
        found = predictor.predict(x_d[k : k + NP])
        expected = peer.predict(commands[k : k + NP + delay])
        if k >= peer.n_init:  # the peer counts its warm-up from an earlier sample
            np.testing.assert_array_equal(found.x_h, expected.x_h[delay:])
            assert found.n_warm_up == 0
        np.testing.assert_array_equal(found.x_pb, expected.x_pb[delay:])
        for each in (predictor, peer):
            each.update(x_meas[k : k + NP])


def test_the_operator_is_that_of_the_commands_to_come() -> None:
    x_d, x_meas = drive()[0], late(DELAY)
    predictor = new(DELAY, averaging=False, t_init=0.0)
    backtest(predictor, x_d[:200], x_meas[:200])
    model = predictor.operator()
    np.testing.assert_allclose(model(x_d[200:240]), predictor.predict(x_d[200:240]).x_h, rtol=0, atol=1e-12)


@pytest.mark.parametrize("settings", SETTINGS)
def test_a_replay_compares_with_what_was_measured(settings: dict[str, Any]) -> None:
    (x_d, x), x_meas = drive(), late(DELAY)
    found, sound = backtest(new(DELAY, **settings), x_d, x_meas), backtest(new(0, **settings), x_d, x)
    np.testing.assert_allclose(found.x_pb[DELAY:], sound.x_pb[:-DELAY], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.active[DELAY:], sound.active[:-DELAY])
    assert found.overall.n_samples == N - DELAY  # the first ones were measured before the run
    error = (x_meas - found.x_h)[DELAY:]
    assert found.overall.h.rms == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
    assert found.overall.h.rms < 1.5 * sound.overall.h.rms


def test_a_delay_of_chunks_is_that_of_the_whole() -> None:
    x_d, x_meas = drive()[0], late(DELAY)
    whole = backtest(new(DELAY), x_d, x_meas)
    predictor = new(DELAY)
    parts = [backtest(predictor, x_d[i : i + 200], x_meas[i : i + 200]) for i in (0, 200)]
    np.testing.assert_array_equal(np.concatenate([part.x_pb for part in parts])[:200], whole.x_pb[:200])
    np.testing.assert_array_equal(parts[1].x_h[DELAY:], whole.x_h[200 + DELAY :])
