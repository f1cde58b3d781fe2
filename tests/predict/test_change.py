"""A plant that has changed before a warm run: told by likelihoods and errors, and relearned as fast as cold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from trusted_cases import PERIOD, cycles, friction, physics, run, trusted, trusted_model

from benchmarks.random_drives.generator import random_drive
from benchmarks.random_drives.simulation import simulate
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.regression import RidgeRegression
from hybridsep.predict.trust.change import DOUBTED, ChangeTest

NOISE = 1e-6  # m
NO_PENALTY = 1e-40


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def rows(weights: Array, n: int, rng: np.random.Generator) -> Array:
    """Return rows ``[Φ | target]`` with lags behind the static features, which the target does not depend on."""
    phi = rng.normal(size=(n, len(weights) + 2)) * np.array([1.0, 1e-3, 1e2, 1.0, 1.0])
    target = phi[:, : len(weights)] @ weights + 0.1 * rng.normal(size=n)
    return np.asfortranarray(np.column_stack((phi, target)))


def log_likelihood(stacked: Array, scales: Array, variance: float) -> float:
    """Return the logarithm of the targets' density, ``N(0, σ²I + Φ S² Φᵀ)``, from the matrix itself."""
    phi = stacked[:, : len(scales)] * scales
    return float(multivariate_normal(cov=variance * np.eye(len(phi)) + phi @ phi.T).logpdf(stacked[:, -1]))


@pytest.mark.parametrize("correlation", [1.0, 3.0])
@pytest.mark.parametrize("kept", [1.0, 0.25])
def test_its_ratio_is_that_of_the_densities(correlation: float, kept: float) -> None:
    rng, scales, weights = np.random.default_rng(1), np.array([2.0, 1e3, 1e-2]), np.array([1.5, -700.0, 0.02])
    earlier, later = rows(weights, 80, rng), rows(weights, 60, rng)
    regression = RidgeRegression(5, NO_PENALTY)
    regression.update_stacked(earlier.copy(order="F"))
    change = ChangeTest(regression, 80.0, (correlation,))
    change.learn(later.copy(order="F"))
    regression.update_stacked(later.copy(order="F"))
    for one in (change, regression):
        one.discount(kept)
    # A least variance above that of the residuals is the noise of both; rows that weigh less have more of it.
    variance = 0.02
    assert not change.has_changed(regression, scales, variance, variance, correlation)
    noise = variance * correlation / kept
    both, first, second = (
        log_likelihood(part, scales, noise) for part in (np.vstack((earlier, later)), earlier, later)
    )
    assert change.peak == pytest.approx(both - first - second, rel=1e-9)
    assert change.peak > 3.0
    assert (change.n_before, change.n_after) == (80.0 * kept, 60.0 * kept)


@pytest.mark.parametrize("seed", range(5))
def test_another_plant_is_told_from_the_same_one(seed: int) -> None:
    rng, weights = np.random.default_rng(seed), np.array([1.5, -700.0, 0.02])
    for factor, expected in ((1.0, False), (1.3, True)):
        regression = RidgeRegression(5, NO_PENALTY)
        regression.update_stacked(rows(weights, 300, rng))
        change, told = ChangeTest(regression, 300.0, (1.0,)), False
        for _ in range(20):
            window = rows(factor * weights, 30, rng)
            change.learn(window.copy(order="F"))
            regression.update_stacked(window)
            told |= change.has_changed(regression, np.array([2.0, 1e3, 1e-2]), 0.01, 1e-6, 1.0)
        assert told == expected


def two_runs() -> ChangeTest:
    """Return a comparison of 80 rows with 60 of another plant."""
    rng, weights = np.random.default_rng(1), np.array([1.5, -700.0, 0.02])
    regression = RidgeRegression(5, NO_PENALTY)
    regression.update_stacked(rows(weights, 80, rng))
    change = ChangeTest(regression, 80.0, (1.0,))
    change.learn(rows(1.2 * weights, 60, rng))
    return change


@pytest.mark.parametrize(
    ("errors", "n"),
    [
        ((4.0, 1.0, 100.0), 3),  # half the error: three windows
        ((1e9, 1.0, 1e10), 2),  # one window alone never tells, however much it says
        ((4.0, 1.0, 4.0), 4),  # counts by the part that the better one explains
        ((4.0, 1.0, 1.0), 4),  # or that is beyond the physics model's error
        ((1.1, 0.9, 1.0), 0),  # all alike
        ((1.1, 1.0, 100.0), 0),  # it fades faster than it grows
        ((1.0, 4.0, 100.0), 0),
        ((0.0, 0.0, 0.0), 0),
    ],
)
def test_less_weight_is_taken_when_it_is_better_for_some_windows(errors: tuple[float, float, float], n: int) -> None:
    change = two_runs()
    told = [change.is_doubted(*errors) for _ in range(40)]
    assert (told.index(True) + 1 if any(told) else 0) == n


def test_less_weight_is_not_taken_where_it_costs_more_than_it_gains() -> None:
    change = two_runs()
    assert not change.is_doubted(1e4, 2e4, 1e6)
    assert not any(change.is_doubted(4.0, 1.0, 100.0) for _ in range(30))
    assert any(change.is_doubted(4.0, 1.0, 100.0) for _ in range(60))  # by then the one window has faded


