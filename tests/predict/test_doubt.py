"""A plant that has changed before a warm run: an expert that doubts earlier runs tells, and they are forgotten."""

from dataclasses import replace

import numpy as np
import pytest
from predictor_cases import PERIOD, TS, averaged, averaged_model, change_learned, cycles, friction, physics, run
from random_drives.generator import SEED, Recipe
from random_drives.simulation import simulate

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.predict.averaging.constants import CONSTANTS
from hybridsep.predict.averaging.experts import (
    ARX_COMMAND,
    ARX_RESIDUAL,
    EXPERTS,
    FRESH_START,
    MODEL_RESIDUAL,
    Regression,
)
from hybridsep.predict.averaging.model import AveragedModel
from hybridsep.predict.averaging.stacking import Stack
from hybridsep.predict.predictor import HybridPredictor

NOISE = 1e-6  # m


def learned(x_d: Array, e: Array) -> HybridPredictor:
    """Return a predictor after a run with residuals ``e``, about to begin another."""
    predictor = averaged()
    run(predictor, x_d, physics(x_d) + e + NOISE * np.random.default_rng(7).normal(size=len(x_d)))
    predictor.restart()
    return predictor


@pytest.mark.parametrize("factor", [-1.0, 0.2, 3.0])
def test_what_has_changed_is_relearned_as_cold(factor: float) -> None:
    x_d = cycles(4 * PERIOD)
    x = physics(x_d) + factor * friction(x_d) + NOISE * np.random.default_rng(8).normal(size=len(x_d))
    warm = learned(x_d, friction(x_d))
    found, cold = run(warm, x_d, x), run(averaged(), x_d, x)
    assert rms((x - found)[2000:]) <= 1.03 * rms((x - cold)[2000:])
    model = averaged_model(warm)
    assert not model.doubts
    assert model.learned.stack.weights[FRESH_START.place] == 0.0
    assert model.evidence[MODEL_RESIDUAL].n_rows == len(x_d)


def test_what_has_not_changed_keeps_what_was_learned() -> None:
    x_d = cycles(4 * PERIOD)
    x = physics(x_d) + friction(x_d) + NOISE * np.random.default_rng(8).normal(size=len(x_d))
    warm = learned(x_d, friction(x_d))
    carried = averaged_model(warm).evidence[MODEL_RESIDUAL].n_rows
    found, cold = run(warm, x_d, x), run(averaged(), x_d, x)
    assert rms(x - found) < 1.15 * NOISE < 0.5 * rms(x - cold)
    assert averaged_model(warm).evidence[MODEL_RESIDUAL].n_rows == pytest.approx(carried + len(x_d))


def test_what_was_learned_outlasts_a_motion_much_faster_than_the_first() -> None:
    """The scale of an earlier run's first creep says nothing of what was learned after it."""
    x_d = cycles(4 * PERIOD)
    warm = learned(x_d, friction(x_d))
    fastest = float(np.abs(np.diff(x_d)).max()) / TS
    change_learned(warm, velocity_scale=fastest / (2.0 * CONSTANTS.velocity_jump))
    carried = averaged_model(warm).evidence[MODEL_RESIDUAL].n_rows
    run(warm, x_d[:100], (physics(x_d) + friction(x_d))[:100])
    assert averaged_model(warm).evidence[MODEL_RESIDUAL].n_rows == pytest.approx(carried + 100)


@pytest.mark.parametrize("moves", [False, True])
def test_earlier_runs_are_forgotten_where_a_run_has_shown_something(moves: bool) -> None:
    """A run at rest shows little beside the largest residual: its noise may decide for the expert that doubts."""
    x_d = cycles(4 * PERIOD)
    warm = learned(x_d, friction(x_d, 200 * NOISE))
    assert averaged_model(warm).leading == ARX_RESIDUAL
    largest = np.sqrt(averaged_model(warm).learned.scales[MODEL_RESIDUAL].largest_square)
    measured = largest * np.sin(np.arange(100.0))
    predicted = np.zeros((len(EXPERTS), 100))
    predicted[FRESH_START.place], predicted[ARX_RESIDUAL.place] = measured, measured - 0.3 * largest
    stack = Stack.init()
    for _ in range(20):
        stack = stack.update(predicted, measured, NOISE**2)
    assert stack.weights[FRESH_START.place] > CONSTANTS.discard_above
    change_learned(warm, stacks=(stack, stack))
    x_d, x = (one[:PERIOD] * moves for one in (x_d, physics(x_d) + friction(x_d, 200 * NOISE)))
    run(warm, x_d, x + NOISE * np.random.default_rng(9).normal(size=PERIOD))
    assert averaged_model(warm).doubts != moves


def assert_doubts(model: AveragedModel, leading: Regression) -> None:
    """Assert that the expert that doubts begins with the evidence of the one that led."""
    stack, fresh, led = model.learned.stack, FRESH_START.place, leading.place
    assert model.doubts
    assert stack.gram[fresh, fresh] == stack.gram[led, led] > 0.0
    assert stack.cross[fresh] == stack.cross[led]
    assert model.learned.errors_of(FRESH_START).noise_variance == model.learned.errors_of(leading).noise_variance > 0.0


def test_doubt_begins_with_little_of_earlier_runs_and_the_evidence_of_the_expert_it_doubts() -> None:
    x_d = cycles(2 * PERIOD)
    model = averaged_model(learned(x_d, friction(x_d)))
    evidence, weight = model.evidence[MODEL_RESIDUAL], CONSTANTS.warm_prior_weight
    assert evidence.all(weight).n_rows == pytest.approx(weight * evidence.n_rows)
    assert_doubts(model, ARX_RESIDUAL)


@pytest.mark.slow
def test_the_commands_expert_is_doubted_where_it_led() -> None:
    """On a plant whose frequencies fall by a tenth: where only arx_residual is doubted, it has 3.3 times the error."""
    drawn = Recipe.draw(35, SEED)
    recipe = replace(drawn, x_d=drawn.x_d[:4000], noise=drawn.noise[:4000])
    model = recipe.true.model
    modes = [replace(mode, f_n=0.9 * mode.f_n, alpha=0.81 * mode.alpha) for mode in model.modes]
    before, x = simulate([model, ModalModel(modes)], 2 * [recipe.disturbances], 2 * [recipe.x_d])
    drive = recipe.drive(before)
    x_meas = x + recipe.noise_std * np.random.default_rng(35).standard_normal(len(x))
    warm = HybridPredictor(drive.model)
    run(warm, drive.x_d, drive.x_meas)
    warm.restart()
    learned_by = averaged_model(warm)
    assert learned_by.leading == ARX_COMMAND
    assert_doubts(learned_by, ARX_COMMAND)
    error, cold = (rms((x_meas - run(one, drive.x_d, x_meas))[2000:]) for one in (warm, HybridPredictor(drive.model)))
    assert error <= 1.8 * cold
    assert not averaged_model(warm).doubts


def test_a_cold_run_doubts_nothing() -> None:
    predictor = averaged()
    assert not averaged_model(predictor).doubts
    run(predictor, cycles(300), physics(cycles(300)) + friction(cycles(300)))
    assert not averaged_model(predictor).doubts
    assert averaged_model(predictor).learned.errors_of(ARX_COMMAND).noise_variance > 0.0
