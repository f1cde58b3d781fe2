"""The predictor with trust on random drives: as good as the physics model on each, far better on most."""

from __future__ import annotations

import numpy as np

from benchmarks.random_drives.generator import SEED, random_drives
from benchmarks.random_drives.replay import replay

N = 40


def test_no_drive_is_worse_than_by_physics() -> None:
    results = [replay(drive, "default") for drive in random_drives(range(N), SEED)]
    ratios = np.array([result.ratio for result in results])
    assert not any(result.diverged for result in results)
    assert ratios.max() <= 1.02, results[int(ratios.argmax())]
    assert np.median(ratios) <= 0.265