def test_less_weight_takes_more_evidence_where_the_likelihood_supports_one_plant() -> None:
    change = two_runs()
    change.log_ratio = 20.0
    assert not any(change.is_doubted(2.0, 1.4, 100.0) for _ in range(40))  # half as much evidence as is needed then
    change.log_ratio = 10.0
    assert change.is_doubted(2.0, 1.4, 100.0)
    change, told = two_runs(), []
    change.log_ratio = 20.0
    told = [change.is_doubted(4.0, 1.0, 100.0) for _ in range(10)]
    assert told.index(True) == 5  # the sixth window


def test_doubt_weighs_the_rows_of_earlier_runs() -> None:
    change, weighed = two_runs(), two_runs()
    tried = change.all_rows(DOUBTED).factor
    for _ in range(3):
        change.is_doubted(4.0, 1.0, 100.0)
    change.doubt()
    weighed.before.discount(DOUBTED)
    np.testing.assert_allclose(np.abs(tried), np.abs(weighed.all_rows().factor), rtol=1e-12, atol=1e-300)
    np.testing.assert_array_equal(tried, change.all_rows().factor)
    assert (change.n_before, change.n_after, change.n_carried) == (80.0 * DOUBTED, 60.0, 80.0)
    assert (change.evidence, change.errors, change.errors_with_less) == (0.0, 0.0, 0.0)
    for _ in range(5):
        assert not change.is_over
        change.doubt()
    change.doubt()
    assert change.is_over  # nothing of them is left


@pytest.mark.parametrize(("index", "most"), [(18, 1.02), (26, 1.02), (40, 1.02)])
def test_a_change_that_the_likelihood_does_not_tell_is_relearned(index: int, most: float) -> None:
    """A random drive whose frequencies have fallen by a tenth; from 2 s on a warm run was at 2.5, 1.95 and 3.8."""
    drive = random_drive(index)
    modes = [replace(mode, f_n=0.9 * mode.f_n, alpha=0.81 * mode.alpha) for mode in drive.true_model.modes]
    x = simulate([ModalModel(modes)], [drive.disturbances], [drive.x_d])[0]
    x_meas = x + drive.noise_std * np.random.default_rng(index).standard_normal(len(x))
    warm = HybridPredictor(drive.model)
    run(warm, drive.x_d, drive.x_meas)
    warm.restart()
    assert trusted_model(warm).change is not None
    error, cold = (rms((x_meas - run(one, drive.x_d, x_meas))[2000:]) for one in (warm, HybridPredictor(drive.model)))
    assert error <= most * cold


def learned(x_d: Array, e: Array) -> HybridPredictor:
    """Return a predictor after a run with residuals ``e``, about to begin another."""
    predictor = trusted()
    run(predictor, x_d, physics(x_d) + e + NOISE * np.random.default_rng(7).normal(size=len(x_d)))
    predictor.restart()
    return predictor


@pytest.mark.parametrize("factor", [-1.0, 0.2, 3.0])
def test_what_has_changed_is_relearned_as_fast_as_cold(factor: float) -> None:
    x_d = cycles(4 * PERIOD)
    x = physics(x_d) + factor * friction(x_d) + NOISE * np.random.default_rng(8).normal(size=len(x_d))
    warm = learned(x_d, friction(x_d))
    found, cold = run(warm, x_d, x), run(trusted(), x_d, x)
    late = slice(2000, None)
    assert rms((x - found)[late]) <= 1.02 * rms((x - cold)[late])
    assert trusted_model(warm).change is None
    assert trusted_model(warm).n_rows <= len(x_d)  # those of earlier runs are gone


def test_what_has_not_changed_keeps_what_was_learned() -> None:
    x_d = cycles(4 * PERIOD)
    x = physics(x_d) + friction(x_d) + NOISE * np.random.default_rng(8).normal(size=len(x_d))
    warm = learned(x_d, friction(x_d))
    carried = trusted_model(warm).n_rows
    found, cold = run(warm, x_d, x), run(trusted(), x_d, x)
    assert rms(x - found) < 1.1 * NOISE < 0.5 * rms(x - cold)
    assert trusted_model(warm).n_rows == pytest.approx(carried + len(x_d))


def test_the_comparison_ends_once_this_run_outweighs_the_earlier_ones() -> None:
    x_d = cycles(12 * PERIOD)
    e = friction(x_d)
    warm = learned(x_d[:PERIOD], e[:PERIOD])
    assert trusted_model(warm).change is not None
    run(warm, x_d[: 9 * PERIOD], (physics(x_d) + e)[: 9 * PERIOD])
    assert trusted_model(warm).change is not None
    run(warm, x_d[9 * PERIOD :], (physics(x_d) + e)[9 * PERIOD :])
    assert trusted_model(warm).change is None


def test_a_cold_run_compares_nothing() -> None:
    predictor = trusted()
    assert trusted_model(predictor).change is None
    run(predictor, cycles(300), physics(cycles(300)) + friction(cycles(300)))
    assert trusted_model(predictor).change is None
