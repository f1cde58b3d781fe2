"""Candidate model of the residual: the static features with some lags, trusted as far as its own variance allows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ...base.signals import Array
from ..regression import PenalisedSolution, RidgeRegression

__all__ = ["CORRELATION_MAX", "Candidate", "CandidatePrediction", "ResidualScale", "SolvedCandidate", "lags"]

_CAUTION = 2.0
"""Factor on the predicted variance when a prediction is shrunk by it: its distribution has long tails."""

_BOUND = 10.0
"""Largest lag within a window, relative to the largest residual: what is beyond has diverged."""

_DIVERGED = 1e6
"""Bound on the impulse response of a recursion, and on the variance relative to the square of the largest residual."""

CORRELATION_MAX = 1e4
"""Bound on the correlation of the rows: as much as there is in a long window of errors that are all alike."""

_FIRST_CORRELATION, _CORRELATION_RATE = 0.1, 0.1
"""Correlation before a window is measured, in windows: at any sampling rate the same time; and how fast it follows."""


class ResidualScale(NamedTuple):
    """Size of the residuals so far.

    Attributes
    ----------
    recent, largest_square : float, m²
        Recent mean square, and the largest one of a window.
    largest : float, m
        Largest magnitude.
    """

    recent: float = 0.0
    largest_square: float = 0.0
    largest: float = 0.0


class CandidatePrediction(NamedTuple):
    """Residual predicted over a window by one candidate.

    Attributes
    ----------
    e_h : (n,) array, m
        Shrunk by its variance.
    unshrunk : (n,) array, m
    noise_variance : float, m²
        Mean square of the rows so far about this candidate.
    spread : (n,) array, m²
        Variance of ``unshrunk``.
    variance : float, m²
        Of the noise that the penalties come from.
    mean_square : (n,) array, m²
        That the residual may have, which the shrinking follows from.
    """

    e_h: Array
    unshrunk: Array
    noise_variance: float
    spread: Array
    variance: float
    mean_square: Array

    @property
    def shrink(self) -> Array:
        """What shrinking and bounds leave of ``unshrunk``, ``(n,)``."""
        kept = _kept(self.mean_square, self.spread)
        return np.divide(self.e_h, self.unshrunk, out=kept, where=self.unshrunk != 0.0)


class SolvedCandidate(NamedTuple):
    """Candidate with weights.

    Attributes
    ----------
    n_static : int
        Static features, the first ones of a row.
    solution : PenalisedSolution
        Weights of these and of the lags.
    variance : float, m²
        Of the noise that the penalties come from.
    """

    n_static: int
    solution: PenalisedSolution
    variance: float

    @property
    def lag_weights(self) -> Array:
        """Weights of ``e_pb(k−1) … e_pb(k−p)``, ``(p,)``."""
        return self.solution.weights[self.n_static :]

    def predict(
        self, rows: Array, past: Array, scale: ResidualScale, held: CandidatePrediction | None = None
    ) -> CandidatePrediction:
        """Predict the residual over a window in free run.

        Weights have normal priors, so the variance of ``wᵀφ`` is known; it is carried through the recursion's impulse
        response. A prediction ``e`` of variance ``τ²`` is shrunk to ``e·v/(v + 2τ²)``, ``v`` being the mean square that
        the residual may have: the recent one, or what the prediction's own is beyond ``τ²``. At a first motion, a first
        reversal or in a region not seen yet the physics model remains.

        Parameters
        ----------
        rows : (n, n_static) array
            Static features of the window.
        past : (p,) array, m
            Last residuals, newest first.
        scale : ResidualScale
        held : CandidatePrediction, optional
            Prediction whose variance, and with it the shrinking, is held; else both are computed.
        """
        w_e, largest = self.lag_weights, scale.largest
        p = len(w_e)
        drive = rows @ self.solution.weights[: self.n_static]
        response = np.zeros(0)
        if p:
            drive, response = _recursion(w_e, drive, past)
        finite = np.isfinite(drive)
        e = np.clip(np.where(finite, drive, 0.0), -_BOUND * largest, _BOUND * largest)
        if held is not None:
            spread, mean_square = held.spread, held.mean_square
        else:
            phi = np.hstack((rows, lags(past, e))) if p else rows
            spread = self.variance * self.solution.leverage(phi)
            most = _DIVERGED * largest**2
            if p:
                spread = np.minimum(lfilter(response**2, [1.0], spread), most)
            spread = np.where(finite, spread, most)
            mean_square = _mean_square(e, spread, scale)
        return CandidatePrediction(
            e * _kept(mean_square, spread), e, self.solution.residual_sum, spread, self.variance, mean_square
        )


def _kept(mean_square: Array, spread: Array) -> Array:
    """Return what the variance leaves of a prediction, ``(n,)``."""
    return mean_square / (mean_square + _CAUTION * spread)


class Candidate:
    """Model of the residual, and what is known of its errors.

    Parameters
    ----------
    n_static : int
        Static features, the first ones of a row.
    lag_scales : (p,) array
        Prior standard deviations of the weights of ``e_pb(k−1) … e_pb(k−p)``; empty for a model without lags.
    correlation_max : float
        Correlation beyond which the penalty does not grow; 1 takes the rows as independent, and learns fastest.
    Np : int
        Samples of a usual window.

    Attributes
    ----------
    noise_variance : float, m²
        Of a row about the model; 0 until a window is measured.
    correlation : float
        Rows that count as one: where a disturbance has no feature, the errors of neighbouring rows are alike.
    """

    def __init__(self, n_static: int, lag_scales: Array, correlation_max: float, Np: int) -> None:
        self.n_static, self.lag_scales, self.correlation_max = n_static, lag_scales, correlation_max
        self.noise_variance, self.correlation = 0.0, max(_FIRST_CORRELATION * Np, 1.0)

    def solve(self, regression: RidgeRegression, static_scales: Array, least_variance: float) -> SolvedCandidate:
        """Return the model with the weights that follow from all rows so far.

        Parameters
        ----------
        regression : RidgeRegression
            Factor of all rows.
        static_scales : (n_static,) array
            Prior standard deviations of the weights of the static features.
        least_variance : float
            Least variance of the noise, m².
        """
        variance = max(self.noise_variance, least_variance) * min(self.correlation, self.correlation_max)
        priors = np.concatenate((static_scales, self.lag_scales))
        return SolvedCandidate(self.n_static, regression.penalised(variance / priors**2), variance)

    def judge(self, unshrunk: Array, measured: Array) -> None:
        """Estimate the correlation from the errors of a window, ``(n,)``, m, that has been measured."""
        n, mean = len(measured), float(np.mean(measured - unshrunk))
        seen = n * mean**2 / self.noise_variance if self.noise_variance > 0.0 else CORRELATION_MAX
        change = _CORRELATION_RATE * (min(seen, CORRELATION_MAX) - self.correlation)
        self.correlation = max(self.correlation + change, 1.0)


def _mean_square(e: Array, spread: Array, scale: ResidualScale) -> Array:
    """Return the mean square, m², that the residual may have, ``(n,)``, where ``e``, m, of a variance is predicted.

    The recent one would do while the motion stays the same. Where a motion begins again, what is predicted so far
    beyond its own variance counts, up to the largest mean square of a window, and less where it is larger than any
    residual yet. It is causal, as a plan may change the end of a window whose beginning is published.
    """
    beyond = np.minimum(np.cumsum(e**2 - spread) / np.arange(1, len(e) + 1), scale.largest_square)
    seen = scale.largest / np.maximum(np.maximum.accumulate(np.abs(e)), scale.largest)
    return np.maximum(beyond * seen**2, scale.recent)


def _recursion(w_e: Array, drive: Array, past: Array) -> tuple[Array, Array]:
    """Return the free run ``e(k) = drive(k) + Σ_i w_e,i e(k−i)``, and the recursion's impulse response; eq. (4)."""
    denominator = np.concatenate(([1.0], -w_e))
    state = np.correlate(w_e, past, "full")[len(past) - 1 :]
    impulse = np.zeros(len(drive))
    impulse[0] = 1.0
    with np.errstate(all="ignore"):  # an unstable recursion is recognised by what it gives
        e, _ = lfilter([1.0], denominator, drive, zi=state)
        response = lfilter([1.0], denominator, impulse)
    return e, np.clip(np.nan_to_num(response, nan=_DIVERGED), -_DIVERGED, _DIVERGED)


def lags(past: Array, e: Array) -> Array:
    """Return the lags ``e(k−1) … e(k−p)`` over a window ``e``, ``(n, p)``; ``past``, ``(p,)``, is newest first."""
    series = np.concatenate((past[::-1], e[:-1]))
    return np.lib.stride_tricks.sliding_window_view(series, len(past))[:, ::-1]
