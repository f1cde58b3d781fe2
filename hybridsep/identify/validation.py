"""Validation of an identified model by a recording: its own frequency response, and tests of the residual.

Both hold for a closed position loop, as what drives it, the command, does not depend on what was measured.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import solve_toeplitz
from scipy.signal import get_window, lfilter

from ..base.signals import Array
from ..model.physics import ModalModel

_SEGMENTS = 24  # segments that a response is averaged over at least: with fewer, coherence is high by chance
_LENGTHS = tuple(2**i for i in range(12, 5, -1))  # samples of a segment; the longest of which there are enough is taken

_FLOOR = 1e-8
"""Power of the command, relative to its largest, below which it may be leakage: the window's lobes are at -92 dB."""

_AVERAGES = 6.0  # segments that must share the power at a frequency: coherence is 1 where one of them has it all

_HALF = 0.25
"""Half of the 95 % interval, relative, up to which a response is known. Chance is so at one frequency in 5e4 with
the fewest averages, and less often with more."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Frequency response of a recording."""

    f: Array  # (n,), Hz: the first is the inverse of a segment's length
    # (n,), m/m: estimate H1, measured over commanded position, and the model's response
    G: NDArray[np.complex128]
    expected: NDArray[np.complex128]
    coherence: Array  # (n,): squared coherence of commanded and measured position
    half: Array  # (n,): half of the 95 % interval of the magnitude, relative to it; of the phase as well, rad
    known: NDArray[np.bool_]  # (n,): whether the command has power there, enough to tell the response to 25 %
    n_segments: int


