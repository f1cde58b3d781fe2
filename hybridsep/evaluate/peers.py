"""Peers that a hybrid model is judged by, on the columns ``x_d`` and ``x`` of its log alone: lag + hold, ARX models.

None of them shares code with what it judges. Each window is predicted from what was measured before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.signals import Array
from ..base.threads import one_blas_thread
from .arx import ArxRun, MinimumNorm
from .lag import fitted_lag

__all__ = ["ARX_LAGS", "FROZEN", "LAG_HOLD", "REFITTED", "Peer", "Piece", "predict_peers"]

ARX_LAGS = (20, 40)
"""Lags of the ARX models."""

LAG_HOLD, FROZEN, REFITTED = "lag + hold", "frozen", "refitted"
"""Name of the lag whose last residual is held; ways to fit ARX: to the training samples, or again before each
window."""

_FAR = 10.0
"""Distance of a prediction from its command, in largest commanded or measured distances from the start, beyond which it
diverges: no drive gets there."""


class Piece(NamedTuple):
    """Piece of a log without a gap.

    Attributes
    ----------
    x_d, x : (n,) array, m
        Commanded and measured positions, the latter NaN where missing.
    n_train : int
        Leading training samples.
    first : int
        First sample that is predicted, the beginning of a window.
    """

    x_d: Array
    x: Array
    n_train: int
    first: int


@dataclass(frozen=True)
class Peer:
    """Predictions of a peer.

    Attributes
    ----------
    name : str
        Such as "ARX20".
    way : str
        How it was fitted: :data:`FROZEN`, :data:`REFITTED`; empty if there is one way only.
    predictions : tuple of (n,) arrays, m
        One a piece, NaN where it predicts nothing.
    diverged : bool
        Whether a window was predicted far beyond where any axis gets; then the predictions end there.
    """

    name: str
    way: str
    predictions: tuple[Array, ...]
    diverged: bool = False

    @property
    def title(self) -> str:
        """Name, and how it was fitted."""
        return f"{self.name} ({self.way})" if self.way else self.name


@one_blas_thread
def predict_peers(
    pieces: Sequence[Piece],
    Np: int,
    *,
    delay: int = 0,
    progress: Callable[[float], object] = lambda _done: None,
) -> tuple[Peer, ...]:
    """Return the peers' predictions of all windows from each piece's ``first`` on.

    The lag and a frozen ARX are fitted to the leading training samples; without any there are none of them. A
    refitted ARX is fitted before each window to all samples so far.

    Parameters
    ----------
    pieces : sequence of Piece
        In the order of time.
    Np : int
        Samples in a window.
    delay : int
        Samples by which the measurements are late; a prediction stands where its measurement does.
    progress : callable, optional
        Called with the fraction done.
    """
    training = [(one.x_d[: one.n_train], one.x[: one.n_train]) for one in pieces if one.n_train > delay]
    trains = any((~np.isnan(x[delay:])).any() for _, x in training)
    found = [_lag_hold(pieces, training, Np, delay)] if trains else []
    ways = (FROZEN, REFITTED) if trains else (REFITTED,)
    for i, n in enumerate(ARX_LAGS):
        found += [_arx(n, way, pieces, Np, delay) for way in ways]
        progress((i + 1) / len(ARX_LAGS))
    return tuple(found)


def _lag_hold(pieces: Sequence[Piece], training: Sequence[tuple[Array, Array]], Np: int, delay: int) -> Peer:
    """Return the fitted lag and its residual at the last sample measured before each window, held over it."""
    lag = fitted_lag([(x_d[: len(x_d) - delay], x[delay:]) for x_d, x in training])
    predictions = []
    for piece in pieces:
        x_lag = _late(lag.position(piece.x_d), delay)
        residual = piece.x - x_lag
        k = np.arange(len(residual))
        measured = np.maximum.accumulate(np.where(np.isnan(residual), -1, k))  # last one up to each sample
        before = k // Np * Np - 1  # what is measured there is `delay` samples old
        # A prediction made with its window stands `delay` samples later
        last = np.where(before >= 0, measured[before], -1)
        held = _late(np.where(last >= 0, residual[last], 0.0), delay)
        predictions.append(np.where(k < _first_window(piece, Np, delay), np.nan, x_lag + held))
    return Peer(LAG_HOLD, "", tuple(predictions))


def _arx(n: int, way: str, pieces: Sequence[Piece], Np: int, delay: int) -> Peer:
    name, far = f"ARX{n}", _FAR * _reach(pieces)
    least_squares = MinimumNorm(2 * n + 2)
    runs = [ArxRun(one.x_d, one.x, n, delay) for one in pieces]
    if way == FROZEN:
        for run, piece in zip(runs, pieces, strict=True):
            least_squares.add(run.rows(0, piece.n_train - delay))
        w = least_squares.solution()
    predictions = [np.full(len(one.x), np.nan) for one in pieces]
    for run, piece, predicted in zip(runs, pieces, predictions, strict=True):
        n_added = 0
        for begin in range(_first_window(piece, Np, delay), len(piece.x), Np):
            end = min(begin + Np, len(piece.x))
            if way == REFITTED:
                least_squares.add(run.rows(n_added, begin - delay))
                n_added, w = max(begin - delay, 0), least_squares.solution()
            y = run.predict(w, begin, end)
            if not np.all(np.abs(y) <= far):
                return Peer(name, way, tuple(_late(one, delay) for one in predictions), diverged=True)
            predicted[begin:end] = piece.x_d[begin:end] + y
        if way == REFITTED:
            least_squares.add(run.rows(n_added, len(piece.x)))
    return Peer(name, way, tuple(_late(one, delay) for one in predictions))


def _first_window(piece: Piece, Np: int, delay: int) -> int:
    """Return the beginning of the first window that is predicted, so that late ones cover the first sample."""
    return max(0, piece.first - -(-delay // Np) * Np)


def _reach(pieces: Sequence[Piece]) -> float:
    """Return the largest distance, m, of a command or measurement from where its piece starts."""
    return max((float(np.nanmax(np.abs(np.stack((one.x_d, one.x)) - one.x_d[0]))) for one in pieces), default=math.inf)


def _late(signal: Array, delay: int) -> Array:
    """Return a signal ``delay`` samples later, NaN before its first sample."""
    return np.concatenate((np.full(min(delay, len(signal)), np.nan), signal))[: len(signal)]
