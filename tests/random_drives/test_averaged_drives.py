"""The predictor with averaging on random drives: as good as the physics model on each, far better on most."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from random_drives.generator import SEED, random_drives
from random_drives.replay import core_outputs

from benchmarks.random_drives import Replay, replay
from hybridsep.base.metrics import coverage
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

N, N_INTERVALS = 10, 8


@dataclass
class Replays:
    """Results of all drives; errors and standard deviations of those whose intervals are judged, m."""

    results: list[Replay] = field(default_factory=list)
    errors: list[Array] = field(default_factory=list)
    deviations: list[Array] = field(default_factory=list)

    def run(self, predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
        """Replay with the C core, the library's equal (``test_generator.py``), and keep what intervals need."""
        x_h, x_h_std = core_outputs(predictor, model, settings, x_d, x_meas, ("x_h", "x_h_std"))
        if len(self.errors) < N_INTERVALS:
            self.errors.append(x_meas - x_h)
            self.deviations.append(x_h_std)
        return np.asarray(x_h)


@pytest.fixture(scope="module")
def replays() -> Replays:
    found = Replays()
    found.results += [replay(drive, "default", found.run) for drive in random_drives(range(N), SEED)]
    return found


@pytest.mark.slow
def test_no_drive_is_worse_than_by_physics(replays: Replays) -> None:
    ratios = np.array([result.ratio for result in replays.results])
    assert len(ratios) == N
    assert not any(result.diverged for result in replays.results)
    assert ratios.max() <= 1.02, replays.results[int(ratios.argmax())]
    assert np.median(ratios) <= 0.265


@pytest.mark.slow
def test_intervals_cover_what_they_say(replays: Replays) -> None:
    """Pooled over 300 drives they do within 2 points (``benchmarks/intervals.py``); these are few."""
    errors, deviations = np.concatenate(replays.errors), np.concatenate(replays.deviations)
    for level in (0.5, 0.9, 0.95):
        assert coverage(errors, deviations, level) == pytest.approx(level, abs=0.05)
