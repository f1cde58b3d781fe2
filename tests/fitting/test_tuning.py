"""Tuning on logs: candidates, their losses, which equal the errors of backtests, ranking and choice, processes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from predictor_cases import MODEL, Array, small_signals

from hybridsep.base.errors import ParameterError, SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.fitting.choice import with_window
from hybridsep.fitting.replay import Recording
from hybridsep.fitting.tuning import TUNED, Logs, Tuning, candidates, default_values, losses, tune, unsettled
from hybridsep.predict.predictor import HybridPredictor

OWN = PredictorSettings(Np=100, p=50, q=3, lam=1e-12, averaging=False)
"""Settings of a machine."""

PAPER = PredictorSettings(Np=20, p=5, q=2, lam=1e-9, averaging=False, t_init=0.0)
"""Settings for logs of some hundred samples."""

# Candidates


def test_the_defaults_are_a_few_replays() -> None:
    assert 20 <= len(candidates(OWN, default_values(OWN))) <= 30
    averaging = replace(OWN, averaging=True)
    assert 10 <= len(candidates(averaging, default_values(averaging))) <= 20


@pytest.mark.parametrize("averaging", [False, True])
@pytest.mark.parametrize("Np", [1, 2, 19, 5000])
def test_all_fit_the_window_and_the_machines_own_come_first(Np: int, averaging: bool) -> None:
    own = replace(with_window(OWN, Np), averaging=averaging, forgetting=7.0)
    assert (own.p, own.q) == (min(50, Np), min(3, Np - 1))
    tried = candidates(own, default_values(own))
    assert tried[0] == own
    assert len(set(tried)) == len(tried)
    differing = {field for field in TUNED if len({getattr(one, field) for one in tried}) > 1}
    assert differing <= ({"p", "q", "forgetting"} if averaging else {"p", "q", "lam"})
    assert {replace(one, **{field: getattr(own, field) for field in TUNED}) for one in tried} == {own}


def test_the_least_penalty_that_is_allowed_bounds_the_defaults() -> None:
    least = replace(OWN, lam=1e-40)
    assert min(default_values(least)["lam"]) == 1e-40


@pytest.mark.parametrize(
    ("settings", "values", "words"),
    [
        (OWN, {"p": (5, 101)}, "p must be 1 … Np = 100, got 101; lower p or raise Np"),
        (OWN, {"q": (100,)}, "q must be 0 … Np − 1 = 99, got 100; lower q or raise Np"),
        (OWN, {"effect": (1e-5,)}, "effect has an effect with averaging only: set averaging = true, too"),
    ],
)
def test_what_does_not_fit_is_refused(settings: PredictorSettings, values: dict[str, list[float]], words: str) -> None:
    with pytest.raises(ParameterError) as refused:
        candidates(settings, values)
    assert str(refused.value) == words


# Losses


def cut(n: int, *, start: float = 0.0, ends: Sequence[int] = ()) -> list[Recording]:
    """A log of n samples in pieces that end where ``ends`` says."""
    x_d, x = small_signals(n, start=start)
    edges = [0, *ends, n]
    return [unsettled(x_d[a:b], x[a:b], PAPER.Np) for a, b in pairwise(edges)]


def one_by_one(pieces: Sequence[Recording], candidate: PredictorSettings) -> Array:
    """RMS of physics model, hold and hybrid over what is judged of all pieces, by a predictor of its own."""
    predictor, errors = HybridPredictor(MODEL, candidate), []
    for i, one in enumerate(pieces):
        x_d, x = one.x_d, one.x
        if i:
            predictor.restart()
        try:
            found = backtest(predictor, x_d, x)
        except SignalError:
            return np.array([math.nan, math.nan, math.inf])
        errors.append((x - np.stack([found.x_pb, found.x_hold, found.x_h]))[:, one.n_settling :])
    return np.asarray(np.sqrt(np.nanmean(np.concatenate(errors, axis=1) ** 2, axis=1)))


GAPS = cut(333, start=-2.0, ends=(101, 240))


@pytest.mark.parametrize(
    ("pieces", "change"),
    [
        (cut(313), {}),  # a short last window
        (cut(45, ends=(20,)), {}),
        (cut(7), {}),
        *((GAPS, change) for change in ({}, {"t_init": 0.05}, {"averaging": True}, {"p": 20, "q": 19})),
    ],
)
def test_losses_are_those_of_backtests(pieces: list[Recording], change: dict[str, Any]) -> None:
    candidate = replace(PAPER, **change)
    np.testing.assert_allclose(losses(MODEL, (pieces, candidate)), one_by_one(pieces, candidate), rtol=1e-12)


def test_a_candidate_that_diverges_has_an_infinite_loss() -> None:
    # A residual that grows by half in each sample trains an unstable recursion; a window of 800 samples overflows.
    x_d, x = small_signals(800)
    growing = [Recording(x_d[:30], x_d[:30] + 1e-6 * 1.5 ** np.arange(30), 0), Recording(x_d, x, 0)]
    base = replace(PAPER, Np=800)
    found = [losses(MODEL, (growing, one)) for one in (replace(base, p=2), replace(base, p=1, lam=1e12))]
    assert np.isinf([one[2] for one in found]).tolist() == [True, False]
    assert np.isnan([one[0] for one in found]).tolist() == [True, False]


def test_missing_measurements_are_not_scored() -> None:
    [one] = cut(200)
    x = one.x.copy()
    x[50:55] = np.nan
    missing = [replace(one, x=x)]
    averages = replace(PAPER, averaging=True)
    found = losses(MODEL, (missing, averages))
    np.testing.assert_allclose(found[[0, 2]], one_by_one(missing, averages)[[0, 2]], rtol=1e-12)


# Ranking

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
