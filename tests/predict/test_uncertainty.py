"""Standard deviation of the prediction error: calibrated online, wherever the error comes from."""

from typing import Any

import numpy as np
import pytest
from predictor_cases import FRICTION, averaged, cycles, friction, physics

from hybridsep.base.metrics import coverage
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import PREDICTION_MAX, Array
from hybridsep.base.state import numbers_of
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.uncertainty import PredictedError, Uncertainty, first_variance

N = 100
LEVELS = (0.5, 0.9, 0.95)
ALL = np.ones(N, dtype=np.bool_)


def window(uncertainty: Uncertainty, variance: Array | float = 0.0, e_h: Array | float = 0.0) -> PredictedError:
    """Return the predicted error of a window at rest, with the ``variance`` of the model and a residual ``e_h``."""
    return uncertainty.predict(np.zeros(N), np.zeros(N) + e_h, variance, N)


def moving(uncertainty: Uncertainty, speed: Array | float) -> PredictedError:
    """Return the predicted error of a window of a ``speed``, m per sample."""
    return uncertainty.predict(np.cumsum(np.zeros(N) + speed), np.zeros(N), 0.0, N)


def after_noise(std: float, n: int = 60, seed: int = 0, uncertainty: Uncertainty | None = None) -> Uncertainty:
    """Return an uncertainty after ``n`` windows of white errors."""
    learning = uncertainty or Uncertainty.init(1e-12)
    for errors in np.random.default_rng(seed).normal(0.0, std, (n, N)):
        learning = learning.learn(window(learning), errors, ALL, N)
    return learning


def after_a_hundred(errors: Array) -> list[tuple[Array, Array]]:
    """Return errors and deviations of windows at rest after the first hundred; all are learned."""
    uncertainty, found = Uncertainty.init(1e-12), []
    for one in errors:
        predicted = window(uncertainty)
        found.append((one, predicted.std))
        uncertainty = uncertainty.learn(predicted, one, ALL, N)
    return found[100:]


@pytest.mark.parametrize("std", [1e-9, 5e-6, 1e-3])
def test_white_noise_of_any_size_is_known_after_a_second(std: float) -> None:
    predicted = window(after_noise(std, 10)).std
    np.testing.assert_allclose(predicted, std, rtol=0.25)
    assert float(np.sqrt(np.mean(predicted**2))) == pytest.approx(std, rel=0.15)


def test_an_error_far_below_the_residual_is_known() -> None:
    uncertainty = Uncertainty.init(1e-12)
    for errors in np.random.default_rng(8).normal(0.0, 1.5e-7, (60, N)):
        uncertainty = uncertainty.learn(window(uncertainty, e_h=1e-3), 1e-3 + errors, ALL, N)
    np.testing.assert_allclose(window(uncertainty, e_h=1e-3).std, 1.5e-7, rtol=0.25)


