"""The residual model with averaging: what it predicts of known residuals, and what it never does."""

import math

import numpy as np
import pytest
from predictor_cases import FRICTION, MODEL, PERIOD, averaged, averaged_model, cycles, friction, physics, run

from hybridsep.base.errors import ParameterError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.predict.averaging.constants import CONSTANTS
from hybridsep.predict.averaging.experts import ARX_COMMAND, ARX_RESIDUAL, HOLD, MODEL_RESIDUAL, STATIC
from hybridsep.predict.averaging.model import AveragedForecast
from hybridsep.predict.predictor import HybridPredictor

NOISE = 1e-7  # m


def with_friction(n: int, noise: float = NOISE) -> tuple[Array, Array, Array]:
    """Return a command to and fro, the physics model's response, and a position off it by friction and noise."""
    x_d = cycles(n)
    x_pb = physics(x_d)
    return x_d, x_pb, x_pb + friction(x_d) + noise * np.random.default_rng(0).normal(size=n)


def test_a_residual_that_is_a_feature_is_predicted_to_the_noise() -> None:
    x_d, x_pb, x = with_friction(4 * PERIOD)
    x_h = run(averaged(), x_d, x)
    seen = slice(2 * PERIOD, None)
    assert rms((x - x_pb)[seen]) > 100 * NOISE
    assert rms((x - x_h)[seen]) < 1.15 * NOISE


def test_what_was_learned_is_kept_while_the_velocity_grows() -> None:
    """Otherwise only physics is left in the window whose velocity outgrows the first window's."""
    k = np.arange(4500.0)
    x_d = np.asarray(5e-3 * (k / 4500.0) ** 1.8 * np.sin(2.0 * np.pi * 2e-3 * k))
    velocity = np.abs(np.diff(x_d))
    assert 500.0 < velocity.max() / velocity[:100].max() < CONSTANTS.velocity_jump
    x_pb = physics(x_d)
    x = x_pb + friction(x_d) + NOISE * np.random.default_rng(0).normal(size=len(k))
    x_h = run(averaged(), x_d, x)
    for window in range(25, 45):
        seen = slice(100 * window, 100 * (window + 1))
        assert rms((x - x_h)[seen]) < 0.5 * rms((x - x_pb)[seen]), window


def test_the_rounding_of_a_command_at_rest_is_outgrown() -> None:
    """Without that, it would set the scale of the friction's velocities for the whole run."""
    x_d, _, x = with_friction(2 * PERIOD)
    x_d = np.concatenate((np.zeros(500), x_d)) + 1e-12 * np.random.default_rng(2).normal(size=500 + len(x_d))
    x = np.concatenate((np.zeros(500), x))
    predictor = averaged()
    run(predictor, x_d[:500], x[:500])
    assert 0.0 < averaged_model(predictor).learned.velocity_scale < 1e-8
    x_h = run(predictor, x_d[500:], x[500:])
    assert averaged_model(predictor).learned.velocity_scale > 1e-2
    assert rms((x[500:] - x_h)[PERIOD:]) < 10 * NOISE


@pytest.mark.parametrize(("rate", "grown"), [(1.03, 400), (1.06, 200)])
def test_an_unstable_recursion_is_bounded_by_the_residuals_so_far(rate: float, grown: int) -> None:
    """A residual that grows, and then no more: without bounds the learned recursion goes on growing."""
    x_d = cycles(1000)
    x_pb = physics(x_d)
    e = 1e-9 * rate ** np.minimum(np.arange(1000.0), grown)
    x = x_pb + e
    paper, predictor = HybridPredictor(MODEL, PredictorSettings(averaging=False, t_init=0.0)), averaged()
    runaway = 0.0
    for k in range(0, 1000, 100):
        window, largest = slice(k, k + 100), np.abs(e[:k]).max(initial=0.0)
        e_h = predictor.predict(x_d[window]).e_h
        assert np.abs(e_h).max() <= 1.2 * largest * (1 + 1e-9)
        runaway = max(runaway, float(np.abs(paper.predict(x_d[window]).e_h).max() / max(largest, 1e-9)))
        for one in (paper, predictor):
            one.update(x[window])
    assert runaway > 2.0


@pytest.mark.parametrize("start", [0.0, 0.3])
def test_without_a_residual_nothing_is_predicted(start: float) -> None:
    predictor, x_d = averaged(), start + cycles(1500)
    for k in range(0, 1500, 100):
        prediction = predictor.predict(x_d[k : k + 100])
        assert np.abs(prediction.e_h).max() <= 1e-15 * start  # rounding
        predictor.update(prediction.x_pb)


