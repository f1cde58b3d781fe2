"""Losses of many candidates on one log: RMS errors of causal replays, as ``evaluate.backtest`` scores them.

Candidates of the paper's model that differ in p, q and λ share one pass. With trust each has a pass of its own: what it
learns depends on its own predictions, as a window that surprises lowers the weight of all rows, and its features on the
velocity and the scales found on the way, so no factor is common to two candidates.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import ParameterError, SignalError
from ..base.settings import PredictorSettings, samples_before
from ..base.signals import PREDICTION_MAX, Array, as_measured, as_samples
from ..base.threads import one_blas_thread
from ..evaluate.backtest import Batch, backtest_stream
from ..intake.motion import starts_in_motion
from ..model.physics import ModalModel
from ..predict.paper.features import PastSamples
from ..predict.predictor import HybridPredictor
from .free_runs import free_runs
from .nested import NestedRidge

__all__ = ["Losses", "Piece", "n_unjudged", "nested_losses", "replayed_losses", "share_a_pass"]

Piece = tuple[Array, Array]
"""Commanded and measured positions of a part of a log without a gap, ``(n,)`` each, m."""

Progress = Callable[[float], object]

_AT_ONCE = 100_000
"""Samples that are checked and replayed at once."""


@dataclass(frozen=True)
class Losses:
    """RMS errors against the measured position over a log, m; those of a backtest without :func:`n_unjudged` samples.

    Attributes
    ----------
    rms_pb, rms_hold : float
        Physics model, hold baseline.
    rms_h : (n_candidates,) array
        Hybrids; infinite where the prediction diverges.
    """

    rms_pb: float
    rms_hold: float
    rms_h: Array


def share_a_pass(candidates: Sequence[PredictorSettings]) -> bool:
    """Return whether candidates are of the paper's model, without a delay, and differ in p, q and λ only."""
    common = {replace(one, p=1, q=0, lam=1.0) for one in candidates}
    one = candidates[0]
    return len(common) == 1 and not one.trust and one.v_friction == 0.0 and one.measurement_delay == 0


def n_unjudged(x_d: Array, Np: int) -> int:
    """Return how many leading samples of a piece are not scored: the first window, if the piece begins in motion.

    No model knows the state of the axis there, so that its error says nothing of a candidate and rules the RMS.
    """
    return Np if len(x_d) > Np and starts_in_motion(x_d) else 0


@one_blas_thread
def nested_losses(
    model: ModalModel,
    pieces: Sequence[Piece],
    candidates: Sequence[PredictorSettings],
    progress: Progress = lambda _done: None,
) -> Losses:
    """Return the losses of candidates that :func:`share_a_pass`; memory does not grow with the log.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``.
    pieces : sequence of pairs ``(x_d, x)`` of (n,) arrays, m
        Each begins at rest; what was learned before is kept, and only the first has a warm-up.
    candidates : sequence of PredictorSettings
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    ParameterError
        If the candidates do not share a pass.
    SignalError
        If samples cannot be used.
    """
    if not share_a_pass(candidates):
        raise ParameterError(
            "candidates of one pass must have trust = false and no delay, and differ in p, q and lambda only"
        )
    _check(pieces, as_samples)
    common = candidates[0]
    order = sorted(range(len(candidates)), key=lambda i: candidates[i].p)
    ridge = NestedRidge([candidates[i] for i in order])
    p = np.array([candidates[i].p for i in order])
    discrete = model.discretise(common.T_s, common.input_hold, block=common.Np)
    past = PastSamples(ridge.layout, common.Np)
    squares = _Squares(len(candidates))
    n_samples, n_before = sum(len(x) for _, x in pieces), 0
    for i, (x_d, x) in enumerate(pieces):
        n_init = 0 if i else samples_before(common.warm_up, common.T_s)
        state, start, n_unscored = discrete.rest(), x_d[:1], n_unjudged(x_d, common.Np)
        past.restart()
        for k in range(0, len(x), common.Np):
            window = slice(k, k + common.Np)
            x_pb, state = discrete.forced_response(state, x_d[window] - start)  # Eq. (2)
            measured, last = x[window], float(past.e_pb[-1])
            m = len(measured)
            past.append(x_pb, measured - start - x_pb)
            rows = past.rows(m, np.zeros((m, 0)))
            warm = min(max(n_init - k, 0), m)
            if k >= n_unscored:
                squares.add_warm_up(measured[:warm], x_pb[:warm] + start)
            if warm < m and k >= n_unscored:
                e_h = free_runs(ridge.layout, rows[:, :-1], ridge.weights(), p)
                squares.add(measured[warm:], x_pb[warm:] + start, last, e_h[:, warm:])
            ridge.update_stacked(rows)
            past.advance(m)
            progress((n_before + k) / n_samples)
        n_before += len(x)
    found = squares.losses()
    rms_h = np.empty(len(candidates))
    rms_h[order] = found.rms_h
    return replace(found, rms_h=rms_h)


