"""The predictor with trust on random drives: as good as the physics model on each, far better on most."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.random_drives.generator import SEED, random_drives
from benchmarks.random_drives.replay import replay
from hybridsep.base.metrics import coverage
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor

N, N_INTERVALS = 40, 8


def test_no_drive_is_worse_than_by_physics() -> None:
    results = [replay(drive, "default") for drive in random_drives(range(N), SEED)]
    ratios = np.array([result.ratio for result in results])
    assert not any(result.diverged for result in results)
    assert ratios.max() <= 1.02, results[int(ratios.argmax())]
    assert np.median(ratios) <= 0.265


def test_intervals_cover_what_they_say() -> None:
    """Pooled over 300 drives they do within 2 points (``benchmarks/intervals.py``); these are few."""
    errors, deviations = [], []
    for drive in random_drives(range(N_INTERVALS), SEED):
        result = backtest(HybridPredictor(drive.model), drive.x_d, drive.x_meas)
        errors.append(drive.x_meas - result.x_h)
        deviations.append(result.x_h_std)
    for level in (0.5, 0.9, 0.95):
        assert coverage(np.concatenate(errors), np.concatenate(deviations), level) == pytest.approx(level, abs=0.05)
