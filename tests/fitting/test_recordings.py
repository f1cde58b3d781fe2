"""Recordings of a fit: how they are split, replayed and judged; settings chosen with them; times to settle."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hybridsep.base.errors import ParameterError, SignalError
from hybridsep.base.metrics import moves_of
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.fitting.lags import choose_settings, settings_to_try, with_window
from hybridsep.fitting.replay import Recording, beginnings, replay, split_log
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor

N = 400


def predictor() -> HybridPredictor:
    return HybridPredictor(ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), PredictorSettings(Np=20, p=5, q=2))


def pieces(*lengths: int) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(0)
    found = []
    for n in lengths:
        x_d = 1e-3 * np.sin(0.05 * np.arange(n))
        found.append((x_d, x_d + 1e-5 * rng.normal(size=n)))
    return found


def test_a_log_is_split_by_its_samples_across_its_gaps() -> None:
    parts = split_log(pieces(100, 300, 200), 0.5)
    assert [part.n_train for part in parts] == [100, 200, 0]
    x_d, x = parts[1].training
    assert len(x_d) == len(x) == 200


def test_what_is_tried_of_a_long_log_is_its_beginning_to_where_it_rests() -> None:
    x_d = np.arange(1000.0)
    [one] = beginnings([Recording(x_d, x_d + 1, 500)], 100)
    np.testing.assert_array_equal((one.x_d, one.x), (x_d[:100], x_d[:100] + 1))
    assert one.n_train == 50
    assert beginnings([one], 100) == [one]
    x_d[80:86] = 80.0
    [one] = beginnings([Recording(x_d, x_d + 1, 500)], 100)
    np.testing.assert_array_equal(one.x_d, x_d[:86])
    for rest, first, n_train in ((300, 294, 50), (700, 450, 50), (1000, 0, 50)):  # as much of it as leaves training
        [one] = beginnings([Recording(np.maximum(x_d, x_d[rest - 1]), x_d, 500)], 100)
        assert (one.x[0], one.n_train) == (first, n_train)


@pytest.mark.parametrize("share", [-0.1, 1.0])
def test_a_part_without_samples_is_refused(share: float) -> None:
    with pytest.raises(SignalError, match="none to test"):
        split_log(pieces(N), share)


def test_one_set_of_samples_judges() -> None:
    (x_d, x), n, first = pieces(N + 13)[0], N + 13, 220  # 206 samples train, which end within a window
    x[300:305] = np.nan
    whole = backtest(predictor(), x_d, x)
    found = replace(replay(predictor(), split_log([(x_d, x)], 0.5)), offset=2e-6).with_peers()
    errors = x[first:] - np.stack((whole.x_pb + 2e-6, whole.x_hold, whole.x_h))[:, first:]
    np.testing.assert_array_equal(found.errors(), errors)
    np.testing.assert_array_equal(found.joined("x_h_std"), whole.x_h_std[first:])
    *others, hybrid = found.scored()
    assert [one.rms for one in (*others[:2], hybrid)] == found.rms()
    assert found.rms() == pytest.approx(np.sqrt(np.nanmean(errors**2, axis=1)).tolist())
    assert [one.name for one in others[2:]] == [peer.title for peer in found.peers]
    for one, peer in zip(others[2:], found.peers, strict=True):
        np.testing.assert_array_equal(one.errors, (x - peer.predictions[0])[first:])
    verdict, rms = found.verdict(), {one.name: one.rms for one in others}
    compared = ["physics model", "hold", *verdict.peers[2:]]
    assert [name.partition(" (")[0] for name in compared[2:]] == ["lag + hold", "N4SID", "ARX20", "ARX40"]
    assert verdict.ratios == pytest.approx([hybrid.rms / rms[name] for name in compared])
    assert found.best().rms == min(rms.values())
    assert first + len(found.commands()) == n


def test_of_two_ways_the_better_is_compared() -> None:
    x_d, x = pieces(N)[0]
    found = replay(predictor(), split_log([(x_d, x)], 0.5)).with_peers()
    rms = {one.name: one.rms for one in found.scored()}
    for peer in found.best_ways()[2:]:
        assert rms[peer.title] == min(rms[f"{peer.name} (frozen)"], rms[f"{peer.name} (refitted)"])
    spoiled = tuple(replace(one, diverged=one.way == "frozen") for one in found.peers)
    assert [one.way for one in replace(found, peers=spoiled).best_ways()] == ["", "", "refitted", "refitted"]
    assert math.isinf(replace(found, peers=spoiled).scored()[4].rms)


def test_late_measurements_are_judged_where_they_stand() -> None:
    x_d, x = pieces(N)[0]
    late = HybridPredictor(predictor().model, PredictorSettings(Np=20, p=5, q=2, measurement_delay=7))
    found = replay(late, [Recording(x_d, x, 0)]).with_peers()
    assert np.isnan(found.errors()[:, :7]).all()
    assert not any(np.isnan(one.errors[7:]).any() for one in found.scored())


def test_the_error_over_the_horizon() -> None:
    found = replay(predictor(), split_log(pieces(N), 0.5))
    horizon, errors = found.horizon(), found.errors()
    assert horizon.shape == (3, 20)
    np.testing.assert_allclose(horizon[:, 3], np.sqrt(np.mean(errors[:, 3::20] ** 2, axis=1)))


def test_later_recordings_begin_with_what_the_earlier_ones_learned() -> None:
    first, second = pieces(N, N)
    found = replay(predictor(), [Recording(*first, N), Recording(*second, 0)])
    by_hand = predictor()
    backtest(by_hand, *first)
    by_hand.restart()
    np.testing.assert_array_equal(found.joined("x_h"), backtest(by_hand, *second).x_h)


def test_the_window_after_a_gap_does_not_judge() -> None:
    x_d = 1e-3 * np.sin(0.05 * np.arange(900))
    drive = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)
    x = HybridPredictor(drive, PredictorSettings(Np=900, p=5, q=2)).predict(x_d).x_pb
    parts = [(x_d[:300], x[:300]), (x_d[320:600], x[320:600]), (x_d[640:], x[640:])]
    judging = split_log(parts, 0.5, 20)
    assert [part.n_settling for part in judging] == [0, 20, 20]
    assert [part.judges_from for part in judging] == [300, 120, 20]
    found, everything = replay(predictor(), judging), replay(predictor(), split_log(parts, 0.5))
    assert found.errors().shape[1] == everything.errors().shape[1] - 20
    assert found.rms()[0] < 0.5 * everything.rms()[0]
    for name in ("x_pb", "x_h"):
        np.testing.assert_array_equal(found.joined(name)[:160], everything.joined(name)[:160])


def test_the_window_after_a_gap_judges_where_little_else_would() -> None:
    assert sum(len(part.x) - part.judges_from for part in split_log(pieces(40, 10, 12), 0.6, 20)) == 25


T_S, TAU = 1e-3, 0.02


def test_settling_of_a_lag_is_by_its_time_constant() -> None:
    """A step of size A is within w after τ ln(A/w); the last move is cut before it settles."""
    sizes, at = (1e-3, 2e-3, 0.5e-3, 4e-3), (200, 700, 1200, 1700)
    x_d = np.zeros(1740)
    for size, first in zip(sizes, at, strict=True):
        x_d[first:] += size
    x, pole = np.zeros(len(x_d)), math.exp(-T_S / TAU)
    for k in range(1, len(x)):
        x[k] = pole * x[k - 1] + (1.0 - pole) * x_d[k]
    window = 10e-6
    moves = moves_of(x_d, x, T_S, window)
    assert [one.start for one in moves] == pytest.approx([T_S * (first - 1) for first in at])
    for one, size in zip(moves[:3], sizes, strict=False):
        assert one.settling == pytest.approx(TAU * math.log(size / window), abs=2.0 * T_S)
        assert one.largest == pytest.approx(size, rel=0.06)
    assert math.isinf(moves[3].settling)
    x[300] = np.nan  # what is missing is not outside
    assert moves_of(x_d, x, T_S, window)[0].settling < 0.1
    assert moves_of(np.zeros(50), np.zeros(50), T_S, window) == []


# Choice of settings -------------------------------------------------------------------------------------------------


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
