"""Tuning on several logs: ranking, choice, processes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from predictor_cases import MODEL, small_signals

from hybridsep.base.settings import PredictorSettings
from hybridsep.fitting.tuning import Logs, Tuning, losses, tune, unsettled

PAPER = PredictorSettings(Np=20, p=5, q=2, lam=1e-9, averaging=False, t_init=0.0)
CANDIDATES = [PAPER, *(replace(PAPER, p=p, lam=lam) for p in (1, 20) for lam in (1e-10, 1e-6))]
LOGS: Logs = {
    name: [unsettled(*small_signals(n, seed=seed), PAPER.Np) for n, seed in pieces]
    for name, pieces in {"one": [(300, 0)], "two": [(130, 1), (90, 2)]}.items()
}


def of(rms_h: list[list[float]], rms_hold: list[float]) -> Tuning:
    """A tuning with given errors; the physics model's are 2."""
    settings = tuple(replace(PAPER, p=1 + i) for i in range(len(rms_h)))
    names = tuple(str(i) for i in range(len(rms_hold)))
    return Tuning(names, settings, np.full(len(rms_hold), 2.0), np.array(rms_hold), np.array(rms_h))


def test_each_log_is_replayed_untrained_and_ranked_by_the_geometric_mean() -> None:
    found = tune(MODEL, LOGS, CANDIDATES)
    for i, pieces in enumerate(LOGS.values()):
        alone = [losses(MODEL, (pieces, one)) for one in CANDIDATES]
        assert found.rms_h[:, i].tolist() == [one[2] for one in alone]
        assert (found.rms_pb[i], found.rms_hold[i]) == tuple(alone[0][:2])
    np.testing.assert_allclose(found.ratio, np.sqrt(np.prod(found.rms_h / found.rms_hold, axis=1)), rtol=1e-12)
    assert found.logs == ("one", "two")
    assert found.ranking == np.argsort(found.ratio, kind="stable").tolist()


def test_the_ranking_does_not_depend_on_the_size_of_a_log_or_its_baseline() -> None:
    errors = [[1.0, 8.0], [2.0, 2.0], [4.0, 1.5]]
    assert of(errors, [1.0, 1.0]).ranking == of([[a, 100 * b] for a, b in errors], [7.0, 0.1]).ranking == [1, 2, 0]


def test_the_own_settings_stay_unless_another_is_five_percent_better() -> None:
    assert of([[1.0], [0.96]], [1.0]).chosen == 0
    assert of([[1.0], [0.94]], [1.0]).chosen == 1
    assert of([[math.inf], [0.94]], [1.0]).chosen == 1
    assert of([[1.0], [math.inf]], [1.0]).chosen == 0
    assert of([[math.inf], [math.inf]], [1.0]).chosen == 0
    assert of([[math.inf], [math.inf]], [1.0]).alike == []
    assert of([[1.0], [0.96], [0.9], [0.94]], [1.0]).alike == [2, 3]
    assert of([[1.0, math.inf], [0.9, 1.0]], [1.0, 1.0]).n_diverged == 1


def test_a_log_that_hold_predicts_exactly_decides_alone() -> None:
    found = of([[0.0, 1.0], [1e-9, 0.5]], [0.0, 1.0])
    assert found.ratio.tolist() == [1.0, math.inf]
    assert of([[0.0, 1.0], [0.5, 0.5]], [1.0, 1.0]).ratio.tolist() == [0.0, 0.5]


@pytest.mark.slow
def test_the_result_is_the_same_for_any_number_of_processes() -> None:
    one, two = (tune(MODEL, LOGS, CANDIDATES, jobs=jobs) for jobs in (1, 2))
    np.testing.assert_array_equal(one.rms_h, two.rms_h)
    np.testing.assert_array_equal(one.rms_pb, two.rms_pb)
    np.testing.assert_array_equal(one.rms_hold, two.rms_hold)
