"""Uncertainty of a prediction: the variance of its error against the measured position, learned from earlier windows.

The variance at sample ``k`` of a window is a sum of three components, ``v(k) = Σ_i θ_i f_i(k)``, of what errors come
with: measurement noise; timing, the squared difference of ``x_pb`` from sample to sample; and what the residual model
knows of itself, the variance of the mixture of its experts. All are known before the window is measured, so that the
variance is small at standstill and large in motion. Timing and that variance act on
later samples, too: each is averaged over the samples since the last measured one. The published standard deviation is
``c(k)·√v``.

After each window every ``θ_i`` takes a step of expectation maximisation for normal errors of that variance (variance
components: Dempster, Laird, Rubin, J. R. Stat. Soc. B 39 (1977)). The factor ``c(k)``, which changes exponentially from
the beginning to the end of a window, moves until intervals of 50, 90 and 95 % miss as many errors as they may, together
(adaptive conformal inference: Gibbs, Candès, NeurIPS 2021): errors are not normal, and neighbouring ones are alike. The
tails are heavier than normal, so that 50 % cover a little more and 95 % a little less.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ..base.settings import PredictorSettings
from ..base.signals import PREDICTION_MAX, Array

_SHARES = (4.0, 2.0)
"""First variance of the error by each cause, relative to that cause: timing, variance of the experts."""

_N_COMPONENTS = 1 + len(_SHARES)  # of the variance
_UNKNOWN_NOISE = 25.0  # first variance of a noise that is not known, relative to λ
_FELT_FOR = 0.1  # time constant of the averaging of timing and variance of the experts, in windows
_LEAST_SHARE, _MOST_SHARE = 1e-9, 1e4  # bounds on the variance relative to its cause, relative to the first one

_THETA_LEAST = np.array([0.0, *(_LEAST_SHARE * share for share in _SHARES)])
_THETA_MOST = np.array([PREDICTION_MAX, *(_MOST_SHARE * share for share in _SHARES)])

_FLOOR = 1e-8  # least variance relative to the recent mean square of the residual
_LEAST_VARIANCE = 1e-100  # variance, m², that no divisor is below

_OUTLYING, _VANISHING = 16.0, 0.01
"""Largest square of an error, relative to its variance, that counts; least change of a component in one window."""

_RECENT = 0.9  # factor by which the mean square of the residual fades from window to window

_MEMORY, _FIRST_EVIDENCE, _STEP = 0.97, 1.0, 6.0
"""Factor by which evidence fades from window to window; evidence that the first values count for, in windows; and the
step of expectation maximisation, which by itself would be slow where components are alike."""

_LEVELS = ((0.6745, 0.5), (1.645, 0.1), (1.96, 0.05))
"""Standard deviations, and the probability that a normal error exceeds them."""

_FACTOR_RATE, _FACTOR_MAX = 0.1, 4.0
"""Change of ``ln c`` in the middle of a window from one window to the next per share of errors; bound on it."""

_RATIO, _RATIO_RATE, _RATIO_MAX = 1.2, 0.8, 16.0
"""``c`` at the end of a window relative to its beginning: the first one, the change of its logarithm per share of
errors, weighted by their distance from the middle, and bound."""


class PredictedError(NamedTuple):
    """What is known of the error of a window before it is measured."""

    e_h: Array  # (n,), m: published residual
    components: Array  # (n, _N_COMPONENTS): ``f_i(k)``; m² but for the first, which is 1
    std: Array  # (n,), m: standard deviation of the error


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Standard deviation of prediction errors, calibrated online."""

    theta: Array  # (_N_COMPONENTS,): ``θ``: variance of the noise, m², and of the others relative to their causes
    evidence: Array  # (_N_COMPONENTS,): effective number of windows of each ``θ``
    factor: float  # ``c`` in the middle of a window
    ratio: float  # ``c`` at its end relative to that at its beginning
    recent: float  # m²: recent mean square of the residual; 0 before the first window

    @classmethod
    def init(cls, variance: float) -> "Uncertainty":
        """Return what is assumed before the first window is measured, with the ``variance``, m², of the noise."""
        return cls(np.array([variance, *_SHARES]), np.zeros(_N_COMPONENTS), 1.0, 1.0, 0.0)

    def predict(self, x_pb: Array, e_h: Array, variance: Array | float, Np: int) -> PredictedError:
        """Return what is known of the error of the next window.

        ``x_pb``, ``e_h``, (n,), m: physics-based prediction and published residual, relative to the start;
        ``variance``, (n,) or float, m²: what the residual model knows of its error; ``Np``: samples of a usual
        window.
        """
        n = len(x_pb)
        bounded = e_h
        if not np.abs(e_h).max() <= PREDICTION_MAX:  # a prediction that diverges is refused when it is published
            bounded = np.clip(np.nan_to_num(e_h), -PREDICTION_MAX, PREDICTION_MAX)
        components = np.empty((n, _N_COMPONENTS))
        components[:, 0] = 1.0
        changes = np.diff(x_pb) if n > 1 else np.zeros(1)  # the first one as the second
        components[:, 1] = np.minimum(np.abs(np.concatenate((changes[:1], changes)))[:n], PREDICTION_MAX) ** 2
        components[:, 2] = variance
        gain = 1.0 / (1.0 + _FELT_FOR * Np)
        components[:, 1:] = lfilter([gain], [1.0, gain - 1.0], components[:, 1:], axis=0)
        c = self.factor * self.ratio ** _from_middle(n, Np)
        std = np.minimum(c * np.sqrt(_variance(components, self.theta, self.recent)), PREDICTION_MAX)
        return PredictedError(bounded, components, std)

    def learn(self, predicted: PredictedError, residuals: Array, accepted: NDArray[np.bool_], Np: int) -> "Uncertainty":
        """Return the uncertainty with the measurement of a window.

        ``residuals``, (m,), m: measured residuals ``e_pb`` of its first ``m`` samples; ``accepted``, (m,): whether
        they count; ``Np``: samples of a usual window.
        """
        m = len(residuals)
        signals = residuals, predicted.e_h[:m], predicted.components[:m], predicted.std[:m], _from_middle(m, Np)
        measured, e_h, components, std, place = (one[accepted] for one in signals)
        if not measured.any():  # nothing to learn a scale from
            return self
        error, mean_square = measured - e_h, _mean_square(measured)
        theta, factor, ratio, recent = self.theta.copy(), self.factor, self.ratio, mean_square
        if self.recent > 0.0:
            # Follow how many errors, relative to their deviations, are beyond the intervals, and where.
            missed = sum((np.abs(error) / std > z) - beyond for z, beyond in _LEVELS)
            factor *= math.exp(_FACTOR_RATE * float(np.mean(missed)))
            ratio *= math.exp(_RATIO_RATE * float(np.mean(missed * place)))
            factor = min(max(factor, 1.0 / _FACTOR_MAX), _FACTOR_MAX)
            ratio = min(max(ratio, 1.0 / _RATIO_MAX), _RATIO_MAX)
            recent = _RECENT * self.recent + (1.0 - _RECENT) * mean_square
        else:
            ratio, theta[0] = _RATIO, _mean_square(error)
        variance = _variance(components, theta, recent)
        share = components * theta / variance[:, None]  # of the variance, that is due to each component
        total = share.sum(axis=0)
        evidence = _MEMORY * self.evidence + total / Np
        seen = share.T @ np.minimum(error**2 / variance, _OUTLYING)
        change = np.maximum(np.divide(seen, total, out=np.ones(_N_COMPONENTS), where=total > 0.0), _VANISHING)
        step = np.minimum(_STEP * total / Np / (evidence + _FIRST_EVIDENCE), 1.0)
        least = np.array([_FLOOR * recent, *_THETA_LEAST[1:]])
        theta = np.minimum(np.maximum(theta * change**step, least), _THETA_MOST)
        return Uncertainty(theta, evidence, factor, ratio, recent)


def _from_middle(n: int, Np: int) -> Array:
    """Return the places of samples in a usual window, ``(n,)``, from −½ at its beginning to ½ at its end."""
    return np.minimum((np.arange(n) + 0.5) / Np, 1.0) - 0.5


def _variance(components: Array, theta: Array, recent: float) -> Array:
    """Return the variance of the error, ``(n,)``, m²."""
    return np.asarray(components @ theta + (_FLOOR * recent + _LEAST_VARIANCE))


def first_variance(settings: PredictorSettings) -> float:
    """Return the variance of the measurement noise, m², that is assumed before the first window is measured."""
    if settings.noise_std > 0.0:
        return max(settings.lam, settings.noise_std**2)
    return min(_UNKNOWN_NOISE * settings.lam, PREDICTION_MAX)


def _mean_square(signal: Array) -> float:
    return min(float(signal.dot(signal)) / len(signal), PREDICTION_MAX)
