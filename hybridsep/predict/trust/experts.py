"""Expert of the residual: a regression with normal priors, trusted as far as its own variance allows."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ...base.signals import Array
from ..regression import PenalisedSolution, RidgeRegression
from .constants import TrustConstants

__all__ = ["Evidence", "EvidenceOfRuns", "Expert", "ExpertPrediction", "ResidualScale", "SolvedExpert", "lags"]

_DIVERGED = 1e6
"""Bound on the impulse response of a recursion, on the variance relative to the square of the bound on a prediction,
and on the correlation that a window shows."""

_LAG_BOUND = 10.0
"""Largest lag within a window, relative to the bound on a prediction: what is beyond has diverged."""

_NO_PENALTY = 1e-40
"""λ of the factor itself, m²: penalties come with each solution."""

_RESOLUTION = 1e-13
"""Least variance of the noise, and least sum of the squares of the rows about the weights, relative to the sum of the
squares of the targets: the C core has it from a Gram matrix, which does not resolve less, and no less matters before
10⁷ rows without noise."""

_LEAST = 1e-150
"""Magnitude of a feature that counts as 0."""


class ResidualScale(NamedTuple):
    """Size of the residuals so far.

    Attributes
    ----------
    largest_square : float, m²
        Largest mean square of a window.
    largest : float, m
        Largest magnitude.
    """

    largest_square: float = 0.0
    largest: float = 0.0

    def grown(self, growth: float) -> ResidualScale:
        """Return the scale of residuals that are larger by a factor."""
        return ResidualScale(growth**2 * self.largest_square, growth * self.largest)

    def with_window(self, residuals: Array) -> ResidualScale:
        """Return the scale with another window of residuals, ``(n,)``, m, n ≥ 1."""
        mean_square, largest = float(np.mean(residuals**2)), float(np.abs(residuals).max())
        return ResidualScale(max(self.largest_square, mean_square), max(self.largest, largest))


@dataclass
class Evidence:
    """Rows that experts have learned: their factor, and their number, weighted."""

    regression: RidgeRegression
    n_rows: float = 0.0

    @classmethod
    def none(cls, n_features: int) -> Evidence:
        """Return no evidence on the weights of ``n_features`` features."""
        return cls(RidgeRegression(n_features, _NO_PENALTY))

    def discount(self, kept: float) -> None:
        """Weigh all rows so far by ``kept``."""
        if kept < 1.0:
            self.regression.discount(kept)
            self.n_rows *= kept

    def less(self, kept: float) -> Evidence:
        """Return a copy whose rows are weighed by ``kept``."""
        copy = Evidence(deepcopy(self.regression), self.n_rows)
        copy.discount(kept)
        return copy

    def add(self, other: Evidence) -> None:
        """Add the rows of other evidence on the same weights."""
        self.regression.update_from(other.regression)
        self.n_rows += other.n_rows

    def learn(self, rows: Array, lagged: Array, target: Array) -> None:
        """Update with rows of features ``(m, n_static)``, lags ``(m, p)`` and targets ``(m,)``."""
        stacked = np.asfortranarray(np.column_stack((rows, lagged, target)))
        self.regression.update_stacked(stacked)
        self.n_rows += len(target)


class EvidenceOfRuns:
    """Rows of this run and, as they are doubted, those of earlier ones apart.

    Parameters
    ----------
    n_features : int

    Attributes
    ----------
    this : Evidence
    earlier : Evidence, optional
    """

    def __init__(self, n_features: int) -> None:
        self.n_features = n_features
        self.forget()

    def forget(self) -> None:
        """Forget all rows."""
        self.this = Evidence.none(self.n_features)
        self.earlier: Evidence | None = None

    @property
    def n_rows(self) -> float:
        """Number of all rows, weighted."""
        return self.this.n_rows + (0.0 if self.earlier is None else self.earlier.n_rows)

    def begin_run(self, most: float) -> None:
        """Begin another run: all rows so far are of earlier ones, and weigh at most as ``most`` of this one."""
        everything = self.all()
        everything.discount(most / max(everything.n_rows, most))
        self.forget()
        self.earlier = everything if everything.n_rows > 0.0 else None

    def all(self, kept: float = 1.0) -> Evidence:
        """Return all rows, those of earlier runs weighed by ``kept``; not to be changed."""
        if self.earlier is None:
            return self.this
        if self.this.n_rows == 0.0:
            return self.earlier.less(kept)
        everything = self.this.less(1.0)
        everything.add(self.earlier.less(kept))
        return everything

    def believe_earlier(self) -> None:
        """Go on with all rows as with those of this run."""
        self.this, self.earlier = self.all(), None

    def forget_earlier(self) -> None:
        """Go on with the rows of this run alone."""
        self.earlier = None

    def discount(self, kept: float) -> None:
        """Weigh all rows so far by ``kept``."""
        self.this.discount(kept)
        if self.earlier is not None:
            self.earlier.discount(kept)


class ExpertPrediction(NamedTuple):
    """Residual predicted over a window by one expert.

    Attributes
    ----------
    e_h : (n,) array, m
        Shrunk by its variance, and bounded.
    unshrunk : (n,) array, m
    kept : (n,) array
        What the variance leaves of it.
    variance : (n,) array, m²
        What is left of the variance of the residual, ``v·τ²/(v + τ²)``.
    noise_variance : float, m²
        Mean square of the rows so far about this expert.
    """

    e_h: Array
    unshrunk: Array
    kept: Array
    variance: Array
    noise_variance: float

    @property
    def shrink(self) -> Array:
        """What shrinking and bounds leave of ``unshrunk``, ``(n,)``."""
        return np.asarray(np.divide(self.e_h, self.unshrunk, out=self.kept.copy(), where=self.unshrunk != 0.0))


class SolvedExpert(NamedTuple):
    """Expert with weights.

    Attributes
    ----------
    n_static : int
        Features without lags, the first ones of a row.
    solution : PenalisedSolution
        Weights of these and of the lags.
    variance, noise_variance : float, m²
        Of the noise that the penalties come from, and mean square of the rows about the weights.
    """

    n_static: int
    solution: PenalisedSolution
    variance: float
    noise_variance: float

    @property
    def lag_weights(self) -> Array:
        """Weights of the last ``p`` residuals, newest first, ``(p,)``."""
        return self.solution.weights[self.n_static :]

    def predict(
        self, rows: Array, past: Array, largest_square: float, bound: float, held: ExpertPrediction | None = None
    ) -> ExpertPrediction:
        """Predict the residual over a window in free run.

        Weights have normal priors, so the variance of ``wᵀφ`` is known; it is carried through the recursion's impulse
        response. A prediction of variance ``τ²`` is shrunk by ``v/(v + τ²)``, ``v`` being the largest mean square of a
        window: at a first motion, a first reversal or in a region not seen yet the physics model remains.

        Parameters
        ----------
        rows : (n, n_static) array
            Features of the window without lags.
        past : (≥ p,) array, m
            Last residuals, newest first.
        largest_square : float, m²
            Largest mean square of a window.
        bound : float, m
            On the prediction.
        held : ExpertPrediction, optional
            Prediction whose shrinking is held; else it is computed.
        """
        w_e = self.lag_weights
        p = len(w_e)
        drive, response = rows @ self.solution.weights[: self.n_static], np.zeros(0)
        if p:
            drive, response = _recursion(w_e, drive, past[:p])
        finite = np.isfinite(drive)
        e = np.clip(np.where(finite, drive, 0.0), -_LAG_BOUND * bound, _LAG_BOUND * bound)
        if held is not None:
            kept = held.kept
        else:
            phi = np.hstack((rows, lags(past[:p], e))) if p else rows
            variance = self.variance * self.solution.leverage(phi)
            if p:
                variance = np.asarray(lfilter(response**2, [1.0], variance))
            most = _DIVERGED * bound**2
            variance = np.where(finite, np.minimum(variance, most), most)
            kept = largest_square / (largest_square + variance)
        return ExpertPrediction(
            np.clip(e, -bound, bound) * kept, e, kept, largest_square * (1.0 - kept), self.noise_variance
        )


class Expert:
    """Regression on static features and lags, and what is known of its errors.

    Parameters
    ----------
    shares : (n_static,) array
        Effect that a feature may have, relative to the largest; these are the first ones of a row.
    p : int
        Lags of the residual.
    constants : TrustConstants

    Attributes
    ----------
    noise_variance : float, m²
        Of a row about the model; 0 until it is known.
    correlation : float
        Rows that count as one: where a disturbance has no feature, the errors of neighbouring rows are alike.
    """

    def __init__(self, shares: Array, p: int, constants: TrustConstants) -> None:
        self.shares, self.constants = shares, constants
        self.lag_scales = np.sqrt(constants.last_lag ** (np.arange(p) / max(p, 1)))
        self.restart()

    def restart(self) -> None:
        """Begin with nothing known of the errors."""
        self.noise_variance, self.correlation = 0.0, 1.0

    def take_over(self, other: Expert) -> None:
        """Take over what is known of the errors of another expert."""
        self.noise_variance, self.correlation = other.noise_variance, other.correlation

    def solve(self, evidence: Evidence, largest: Array, effect: float, first: float, least: float) -> SolvedExpert:
        """Return the expert with the weights that follow from all rows so far.

        Parameters
        ----------
        evidence : Evidence
        largest : (n_static,) array
            Largest magnitudes of the features, those of the window to predict included.
        effect : float, m
            Prior standard deviation of a feature's effect.
        first, least : float, m²
            Variance of the noise while it is not known, and the least one.
        """
        resolved = _RESOLUTION * evidence.regression.target_square
        variance = max(self.noise_variance or first, least, resolved) * self.correlation
        scales = effect * self.shares / np.maximum(largest, _LEAST)
        priors = np.concatenate((scales, self.lag_scales))
        solution = evidence.regression.penalised(variance / priors**2)
        residual_sum = max(solution.residual_sum, resolved)
        return SolvedExpert(len(self.shares), solution, variance, residual_sum / evidence.n_rows)

    def judge(self, prediction: ExpertPrediction, measured: Array, accepted: NDArray[np.bool_], given: float) -> None:
        """Estimate noise and correlation from the errors of a window.

        Parameters
        ----------
        prediction : ExpertPrediction
        measured, accepted : (m,) array, m and bool
            Residuals of its first samples, and which count.
        given : float, m²
            Variance of the noise, if it is known; else 0.
        """
        c, self.noise_variance = self.constants, given or prediction.noise_variance
        if self.noise_variance > 0.0:
            error = (measured - prediction.unshrunk[: len(measured)])[accepted]
            seen = min(len(error) * float(np.mean(error)) ** 2 / self.noise_variance, _DIVERGED)
            self.correlation += c.correlation_rate * (seen - self.correlation)
            self.correlation = min(max(self.correlation, 1.0), c.correlation_max)


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