def frequency_response(
    recordings: Iterable[tuple[Array, Array, Array]], T_s: float, model: ModalModel, input_hold: str
) -> FrequencyResponse | None:
    """Return the frequency response of recordings by Welch's method; None if they are too short or do not move.

    The power of positions falls so steeply with the frequency that low ones would leak into all others: second
    differences of the signals are transformed, which have the same ratio, with a window of low side lobes. The response
    is the model's plus that of its error: a window smears what it is long enough for, and of the model nothing then.

    ``recordings``: iterable of three (n,), m: commanded and measured positions without a gap, of the same instants,
    and the measured ones minus the model's; a segment with NaN is left out; ``T_s``, s.
    """
    pieces = [np.diff(signals, 2) for signals in recordings]
    for n in _LENGTHS:
        windows = [sliding_window_view(one, n, axis=1)[:, :: n // 2] for one in pieces if one.shape[1] >= n]
        windows = [one[:, ~np.isnan(one[1]).any(axis=1)] for one in windows]
        if (n_segments := sum(one.shape[1] for one in windows)) >= _SEGMENTS:
            break
    else:
        return None
    X, Y, of_error = np.fft.rfft(np.concatenate(windows, axis=1) * get_window("blackmanharris", n))[:, :, 1:-1]
    power = np.abs(X) ** 2
    of_x, of_y, of_e = ((np.abs(signal) ** 2).sum(axis=0) for signal in (X, Y, of_error))
    with_y, with_e = ((np.conj(X) * signal).sum(axis=0) for signal in (Y, of_error))
    if not of_x.any():
        return None
    least = np.finfo(np.float64).tiny
    coherence = np.minimum(np.abs(with_y) ** 2 / np.maximum(of_x * of_y, least), 1.0)
    # An axis moves in some segments only: as many averages as Gaussian signals have whose power is as uneven, the
    # variance of which is its mean squared
    n_d = np.minimum(2.0 * of_x**2 / np.maximum((power**2).sum(axis=0), least) - 1.0, n_segments)
    f = np.arange(1, n // 2) / (n * T_s)
    expected = model_response(model, T_s, input_hold, f)
    G = expected + with_e / np.maximum(of_x, least)
    # var |G| = |G|² (1 − γ²) / (2 n_d γ²) = S_vv / (2 n_d S_xx), Bendat, Piersol, Random Data, with the noise v of the
    # model's error and the degrees of freedom that G leaves
    free = np.maximum(n_d - 1.0, 1.0)
    noise = np.maximum(of_e - np.abs(with_e) ** 2 / np.maximum(of_x, least), 0.0)
    std = np.sqrt(noise / np.maximum(2.0 * free * of_x, least)) / np.maximum(np.abs(G), least)
    half = stats.t.ppf(0.975, 2.0 * free) * std
    known = (of_x > _FLOOR * of_x.max()) & (n_d >= _AVERAGES) & (half <= _HALF)
    return FrequencyResponse(f, G, expected, coherence, half, known, n_segments)


def model_response(model: ModalModel, T_s: float, input_hold: str, f: Array) -> NDArray[np.complex128]:
    """Return the response of the model under its hold, dead time included, at frequencies ``(n,)``, Hz, m/m."""
    discrete = model.discretise(T_s, input_hold, block=1)
    z = np.exp(2j * np.pi * f * T_s)
    states = np.linalg.solve(z[:, None, None] * np.eye(len(discrete.b)) - discrete.A, discrete.b[:, None])[..., 0]
    return np.asarray((states @ discrete.c + discrete.d) * z**-model.dead_time)


@dataclass(frozen=True)
class ResidualTest:
    """Correlations of a residual with itself and with the commanded velocity before it."""

    autocorrelation: Array  # (m,): of lags from 0 samples on
    with_command: Array  # (m,): correlation with the command of both after a filter that makes the residual white
    band: float  # magnitude that the autocorrelation of a white residual keeps to at 99 % of the lags
    # (m,): magnitude that the correlation with the command keeps to at all lags in 99 % of recordings of a residual
    # that does not depend on it
    command_band: Array
    # Ljung and Box's statistic, and what it is below for 99 % of white residuals
    ljung_box: float
    of_white: float


def residual_test(pieces: Iterable[tuple[Array, Array, Array]], n_lags: int) -> ResidualTest | None:
    """Return the tests of a residual, None where it or the command does not change, or samples are too few.

    ``pieces``: iterable of three (n,), m: commanded and measured positions, and residuals of a model that was fitted
    to others; NaN where missing; ``n_lags``: largest lag, samples; a tenth of the samples is the most.
    """
    apart = np.full((2, n_lags), np.nan)  # no product reaches from one piece into the next
    v, e = np.hstack([part for x_d, _, e in pieces for part in (apart, (np.diff(x_d, prepend=x_d[:1]), e))])
    n = int((~np.isnan(e)).sum())
    n_lags = min(n_lags, n // 10)
    if n_lags < 1 or not np.nanstd(e) or not np.nanstd(v):
        return None
    e, v = e - np.nanmean(e), v - np.nanmean(v)
    r = _lagged(e, e, n_lags)
    r /= r[0]
    ljung_box = n * (n + 2) * float(np.sum(r[1:] ** 2 / (n - np.arange(1, n_lags + 1))))
    # Neither correlation of the residual with itself nor that of the command widens the band then (Box, Jenkins)
    whitening = np.append(1.0, -solve_toeplitz(r[:-1], r[1:]))
    e, v = (lfilter(whitening, 1.0, signal) for signal in (e, v))
    scale = np.sqrt(np.nansum(e**2) * np.nansum(v**2)) or 1.0
    # White's estimate of the deviations holds where the size of the residual changes with the motion, too
    deviations = stats.norm.ppf(1.0 - 0.005 / (n_lags + 1))  # Bonferroni
    band = deviations * np.sqrt(_lagged(e**2, v**2, n_lags)) / scale
    of_white = float(stats.norm.ppf(0.995)) / np.sqrt(n), float(stats.chi2.ppf(0.99, n_lags))
    return ResidualTest(r, _lagged(e, v, n_lags) / scale, of_white[0], band, ljung_box, of_white[1])


def _lagged(e: Array, v: Array, n_lags: int) -> Array:
    """Return the sums of ``e`` times ``v`` 0 … ``n_lags`` samples before, without the products that have a NaN."""
    return np.correlate(np.pad(np.nan_to_num(e), (0, n_lags)), np.nan_to_num(v))
