"""Peers that a hybrid model is judged by, on only the columns ``x_d`` and ``x`` of its log: lag + hold, ARX, N4SID.

None of them shares code with what it judges. Each window is predicted from what was measured before it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import Akima1DInterpolator
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrcon
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from ..base.signals import Array
from ..base.threads import one_blas_thread
from .n4sid import folded, identified, inputs_of

_LATE_MAX, _TIME_CONSTANTS = 21, (0.05, 1e4)
"""Most samples that a command is tried to be late by; least and largest time constant that are tried, samples."""


@dataclass(frozen=True)
class FirstOrderLag:
    """Lag ``1/(τs + 1)`` of a command that is late by whole samples."""

    tau: float  # time constant, samples
    late: int  # whole samples: 1 and the dead time over a zero-order hold, 0 where the axis follows within the sample

    def position(self, x_d: Array) -> Array:
        """Return the position under a command ``(n,)``, m, from rest at the first one."""
        u = x_d - x_d[0]
        pole = math.exp(-1.0 / self.tau)
        delayed = np.concatenate((np.zeros(self.late), u))[: len(u)]
        return np.asarray(x_d[0] + lfilter([1.0 - pole], [1.0, -pole], delayed))


def fitted_lag(recordings: Sequence[tuple[Array, Array]]) -> FirstOrderLag:
    """Return the lag that fits commanded and measured positions ``(n,)``, m, NaN where missing, best."""
    known = [(x_d, x, slice(None) if there.all() else there) for x_d, x in recordings if (there := ~np.isnan(x)).any()]

    def misfit(log_tau: float, late: int) -> float:
        lag = FirstOrderLag(math.exp(log_tau), late)
        errors = [(x - lag.position(x_d))[there] for x_d, x, there in known]
        return float(sum(np.sum((error - error.mean()) ** 2) for error in errors))  # their zeros may differ

    bounds = [math.log(samples) for samples in _TIME_CONSTANTS]
    fits = [(minimize_scalar(misfit, bounds=bounds, args=(n,), method="bounded"), n) for n in range(_LATE_MAX + 1)]
    best, late = min(fits, key=lambda fit: float(fit[0].fun))
    return FirstOrderLag(math.exp(best.x), late)


_BRIDGED = 0.5  # share of a row's lags that may be interpolated, as they were not measured


class MinimumNorm:
    """Minimum-norm least squares of ``n_columns`` regressors, of rows in blocks; a triangular factor is kept."""

    def __init__(self, n_columns: int) -> None:
        self._n_columns = n_columns
        self._R, self._n_rows = np.zeros((0, n_columns + 1)), 0

    def add(self, rows: Array) -> None:
        """Add rows of regressors, the target in the last column, ``(m, n_columns + 1)``."""
        self._R = folded(self._R, rows)
        self._n_rows += len(rows)

    def solution(self) -> Array:
        """Return the coefficients, ``(n_columns,)``, of :func:`numpy.linalg.lstsq` with its default cut-off."""
        n = self._n_columns
        R, z = self._R[:n, :n], self._R[:n, n]
        cutoff = np.finfo(np.float64).eps * max(self._n_rows, n)
        if len(R) == n and dtrcon(R)[0] > n * cutoff:  # nothing to cut off: κ₂ ≤ n κ₁
            return np.asarray(solve_triangular(R, z))
        return np.asarray(np.linalg.lstsq(R, z, rcond=cutoff)[0])


class ArxRun:
    """Columns of a log without a gap, as an ARX model of ``n`` lags sees them.

    ``y(k) = Σ a_i y(k−i) + Σ b_j [x_d(k−j) − x_d(k−j−1)] + c`` with ``y = x − x_d``, ``i = 1 … n``, ``j = 0 … n``:
    free runs of minimum-norm least squares, what is missing before them bridged by free runs as well.

    ``x_d``, ``x``, (n_samples,), m: commanded and measured positions, the latter NaN where missing; ``n``: lags;
    ``delay``: samples by which the measurements are late: ``x(k)`` is the position at ``k − delay``.
    """

    def __init__(self, x_d: Array, x: Array, n: int, delay: int = 0) -> None:
        self.n = n
        self._delay = delay
        self._y = np.concatenate((x[delay:], np.full(min(delay, len(x)), np.nan))) - x_d
        self._lagged, known = self._y.copy(), ~np.isnan(self._y)
        if 1 < known.sum() < len(known):  # between measured samples: lines double the error of an ARX
            between = Akima1DInterpolator(np.flatnonzero(known), self._y[known])
            self._lagged[~known] = between(np.flatnonzero(~known))
        self._steps = np.diff(x_d, prepend=x_d[0])
        self._filled = np.concatenate((np.zeros(n), self._y))  # at rest before the first sample
        self._n_filled = 0

    def rows(self, first: int, last: int) -> Array:
        """Return the rows of measured samples ``first`` to ``last``, the last one not included.

        At most half of a row's lags are interpolated.

        Returns (m, 2 n + 3): ``y(k−1) … y(k−n)``, increments ``k … k−n`` of the command, 1, and the target ``y(k)``.
        """
        n, first, last = self.n, max(first, self.n + 1), min(last, len(self._y))
        if last <= first:
            return np.empty((0, 2 * n + 3))
        y, lagged, steps = (
            sliding_window_view(one, n + 1)[first - n : last - n, ::-1] for one in (self._y, self._lagged, self._steps)
        )
        found = np.column_stack((lagged[:, 1:], steps, np.ones(last - first), y[:, 0]))
        return np.asarray(found[~np.isnan(found).any(axis=1) & (np.isnan(y).sum(axis=1) <= _BRIDGED * n)])

    def predict(self, w: Array, begin: int, end: int) -> Array:
        """Return the prediction of ``x − x_d`` at samples ``begin`` to ``end``, made when ``begin`` is commanded.

        It is one free run from the last sample that is measured then.

        ``w``, (2 n + 2,): coefficients; ``begin``, ``end``: samples; ``begin`` never falls from call to call.
        """
        known = max(begin - self._delay, 0)
        # What is missing before is filled by free runs from what was measured before it
        missing = np.isnan(self._y[self._n_filled : known])
        edges = np.flatnonzero(np.diff(missing, prepend=False, append=False)) + self._n_filled
        for first, last in edges.reshape(-1, 2).tolist():
            self._filled[self.n + first : self.n + last] = self._free_run(w, first, last)
        self._n_filled = max(self._n_filled, known)
        return self._free_run(w, known, end)[begin - known :]

    def _free_run(self, w: Array, begin: int, end: int) -> Array:
        n = self.n
        a, b, c = w[:n], w[n:-1], w[-1]
        steps = self._steps[max(begin - n, 0) : end]
        forced = np.convolve(np.pad(steps, (end - begin + n - len(steps), 0)), b, "valid") + c
        with np.errstate(over="ignore", invalid="ignore"):  # a run that diverges is seen by its size
            denominator = np.concatenate(([1.0], -a))
            before = np.correlate(a, self._filled[begin : begin + n][::-1], "full")[n - 1 :]  # lfiltic, in a step
            return np.asarray(lfilter([1.0], denominator, forced, zi=before)[0])


ARX_LAGS = (20, 40)  # lags of the ARX models

LAG_HOLD, STATE_SPACE, FROZEN, REFITTED = "lag + hold", "N4SID", "frozen", "refitted"
"""Names of the lag whose last residual is held, and of the state-space model; ways to fit ARX: to the training samples,
or again before each window."""

_FAR = 10.0
"""Distance of a prediction from its command, in largest distances from the start, beyond which it diverges."""


class Piece(NamedTuple):
    """Piece of a log without a gap."""

    # (n,), m: commanded and measured positions, the latter NaN where missing
    x_d: Array
    x: Array
    n_train: int  # leading training samples
    first: int  # first sample that is predicted, the beginning of a window


@dataclass(frozen=True)
class Peer:
    """Predictions of a peer."""

    name: str  # such as "ARX20"
    way: str  # how it was fitted: :data:`FROZEN`, :data:`REFITTED`; empty if there is one way only
    predictions: tuple[Array, ...]  # each (n,), m: one a piece, NaN where it predicts nothing
    # whether a window was predicted far beyond where any axis gets; then the predictions end there
    diverged: bool = False

    @property
    def title(self) -> str:
        """Name, and how it was fitted."""
        return f"{self.name} ({self.way})" if self.way else self.name


@one_blas_thread
def predict_peers(
    pieces: Sequence[Piece], Np: int, *, delay: int = 0, progress: Callable[[float], object] = lambda _done: None
) -> tuple[Peer, ...]:
    """Return the peers' predictions of all windows from each piece's ``first`` on; the pieces are in the order of time.

    The lag, N4SID and a frozen ARX are fitted to the leading training samples; without any there are none of them, and
    no lag without motion there. A refitted ARX is fitted before each window to all samples so far. Measurements are
    late by ``delay`` samples; a prediction stands where its measurement does.
    """
    training = [(one.x_d[: one.n_train], one.x[: one.n_train]) for one in pieces if one.n_train > delay]
    trains = any((~np.isnan(x[delay:])).any() for _, x in training)
    moves = any(np.ptp(x_d) > 0.0 for x_d, _ in training)
    found = [_lag_hold(pieces, training, Np, delay)] if trains and moves else []
    found += _state_space(pieces, Np, delay) if trains else []
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


def _state_space(pieces: Sequence[Piece], Np: int, delay: int) -> list[Peer]:
    """Return N4SID's model of the training samples, whose filter knows what was measured before each window."""
    late = [np.concatenate((one.x[delay:], np.full(min(delay, len(one.x)), np.nan))) - one.x_d for one in pieces]
    runs = [(inputs_of(one.x_d), y) for one, y in zip(pieces, late, strict=True)]
    trained = [max(one.n_train - delay, 0) for one in pieces]
    model = identified([(u[:n], y[:n]) for (u, y), n in zip(runs, trained, strict=True)], Np)
    if model is None:
        return []
    far, diverged, predictions = _far(pieces), False, []
    for (u, y), piece in zip(runs, pieces, strict=True):
        states, predicted = model.states(u, y), np.full(len(y), np.nan)
        for begin in range(_first_window(piece, Np, delay), len(y), Np):
            known, end = max(begin - delay, 0), min(begin + Np, len(y))
            run = model.free_run(states[known], u[known:end])[begin - known :]
            diverged = diverged or not np.all(np.abs(run) <= far)
            predicted[begin:end] = np.nan if diverged else piece.x_d[begin:end] + run
        predictions.append(_late(predicted, delay))
    return [Peer(STATE_SPACE, "", tuple(predictions), diverged)]


def _far(pieces: Sequence[Piece]) -> float:
    distances = (np.abs(np.stack((one.x_d, one.x)) - one.x_d[0]) for one in pieces)
    return _FAR * max((float(np.nanmax(distance)) for distance in distances), default=math.inf)


def _arx(n: int, way: str, pieces: Sequence[Piece], Np: int, delay: int) -> Peer:
    name, far = f"ARX{n}", _far(pieces)
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


def _late(signal: Array, delay: int) -> Array:
    """Return a signal ``delay`` samples later, NaN before its first sample."""
    return np.concatenate((np.full(min(delay, len(signal)), np.nan), signal))[: len(signal)]