@pytest.mark.parametrize("size", [1e-3, 1e3])
@pytest.mark.parametrize("given", [{}, {"effect": 1e-5, "noise_std": 2e-6, "forgetting": 1.0}], ids=["own", "given"])
def test_any_unit_gives_the_same(size: float, given: dict[str, float]) -> None:
    x_d, _, x = with_friction(2500, noise=1e-6)
    scaled = {name: value * (1.0 if name == "forgetting" else size) for name, value in given.items()}
    x_h = run(averaged(**given), x_d, x)
    found = run(averaged(lam=1e-12 * size**2, **scaled), size * x_d, size * x)
    np.testing.assert_allclose(found / size, x_h, rtol=0, atol=1e-6 * np.abs(x_h - physics(x_d)).max())


def test_a_first_reversal_falls_back() -> None:
    """Where friction turns, what was seen in one direction does not make it worse than the physics model."""
    t = np.arange(2000)
    x_d = 2e-5 * np.minimum(t, 2000 - t)  # to and back at 20 mm/s
    x_pb = physics(x_d)
    x = x_pb + friction(x_d) + NOISE * np.random.default_rng(1).normal(size=2000)
    predictor = averaged()
    x_h = run(predictor, x_d, x)
    turned, later = slice(1000, 1100), slice(1800, 2000)
    assert rms((x - x_h)[900:1000]) < 0.2 * rms((x - x_pb)[900:1000])
    assert rms((x - x_h)[turned]) < rms((x - x_pb)[turned])
    assert rms((x - x_h)[later]) < 0.2 * rms((x - x_pb)[later])


@pytest.mark.slow
@pytest.mark.parametrize(("n", "measured"), [(37, None), (100, 30)])
def test_windows_of_other_lengths(n: int, measured: int | None) -> None:
    """What is learned does not depend on the windows: there is one row for each measured sample."""
    x_d, x_pb, x = with_friction(600, noise=1e-6)
    usual, other = averaged(Np=60, p=20), averaged(Np=60, p=20)
    run(usual, x_d, x, 60)
    x_h = run(other, x_d, x, n, measured)
    assert other.k == usual.k == 600
    assert np.abs(x_h - x_pb).max() <= 1.2 * np.abs(x - x_pb).max()
    assert rms((x - x_h)[300:]) < 0.5 * rms((x - x_pb)[300:])
    mine, yours = other.regression.factor, usual.regression.factor
    size = np.sqrt(np.diag(yours.T @ yours))
    np.testing.assert_allclose(mine.T @ mine / np.outer(size, size), yours.T @ yours / np.outer(size, size), atol=1e-9)


def test_what_is_not_learned_is_where_the_next_window_starts() -> None:
    x_d, x_pb, x = with_friction(300)
    predictor = averaged()
    run(predictor, x_d[:200], x[:200])
    before, n_rows = predictor.regression.factor, predictor.regression.n_rows
    predictor.predict(x_d[200:])
    predictor.update(x[200:], learn=False)
    np.testing.assert_array_equal(predictor.regression.factor, before)
    assert (predictor.regression.n_rows, predictor.k) == (n_rows, 300)
    assert predictor.residual.last == pytest.approx(x[-1] - x_pb[-1], abs=1e-15)


def test_what_is_held_is_bounded_by_what_was_learned() -> None:
    """The last residual may not have been learned; the expert that holds it predicts 1.2 times the largest one."""
    x_d = np.linspace(0.0, 3e-2, 3000)
    rng = np.random.default_rng(5)
    x = physics(x_d) + 1e-5 + np.cumsum(1e-7 * rng.normal(size=3000))  # an offset that drifts, which a hold predicts
    predictor = averaged()
    run(predictor, x_d[:2900], x[:2900])
    assert averaged_model(predictor).learned.stack.weights[0] > 0.25
    averaged_model(predictor).run.past[MODEL_RESIDUAL][0] = 1.0
    largest = averaged_model(predictor).learned.scales[MODEL_RESIDUAL].largest
    assert np.abs(predictor.predict(x_d[2900:]).e_h).max() <= 1.2 * (1.0 + 1e-12) * largest < 1e-4


