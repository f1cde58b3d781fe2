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
from hybridsep.fitting.replay import Recording
from hybridsep.fitting.tuning import losses, unsettled
from hybridsep.predict.predictor import HybridPredictor

PAPER = PredictorSettings(Np=20, p=5, q=2, lam=1e-9, averaging=False, t_init=0.0)


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
