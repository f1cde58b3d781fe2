"""Losses of candidates equal the errors of backtests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from predictor_cases import MODEL, Array, small_signals

from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.fitting.tuning import Piece, n_unjudged, replayed_losses
from hybridsep.predict.predictor import HybridPredictor

PAPER = PredictorSettings(Np=20, p=5, q=2, lam=1e-9, averaging=False, t_init=0.0)


def cut(n: int, *, start: float = 0.0, ends: Sequence[int] = ()) -> list[Piece]:
    """A log of n samples in pieces that end where ``ends`` says."""
    x_d, x = small_signals(n, start=start)
    edges = [0, *ends, n]
    return [(x_d[a:b], x[a:b]) for a, b in pairwise(edges)]


def one_by_one(pieces: Sequence[Piece], candidate: PredictorSettings) -> Array:
    """RMS of physics model, hold and hybrid over what is judged of all pieces, by a predictor of its own."""
    predictor, errors = HybridPredictor(MODEL, candidate), []
    for i, (x_d, x) in enumerate(pieces):
        if i:
            predictor.restart()
        try:
            found = backtest(predictor, x_d, x)
        except SignalError:
            return np.array([math.nan, math.nan, math.inf])
        errors.append((x - np.stack([found.x_pb, found.x_hold, found.x_h]))[:, n_unjudged(x_d, candidate.Np) :])
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
def test_losses_are_those_of_backtests(pieces: list[Piece], change: dict[str, Any]) -> None:
    candidate, done = replace(PAPER, **change), list[float]()
    found = replayed_losses(MODEL, pieces, candidate, done.append)
    np.testing.assert_allclose(found, one_by_one(pieces, candidate), rtol=1e-12)
    assert done == sorted(done)
    assert 0.0 <= done[0] <= done[-1] < 1.0


def test_a_candidate_that_diverges_has_an_infinite_loss() -> None:
    # A residual that grows by half in each sample trains an unstable recursion; a window of 800 samples overflows.
    x_d, x = small_signals(800)
    growing = [(x_d[:30], x_d[:30] + 1e-6 * 1.5 ** np.arange(30)), (x_d, x)]
    base = replace(PAPER, Np=800)
    found = [replayed_losses(MODEL, growing, one) for one in (replace(base, p=2), replace(base, p=1, lam=1e12))]
    assert np.isinf([one[2] for one in found]).tolist() == [True, False]
    assert np.isnan([one[0] for one in found]).tolist() == [True, False]


def test_missing_measurements_are_not_scored_with_averaging_and_refused_without() -> None:
    ((x_d, x),) = cut(200)
    x = x.copy()
    x[50:55] = np.nan
    averages = replace(PAPER, averaging=True)
    found = replayed_losses(MODEL, [(x_d, x)], averages)
    np.testing.assert_allclose(found[[0, 2]], one_by_one([(x_d, x)], averages)[[0, 2]], rtol=1e-12)
    with pytest.raises(SignalError, match="x must be finite, got nan at sample 50"):
        replayed_losses(MODEL, [(x_d, x)], PAPER)
    with pytest.raises(SignalError, match="x_d and x must have as many samples, at least one, got 200, 199"):
        replayed_losses(MODEL, [(x_d, x[:-1])], PAPER)
    with pytest.raises(SignalError, match="at least one, got 0, 0"):
        replayed_losses(MODEL, [(x_d[:0], x[:0])], PAPER)
