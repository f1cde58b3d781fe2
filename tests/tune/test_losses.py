"""Losses of many candidates from one pass: those of backtests one by one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from predictor_cases import MODEL, Array, small_signals

from hybridsep.base.errors import ParameterError, SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.evaluate.backtest import backtest
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.tune.losses import Piece, n_unjudged, nested_losses, replayed_losses

PAPER = PredictorSettings(Np=20, p=5, q=2, lam=1e-9, trust=False, t_init=0.0)


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


def agree(pieces: Sequence[Piece], candidates: Sequence[PredictorSettings]) -> Array:
    """Compare the losses of a pass with those of backtests; return the latter."""
    found = nested_losses(MODEL, pieces, candidates)
    expected = np.array([one_by_one(pieces, one) for one in candidates])
    baselines = expected[np.isfinite(expected[:, 2])][0, :2]
    np.testing.assert_allclose([found.rms_pb, found.rms_hold], baselines, rtol=1e-12)
    np.testing.assert_allclose(found.rms_h, expected[:, 2], rtol=1e-9)
    return expected


@pytest.mark.parametrize(
    "pieces",
    [cut(613), cut(600, start=0.3), cut(613, start=-2.0, ends=(101, 340)), cut(45, ends=(20,)), cut(7)],
    ids=["a short last window", "start offset", "gaps", "few windows", "less than a window"],
)
@pytest.mark.parametrize("t_init", [0.0, 0.03, 0.2])
def test_losses_are_those_of_backtests(pieces: list[Piece], t_init: float) -> None:
    base = replace(PAPER, t_init=t_init)
    lags = [(1, 0), (1, 19), (20, 0), (20, 19), (5, 2), (6, 2), (13, 1)]
    agree(pieces, [replace(base, p=p, q=q, lam=lam) for lam in (1e-11, 1e-9, 1e-3) for p, q in lags])


def test_candidates_may_come_in_any_order_and_need_no_grid() -> None:
    rng = np.random.default_rng(3)
    candidates = [
        replace(PAPER, p=int(rng.integers(1, 21)), q=int(rng.integers(0, 20)), lam=float(10.0 ** rng.integers(-10, -4)))
        for _ in range(300)
    ]
    found = nested_losses(MODEL, cut(200), candidates)
    alone = [nested_losses(MODEL, cut(200), [one]).rms_h[0] for one in candidates[:20]]
    np.testing.assert_allclose(found.rms_h[:20], alone, rtol=1e-9)
    assert len(set(found.rms_h.tolist())) > 200


@settings(max_examples=40, deadline=None)
@given(
    data=st.data(), Np=st.integers(1, 9), n=st.integers(1, 80), start=st.floats(-1.0, 1.0), t_init=st.floats(0, 0.05)
)
def test_losses_of_small_logs_are_those_of_backtests(
    data: st.DataObject, Np: int, n: int, start: float, t_init: float
) -> None:
    lags = st.tuples(st.integers(1, Np), st.integers(0, Np - 1), st.sampled_from([1e-9, 1e-7, 1e-4, 1.0]))
    tried = data.draw(st.lists(lags, min_size=1, max_size=6))
    end = data.draw(st.integers(1, n))
    base = replace(PAPER, Np=Np, p=1, q=0, t_init=t_init)
    agree(
        cut(n, start=start, ends=(end,) if end < n else ()), [replace(base, p=p, q=q, lam=lam) for p, q, lam in tried]
    )


def test_a_candidate_that_diverges_has_an_infinite_loss_and_the_others_theirs() -> None:
    # A residual that grows by half in each sample teaches an unstable recursion; a window of 800 samples overflows.
    x_d, x = small_signals(800)
    growing = [(x_d[:30], x_d[:30] + 1e-6 * 1.5 ** np.arange(30)), (x_d, x)]
    base = replace(PAPER, Np=800)
    candidates = [replace(base, p=2), replace(base, p=1, lam=1e12), replace(base, p=1), replace(base, p=30, lam=1e6)]
    expected = np.array([one_by_one(growing, one)[2] for one in candidates])
    assert np.isinf(expected).tolist() == [True, False, True, False]
    found = nested_losses(MODEL, growing, candidates)
    np.testing.assert_allclose(found.rms_h, expected, rtol=1e-9)
    assert math.isfinite(found.rms_pb)
    assert math.isfinite(found.rms_hold)
    alone = replayed_losses(MODEL, growing, candidates[0])
    assert np.isinf(alone.rms_h).all()
    assert math.isnan(alone.rms_pb)


def test_what_cannot_share_a_pass_is_replayed_with_the_same_losses() -> None:
    pieces = cut(230, ends=(101,))
    for candidate in (PAPER, replace(PAPER, trust=True), replace(PAPER, v_friction=1e-3), replace(PAPER, t_init=0.05)):
        done: list[float] = []
        found = replayed_losses(MODEL, pieces, candidate, done.append)
        expected = one_by_one(pieces, candidate)
        np.testing.assert_allclose([found.rms_pb, found.rms_hold, *found.rms_h], expected, rtol=1e-12)
        assert done == sorted(done)
        assert 0.0 <= done[0] < done[-1] < 1.0
    for others in (
        [PAPER, replace(PAPER, t_init=0.1)],
        [replace(PAPER, trust=True)],
        [replace(PAPER, v_friction=1e-3)],
        [replace(PAPER, measurement_delay=2)],
    ):
        with pytest.raises(
            ParameterError, match="must have trust = false and no delay, and differ in p, q and lambda only"
        ):
            nested_losses(MODEL, pieces, others)


def test_missing_measurements_are_not_scored_with_trust_and_refused_without() -> None:
    ((x_d, x),) = cut(200)
    x = x.copy()
    x[50:55] = np.nan
    trusting = replace(PAPER, trust=True)
    found = replayed_losses(MODEL, [(x_d, x)], trusting)
    np.testing.assert_allclose([found.rms_pb, *found.rms_h], one_by_one([(x_d, x)], trusting)[[0, 2]], rtol=1e-12)
    with pytest.raises(SignalError, match="x must be finite, got nan at sample 50"):
        nested_losses(MODEL, [(x_d, x)], [PAPER])
    with pytest.raises(SignalError, match="x_d and x must have as many samples, at least one, got 200, 199"):
        nested_losses(MODEL, [(x_d, x[:-1])], [PAPER])
    with pytest.raises(SignalError, match="at least one, got 0, 0"):
        replayed_losses(MODEL, [(x_d[:0], x[:0])], PAPER)