class _Squares:
    """Sums of squared errors of physics model, hold and hybrids."""

    def __init__(self, n_candidates: int) -> None:
        self.n, self._pb, self._hold, self._h = 0, 0.0, 0.0, np.zeros(n_candidates)

    def add_warm_up(self, x: Array, x_pb: Array) -> None:
        """Add samples for which all publish the physics model's prediction."""
        square = float((x - x_pb) @ (x - x_pb))
        self._pb += square
        self._hold += square
        self._h += square
        self.n += len(x)

    def add(self, x: Array, x_pb: Array, last: float, e_h: Array) -> None:
        """Add samples with the hold's residual and the hybrids', ``(n_candidates, m)``."""
        physics, hold = x - x_pb, x - (x_pb + last)
        hybrid = x - (x_pb + e_h)  # Eq. (4)
        with np.errstate(over="ignore", invalid="ignore"):
            fits = np.abs(hybrid).max(axis=1) <= PREDICTION_MAX  # false where it is NaN
            self._h += np.where(fits, np.einsum("ij,ij->i", hybrid, hybrid), np.inf)
        self._pb += float(physics @ physics)
        self._hold += float(hold @ hold)
        self.n += len(x)

    def losses(self) -> Losses:
        """Return the RMS errors."""
        return Losses(math.sqrt(self._pb / self.n), math.sqrt(self._hold / self.n), np.sqrt(self._h / self.n))


def replayed_losses(
    model: ModalModel,
    pieces: Sequence[Piece],
    candidate: PredictorSettings,
    progress: Progress = lambda _done: None,
) -> Losses:
    """Return the losses of one candidate, any, by a backtest of its own; NaN for the baselines where it diverges.

    Parameters
    ----------
    model, pieces, progress
        As for :func:`nested_losses`; with trust measurements may be NaN, and are not scored there.
    candidate : PredictorSettings

    Raises
    ------
    SignalError
        If samples cannot be used.
    """
    predictor = HybridPredictor(model, candidate)
    _check(pieces, as_measured if candidate.trust else as_samples)
    n_samples, n_before, n_known, squares = sum(len(x) for _, x in pieces), 0, 0, np.zeros(3)
    for i, piece in enumerate(pieces):
        if i:
            predictor.restart()

        n_unscored, first = n_unjudged(piece[0], candidate.Np), [0.0, 0.0, 0.0, 0.0]

        def on_batch(
            batch: Batch, n_before: int = n_before, n_unscored: int = n_unscored, first: list[float] = first
        ) -> None:
            progress((n_before + batch.k) / n_samples)
            n = int(np.count_nonzero(~np.isnan(batch.x)))
            if batch.k < n_unscored and n:
                first[:] = [n, *(n * rms**2 for rms in (batch.rms_pb, batch.rms_hold, batch.rms_h))]

        try:
            score = backtest_stream(predictor, _chunks(piece), on_batch=on_batch).overall
        except SignalError:  # the samples are sound: it diverges
            return Losses(math.nan, math.nan, np.array([math.inf]))
        n_before += len(piece[1])
        if score.n_samples > first[0]:
            whole = score.n_samples * np.square([score.rms_pb, score.rms_hold, score.rms_h])
            squares += np.maximum(whole - first[1:], 0.0)
            n_known += score.n_samples - int(first[0])
    rms = np.sqrt(squares / max(n_known, 1))
    return Losses(float(rms[0]), float(rms[1]), rms[2:])


def _check(pieces: Sequence[Piece], measured: Callable[[Array, str, int], Array]) -> None:
    """Raise SignalError if samples cannot be used; ``measured`` says whether measured ones may be missing."""
    for piece in pieces:
        if len(piece[0]) != len(piece[1]) or not len(piece[0]):
            raise SignalError(
                f"x_d and x must have as many samples, at least one, got {len(piece[0])}, {len(piece[1])}"
            )
        for i, (x_d, x) in enumerate(_chunks(piece)):
            place = f" of the chunk from sample {i * _AT_ONCE} on" if i else ""
            measured(x, f"x{place}", len(as_samples(x_d, f"x_d{place}")))


def _chunks(piece: Piece) -> Iterator[Piece]:
    """Yield a piece in parts, so that what is computed of one does not grow with the log."""
    x_d, x = piece
    for i in range(0, len(x), _AT_ONCE):
        yield x_d[i : i + _AT_ONCE], x[i : i + _AT_ONCE]
