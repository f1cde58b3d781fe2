"""Experiment of stacked experts: what it is compared with, and that its rules do what they say."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.experts.model import Constants, Experts, Stack
from benchmarks.random_drives.generator import random_drive
from hybridsep.base.metrics import hold, rms
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor


def test_a_drive_is_predicted_better_than_by_physics_and_hold() -> None:
    drive = random_drive(3, 11)
    experts = Experts(drive.model, drive.settings)
    x_h, x_pb, predicted = experts.replay(drive.x_d, drive.x_meas)
    np.testing.assert_allclose(x_pb, backtest(HybridPredictor(drive.model), drive.x_d, drive.x_meas).x_pb, atol=1e-12)
    held = hold(x_pb, drive.x_meas, np.ones(len(x_pb), dtype=np.bool_), drive.settings.Np)
    np.testing.assert_allclose(x_pb + predicted[0], held, rtol=0, atol=1e-15)
    assert rms(drive.x_meas - x_h) < 0.6 * min(rms(drive.x_meas - x_pb), rms(drive.x_meas - held))
    again, _, _ = experts.replay(drive.x_d, drive.x_meas)
    assert rms(drive.x_meas - again) < rms(drive.x_meas - x_h)


@pytest.mark.parametrize("best", [0, 1, 2, 3])
def test_the_stack_finds_the_best_expert(best: int) -> None:
    rng, constants = np.random.default_rng(best), Constants()
    stack = Stack(constants)
    np.testing.assert_array_equal(stack.weights, list(constants.first.values()))
    for _ in range(30):
        e = rng.normal(size=100)
        predicted = rng.normal(size=(4, 100))
        predicted[best] = e + 0.1 * rng.normal(size=100)
        stack.update(predicted, e, 0.0)
    assert stack.weights[best] > 0.95
    assert stack.weights.sum() <= 1.0 + 1e-12
