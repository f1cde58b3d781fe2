"""Relations between commanded and measured position: regression at a lag, and a mode with dead time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar
from scipy.signal import lfilter

from ..base.signals import Array

__all__ = [
    "LAG_MAX",
    "DeadTime",
    "Line",
    "fit_dead_time",
    "line",
    "line_at_best_lag",
    "noise_std",
    "poles_of",
    "shifted",
]

LAG_MAX = 300
"""Largest lag that is looked for, in samples: 0.3 s at 1 kHz is beyond any drive and any bus."""


_EVALUATIONS = 25
"""Steps of a search, which need not end at the minimum: a dead time within a tenth of a sample is enough."""


@dataclass(frozen=True)
class Line:
    """Regression ``x ≈ gain · u(k − lag) + offset``.

    Attributes
    ----------
    lag : float
        Samples.
    gain, offset : float
    unexplained : float
        Share of the variance of x that is left, 0 … 1.
    """

    lag: float
    gain: float
    offset: float
    unexplained: float


@dataclass(frozen=True)
class DeadTime:
    """Mode with dead time, fitted by output error.

    Attributes
    ----------
    dead_time : float
        Samples; negative where the response comes before its cause.
    lag : float
        Steady lag of the mode behind a constant velocity, ``2ζ/ω``, samples.
    unexplained : float
        Share of the variance of x that is left.
    gain : float
        Static gain.
    """

    dead_time: float
    lag: float
    unexplained: float
    gain: float


def shifted(u: Array, lag: float) -> Array:
    """Return ``u(k − lag)``, linear between samples and held beyond the ends."""
    if lag == 0.0:
        return u
    if float(lag).is_integer():  # the same in a tenth of the time
        return u[np.clip(np.arange(len(u)) - int(lag), 0, len(u) - 1)]
    k = np.arange(len(u), dtype=np.float64)
    return np.asarray(np.interp(k - lag, k, u))


def line(u: Array, x: Array, lag: float = 0.0, known: NDArray[np.bool_] | None = None) -> Line:
    """Return the regression of ``x``, (n,), on ``u``, (n,), at a lag, over all samples or the ``known`` ones, (n,)."""
    moved = shifted(u, lag)
    if known is not None:
        moved, x = moved[known], x[known]
    of_u, of_x = _mean(moved), _mean(x)
    du, dx = moved - of_u, x - of_x
    squares, total, product = float(du @ du), float(dx @ dx), float(du @ dx)
    if squares == 0.0 or total == 0.0:
        return Line(lag, 0.0, of_x, 1.0)
    gain = product / squares
    return Line(lag, gain, of_x - gain * of_u, max(0.0, 1.0 - product * product / squares / total))


def _mean(x: Array) -> float:
    return float(np.add.reduce(x)) / len(x)  # where signals are short, x.mean() is most of a search's time


def line_at_best_lag(u: Array, x: Array, known: NDArray[np.bool_] | None = None) -> Line:
    """Return the regression at the lag, positive or negative, that leaves least."""
    return _line_at_best_lag(u.tobytes(), x.tobytes(), None if known is None else known.tobytes())


@lru_cache(maxsize=8)
def _line_at_best_lag(commanded: bytes, measured: bytes, believed: bytes | None) -> Line:
    """Search once for all checks of a log."""
    u, x = np.frombuffer(commanded), np.frombuffer(measured)
    known = None if believed is None else np.frombuffer(believed, dtype=np.bool_)
    largest = min(LAG_MAX, len(u) // 4)
    steps = np.unique(np.round(np.geomspace(1, max(largest, 1), 40)))
    lags = np.concatenate((-steps[::-1], [0.0], steps))
    left = [line(u, x, lag, known).unexplained for lag in lags]
    i = int(np.argmin(left))
    between = (float(lags[max(i - 1, 0)]), float(lags[min(i + 1, len(lags) - 1)]))
    found = minimize_scalar(lambda lag: line(u, x, lag, known).unexplained, bounds=between, method="bounded")
    return min(line(u, x, float(found.x), known), line(u, x, float(lags[i]), known), key=lambda fit: fit.unexplained)


def noise_std(x: Array) -> float:
    """Return the standard deviation of white noise on a smooth signal, from the median of its fifth differences."""
    if len(x) < 12:
        return 0.0
    return float(np.median(np.abs(np.diff(x, 5)))) / (0.6745 * math.sqrt(252.0))


def fit_dead_time(u: Array, x: Array, first: float | None, sign: float = 0.0) -> DeadTime:
    """Return the output-error fit of one mode of free gain and offset, after a dead time.

    Parameters
    ----------
    u, x : (n,) array
        Commanded and measured positions.
    first : float, optional
        Dead time, samples, that the search also begins with; None if it is to be 0.
    sign : {0, 1, −1}
        Sign that the gain must have; 0 if either will do.
    """
    scale = float(np.ptp(u))
    height = float(np.ptp(x))
    command, response = (u - u[0]) / scale, (x - x.mean()) / height
    total = float(response @ response)

    def residual(parameters: Array) -> Array:
        y = _mode(parameters, command)
        fit = line(y, response)
        # Of the other sign the best gain is none, and the response's own mean, which is 0, its offset.
        left = response - fit.gain * y - fit.offset if fit.gain * sign >= 0.0 else response
        if math.isfinite(float(np.add.reduce(left))):
            return np.asarray(left)
        return np.asarray(np.nan_to_num(left, nan=1e3, posinf=1e3, neginf=-1e3))

    best = None
    for omega, dead_time in ((0.15, 0.0), (0.5, first or 0.0)):
        start = [math.log(omega), math.log(0.5), dead_time][: 2 if first is None else 3]
        bounds = [(-7, 1), (-4.5, 2), (-LAG_MAX, LAG_MAX)][: len(start)]
        found = least_squares(
            residual, start, bounds=np.transpose(bounds), x_scale=[1, 1, 5][: len(start)], max_nfev=_EVALUATIONS
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    lag = 2 * math.exp(best.x[1] - best.x[0])
    gain = line(_mode(best.x, command), response).gain * height / scale
    gain = gain if gain * sign >= 0.0 else 0.0
    return DeadTime(0.0 if first is None else float(best.x[2]), lag, 2 * best.cost / total, gain)


def _mode(parameters: Array, u: Array) -> Array:
    """Return the response of a mode of unit gain, matched poles; ``log ω``, ``log ζ`` and perhaps the dead time."""
    poles = poles_of(math.exp(parameters[0]), math.exp(parameters[1]))
    late = shifted(u, float(parameters[2])) if len(parameters) > 2 else u
    # Held over a sample, the command acts from the next one on.
    return np.asarray(lfilter([0.0, sum(poles)], poles, late))


def poles_of(omega: float, zeta: float) -> list[float]:
    """Return the denominator of a sampled mode, highest power first, from rad a sample and the damping ratio."""
    if zeta < 1.0:
        radius, angle = math.exp(-zeta * omega), omega * math.sqrt(1 - zeta * zeta)
        return [1.0, -2 * radius * math.cos(angle), radius * radius]
    root = math.sqrt(zeta * zeta - 1.0)
    slow, fast = math.exp(-omega * (zeta - root)), math.exp(-omega * (zeta + root))
    return [1.0, -slow - fast, slow * fast]
