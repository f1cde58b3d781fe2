"""Choice of settings: what is tried, what is chosen."""

from dataclasses import replace

import numpy as np
import pytest

from hybridsep.base.errors import ParameterError
from hybridsep.base.settings import PredictorSettings
from hybridsep.fitting.choice import choose_settings, settings_to_try, with_window
from hybridsep.fitting.replay import Recording, replay, split_log
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor

MODEL = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)


def ringing() -> list[Recording]:
    """A log whose residual rings with a period of 30 samples, so that many lags are needed to see it."""
    rng, n = np.random.default_rng(1), 800
    k = np.arange(n)
    x_d = 1e-3 * np.cumsum(rng.normal(size=n) * (k % 97 == 0))
    ring, state = np.zeros(n), np.zeros(2)
    for i in range(2, n):
        state = np.array([2 * 0.995 * np.cos(2 * np.pi / 30) * state[0] - 0.995**2 * state[1], state[0]])
        state[0] += 1e-6 * rng.normal()
        ring[i] = state[0]
    return split_log([(x_d, x_d + ring)], 0.5)


def test_what_fits_into_a_short_window_is_the_default() -> None:
    default = PredictorSettings(T_s=2e-3)
    assert with_window(default, default.Np) == default
    short = with_window(default, 1)
    assert (short.Np, short.p, short.q, short.T_s) == (1, 1, 0, 2e-3)


@pytest.mark.parametrize("Np", [1, 2, 19, 100])
def test_all_that_is_tried_has_the_controllers_window(Np: int) -> None:
    settings = with_window(PredictorSettings(), Np)
    tried = settings_to_try(settings)
    assert tried[0] == settings
    assert all(one.Np == Np and one.p <= Np and one.q < Np for one in tried)
    assert len(set(tried)) == len(tried)


def test_what_a_user_asks_for_is_tried_beside_the_default() -> None:
    settings = with_window(PredictorSettings(), 40)
    assert [(one.p, one.q) for one in settings_to_try(settings, [5, 30])] == [(40, 3), (5, 3), (30, 3), (40, 1)]
    with pytest.raises(ParameterError, match="p must be 1 … Np = 40, got 41"):
        settings_to_try(settings, [41])


@pytest.mark.slow
def test_the_best_of_what_was_tried_is_chosen_by_what_trains() -> None:
    recordings = ringing()
    settings = with_window(PredictorSettings(), 40)
    chosen, tried = choose_settings(MODEL, recordings, settings)
    candidates = settings_to_try(settings)
    assert [(one.p, one.q) for one in tried] == [(one.p, one.q) for one in candidates]
    for one, candidate in zip(tried, candidates, strict=True):
        training = [Recording(*one.training, 0) for one in recordings]
        errors = replay(HybridPredictor(MODEL, candidate), training).errors()[2]
        assert one.rms_h == pytest.approx(np.sqrt(np.mean(errors[200:] ** 2)))
    best = min(tried, key=lambda one: one.rms_h)
    best = best if best.rms_h < 0.95 * tried[0].rms_h else tried[0]
    assert [one for one in tried if one.chosen] == [best]
    assert chosen == candidates[tried.index(best)]
    spoiled = [replace(recordings[0], x=np.concatenate((recordings[0].x[:400], np.zeros(400))))]
    assert choose_settings(MODEL, spoiled, settings)[0] == chosen