def test_before_the_first_window_it_is_the_assumed_noise_and_what_the_model_knows() -> None:
    uncertainty = Uncertainty.init(4e-12)
    np.testing.assert_allclose(window(uncertainty).std, 2e-6, rtol=0.1)
    np.testing.assert_allclose(window(uncertainty, variance=1e-8).std[N // 2 :], 1e-4 * np.sqrt(2.0), rtol=0.1)


@pytest.mark.parametrize(("noise_std", "expected"), [(0.0, 1e-5), (3e-6, 3e-6), (1e-7, 2e-6)])
def test_the_assumed_noise_is_the_given_one_or_larger_than_lambda(noise_std: float, expected: float) -> None:
    assert first_variance(PredictorSettings(lam=4e-12, noise_std=noise_std)) == pytest.approx(expected**2)


def test_errors_in_motion_do_not_widen_the_interval_at_standstill() -> None:
    rng, uncertainty = np.random.default_rng(1), Uncertainty.init(1e-12)
    speed = np.where(np.arange(N) < 50, 0.0, 1e-3)
    for _ in range(80):
        predicted = moving(uncertainty, speed)
        uncertainty = uncertainty.learn(predicted, rng.normal(0.0, np.where(speed > 0.0, 2e-5, 1e-6)), ALL, N)
    std = moving(uncertainty, speed).std
    assert np.all((std[:50] > 0.7e-6) & (std[:50] < 2e-6))
    np.testing.assert_allclose(std[75:], 2e-5, rtol=0.25)
    assert std[50] < 0.7 * std[-1]  # motion is felt for a while after it began


def test_larger_noise_is_followed() -> None:
    uncertainty = after_noise(1e-6)
    changed = after_noise(3e-5, 60, 2, uncertainty)
    np.testing.assert_allclose(window(changed).std, 3e-5, rtol=0.3)


def test_heavy_tails_are_missed_alike_by_the_three_intervals() -> None:
    windows = after_a_hundred(1e-6 * np.random.default_rng(3).standard_t(3.5, (400, N)))
    shares = np.mean([[coverage(errors, std, level) for level in LEVELS] for errors, std in windows], axis=0)
    assert shares.sum() == pytest.approx(sum(LEVELS), abs=0.02)
    np.testing.assert_allclose(shares, LEVELS, atol=0.055)


@pytest.mark.parametrize("growth", [0.2, 5.0])
def test_an_error_that_grows_or_shrinks_over_the_window_is_covered_at_each_third(growth: float) -> None:
    drawn = np.random.default_rng(4).normal(0.0, 1e-6 * growth ** (np.arange(N) / N), (400, N))
    inside = [np.abs(errors) <= 1.645 * std for errors, std in after_a_hundred(drawn)]
    shares = [part.mean() for part in np.array_split(np.mean(inside, axis=0), 3)]
    np.testing.assert_allclose(shares, 0.9, atol=0.04)


def test_it_is_invariant_to_the_unit() -> None:
    found = []
    for unit in (1.0, 1e3, 1e-3):
        uncertainty = Uncertainty.init(1e-12 * unit**2)
        drawn = np.random.default_rng(5)
        for _ in range(20):
            speed, errors = 1e-3 * drawn.normal(size=N), 1e-5 * drawn.normal(size=N)
            uncertainty = uncertainty.learn(moving(uncertainty, unit * speed), unit * errors, ALL, N)
        found.append(moving(uncertainty, unit * 1e-3).std / unit)
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=1e-6)


def test_what_is_not_measured_is_not_learned() -> None:
    uncertainty = after_noise(1e-6, 5)
    before = numbers_of(uncertainty)
    uncertainty = uncertainty.learn(window(uncertainty), np.ones(N), ~ALL, N)
    uncertainty = uncertainty.learn(window(uncertainty), np.zeros(N), ALL, N)  # exactly the physics model
    np.testing.assert_array_equal(numbers_of(uncertainty), before)
    uncertainty = uncertainty.learn(window(uncertainty), np.where(np.arange(N) == 7, 1.0, 1e-6), np.arange(N) != 7, N)
    assert window(uncertainty).std.max() < 3e-6


def test_a_diverging_prediction_has_a_finite_deviation() -> None:
    uncertainty = after_noise(1e-6, 5)
    for e_h in (np.inf, np.nan, 1e300, -np.inf):
        predicted = window(uncertainty, e_h=e_h)
        assert np.isfinite(predicted.std).all()
        uncertainty = uncertainty.learn(predicted, np.ones(N), ALL, N)
        assert np.isfinite(numbers_of(uncertainty)).all()
    assert window(uncertainty, variance=PREDICTION_MAX).std.max() <= PREDICTION_MAX


@pytest.mark.parametrize(("averaging", "atol"), [(True, 0.04), (False, 0.07)])
def test_intervals_cover_friction_and_noise(averaging: bool, atol: float) -> None:
    x_d = cycles(8000)
    x = physics(x_d) + friction(x_d, FRICTION) + np.random.default_rng(6).normal(0.0, 2e-6, len(x_d))
    predictor = averaged() if averaging else HybridPredictor(averaged().model, PredictorSettings(averaging=False))
    result = backtest(predictor, x_d, x)
    shares = [coverage(x - result.x_h, result.x_h_std, level) for level in LEVELS]
    np.testing.assert_allclose(shares[1:], LEVELS[1:], atol=atol)
    assert shares[0] == pytest.approx(0.5, abs=0.1)


def test_the_warm_up_has_the_deviation_of_the_physics_model() -> None:
    x_d = cycles(3000)
    x = physics(x_d) + friction(x_d, FRICTION) + np.random.default_rng(7).normal(0.0, 1e-6, len(x_d))
    results: dict[float, Any] = {t_init: backtest(averaged(t_init=t_init), x_d, x) for t_init in (-1.0, 2.0)}
    assert not results[2.0].active[:2000].any()
    residual = float(np.sqrt(np.mean((x - results[2.0].x_pb)[1000:2000] ** 2)))
    assert 0.5 * residual < np.median(results[2.0].x_h_std[1000:2000]) < 2.0 * residual
    assert np.median(results[-1.0].x_h_std[1000:2000]) < 0.5 * residual
