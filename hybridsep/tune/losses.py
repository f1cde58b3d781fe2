"""Losses of candidates on one log: RMS errors of causal replays, as ``evaluate.backtest`` scores them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import SignalError
from ..base.settings import PredictorSettings
from ..base.signals import Array, as_measured, as_samples
from ..evaluate.backtest import Batch, backtest_stream
from ..intake.motion import starts_in_motion
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor

__all__ = ["Losses", "Piece", "n_unjudged", "replayed_losses"]

Piece = tuple[Array, Array]
"""Commanded and measured positions of a part of a log without a gap, ``(n,)`` each, m."""

Progress = Callable[[float], object]

_AT_ONCE = 100_000
"""Samples that are checked and replayed at once."""


@dataclass(frozen=True)
class Losses:
    """RMS errors against the measured position over a log, m, as of a backtest without :func:`n_unjudged` samples.

    Attributes
    ----------
    rms_pb, rms_hold : float
        Physics model, hold baseline.
    rms_h : float
        Hybrid; infinite where the prediction diverges.
    """

    rms_pb: float
    rms_hold: float
    rms_h: float


def n_unjudged(x_d: Array, Np: int) -> int:
    """Return how many leading samples of a piece are not scored: the first window, if the piece begins in motion.

    No model knows the state of the axis there, so its error says nothing of a candidate, but would dominate the RMS.
    """
    return Np if len(x_d) > Np and starts_in_motion(x_d) else 0


def replayed_losses(
    model: ModalModel,
    pieces: Sequence[Piece],
    candidate: PredictorSettings,
    progress: Progress = lambda _done: None,
) -> Losses:
    """Return the losses of a candidate by a backtest of its own; NaN for the baselines where it diverges.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``.
    pieces : sequence of pairs ``(x_d, x)`` of (n,) arrays, m
        Each begins at rest; what was learned before is kept, and only the first has a warm-up. With trust measurements
        may be NaN, and are not scored there.
    candidate : PredictorSettings
    progress : callable, optional
        Called with the fraction done.

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
            return Losses(math.nan, math.nan, math.inf)
        n_before += len(piece[1])
        if score.n_samples > first[0]:
            whole = score.n_samples * np.square([score.rms_pb, score.rms_hold, score.rms_h])
            squares += np.maximum(whole - first[1:], 0.0)
            n_known += score.n_samples - int(first[0])
    return Losses(*np.sqrt(squares / max(n_known, 1)).tolist())


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