@pytest.mark.parametrize("direction", [-1.0, 0.0, 1.0])
def test_nothing_is_held_where_the_command_turns(direction: float) -> None:
    """Friction of one direction looks like an offset, which after a reversal is twice as wrong as nothing."""
    steps = 1e-5 * np.concatenate((np.ones(500), np.zeros(1250), np.full(50, direction)))
    x_d, predictor = np.cumsum(steps), averaged()
    run(predictor, x_d[:1700], physics(x_d)[:1700] + FRICTION)
    predictor.predict(x_d[1700:])
    pending = predictor.pending
    assert pending is not None
    assert isinstance(pending.forecast, AveragedForecast)
    held = pending.forecast.stacked[HOLD.place]
    np.testing.assert_allclose(held[:50], FRICTION, rtol=1e-3)
    np.testing.assert_allclose(held[60:75], 0.0 if direction < 0.0 else FRICTION, rtol=1e-3, atol=1e-12)


@pytest.mark.slow
def test_a_changed_drive_is_relearned_where_samples_lose_their_weight() -> None:
    x_d = cycles(12 * PERIOD)
    x_pb, changed = physics(x_d), 6 * PERIOD
    e = friction(x_d)
    e[changed:] *= -3.0
    true = x_pb + e
    x = true + 1e-6 * np.random.default_rng(2).normal(size=len(x_d))
    kept, faded = run(averaged(), x_d, x), run(averaged(forgetting=0.3), x_d, x)
    late = slice(changed + 4 * PERIOD, None)
    assert rms((true - faded)[late]) < 0.7 * rms((true - kept)[late])
    assert rms((true - faded)[late]) < 1.3e-6


def test_the_noise_that_is_given_is_that_of_the_experts() -> None:
    x_d, _, x = with_friction(1000, noise=1e-6)
    predictor = averaged(noise_std=3e-6)
    run(predictor, x_d, x)
    learned = averaged_model(predictor).learned
    assert [learned.errors_of(i).noise_variance for i in (ARX_RESIDUAL, STATIC, ARX_COMMAND)] == [
        pytest.approx(9e-12)
    ] * 3
    estimated = averaged()
    run(estimated, x_d, x)
    for i in (ARX_RESIDUAL, STATIC):
        assert math.sqrt(averaged_model(estimated).learned.errors_of(i).noise_variance) == pytest.approx(1e-6, rel=0.3)


def test_an_effect_that_is_given_bounds_what_features_explain() -> None:
    x_d, _, x = with_friction(1500, noise=1e-6)
    usual, little = run(averaged(effect=FRICTION), x_d, x), run(averaged(effect=1e-12), x_d, x)
    last = slice(1000, None)
    assert rms((x - usual)[last]) < 1.5e-6
    assert rms((x - little)[last]) > 2.0 * rms((x - usual)[last])


@pytest.mark.parametrize(("t_init", "n_init"), [(-1.0, 0), (0.0, 0), (0.25, 250)])
def test_warm_up(t_init: float, n_init: int) -> None:
    x_d, x_pb, x = with_friction(600)
    predictor = averaged(t_init=t_init)
    assert predictor.n_init == n_init
    x_h = run(predictor, x_d, x)
    np.testing.assert_allclose(x_h[:n_init], x_pb[:n_init], rtol=0, atol=1e-16)
    assert np.abs((x_h - x_pb)[max(n_init, 100) :]).min() > 1e-12
    predictor.restart()
    assert predictor.predict(x_d[:100]).active.all()


def test_a_rest_trains_nothing_of_a_motion() -> None:
    """Long at rest with an offset, then the first motion: it starts again, from the physics model."""
    x_d = np.concatenate((np.zeros(2000), cycles(3000)))
    rng = np.random.default_rng(4)
    x_pb = physics(x_d)
    x = x_pb + np.where(np.arange(5000) < 2000, 3e-6, friction(x_d)) + NOISE * rng.normal(size=5000)
    predictor = averaged()
    x_h = run(predictor, x_d[:2000], x[:2000])
    assert rms((x[:2000] - x_h)[1000:]) < 1.2 * NOISE
    first = predictor.predict(x_d[2000:2100])
    assert np.abs(first.e_h).max() <= 1.2 * 3e-6 + 6 * NOISE
    later = run(predictor, x_d[2000:], x[2000:])
    assert rms((x[2000:] - later)[2000:]) < 2.0 * NOISE


def test_an_operator_is_refused() -> None:
    with pytest.raises(ParameterError, match="needs the paper's model, averaging = false"):
        averaged().operator()
