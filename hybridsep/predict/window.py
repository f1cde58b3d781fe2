"""Look-ahead window: its prediction, pending and published, and its lifted affine operator."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from ..base.signals import Array, as_published, as_samples
from .uncertainty import PredictedError


class ResidualWindow(NamedTuple):
    """What is known of a window before its residual is predicted."""

    # (n,), m: commands and physics-based prediction, relative to ``start``
    x_d: Array
    x_pb: Array
    start: float  # m: initial position
    # (m,), m: commands as they came, as far as they are known, relative to ``start``: under a compensator they are
    # more than the window's, go on as its plans take it, and are not modified but for those that are late
    raw_commands: Array


class FeatureScales(NamedTuple):
    """Scales that the features with averaging and their priors are relative to, from the commands ahead."""

    velocity: float  # m/s: velocity scale of the friction features
    largest: Array  # (n_static,): largest magnitudes of the static features, so far and ahead
    step: float  # m: largest change of the command from sample to sample, so far and ahead


@dataclass(frozen=True)
class Forecast:
    """Residual of a window, predicted before it is measured."""

    window: ResidualWindow
    e_h: Array  # (n,), m: predicted residual
    # (n,), m²: what the model knows of the error of ``e_h``: the variance of the mixture of its experts; 0 without
    # experts
    variance: Array
    scales: FeatureScales | None  # with averaging


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction of one window."""

    x_pb: Array  # (n,), m: physics-based prediction, eq. (2)
    e_h: Array  # (n,), m: predicted residual, ``wᵀφ`` or the experts' weighted sum, during the warm-up too
    x_h_std: Array  # (n,), m: standard deviation of the error ``x − x_h`` against the measured position
    n_warm_up: int  # leading samples within the warm-up, where ``x_h = x_pb``

    @property
    def x_h(self) -> Array:
        """``(n,)`` array, m: the published prediction, eq. (4) after the warm-up; SignalError if it diverges."""
        x_h: Array = self.x_pb + self.e_h
        x_h[: self.n_warm_up] = self.x_pb[: self.n_warm_up]
        as_published(self.x_pb, "x_pb")
        return as_published(x_h, "x_h")

    @property
    def active(self) -> NDArray[np.bool_]:
        """``(n,)`` array of bool: whether ``x_h`` is the hybrid prediction there."""
        return np.asarray(np.arange(len(self.x_pb)) >= self.n_warm_up)


class PredictedWindow(NamedTuple):
    """Predicted window pending measurement."""

    forecast: Forecast  # prediction of the residual by its model
    error: PredictedError  # published residual, and what is known of its error


@dataclass(frozen=True)
class WindowOperator:
    """The hybrid model over one window, affine in its commands; eq. (3).

    ``x_h = G_h x_d + free`` with ``G_h`` lower-triangular Toeplitz, and the same for only the physics model.
    """

    g_h: Array  # (n,), m/m: first column of ``G_h``
    free: Array  # (n,), m: free response, to zero commands over the window
    g_pb: Array  # likewise of ``G_pb``
    free_pb: Array

    @property
    def G_h(self) -> Array:
        """``(n, n)`` array, lower-triangular Toeplitz."""
        return np.asarray(toeplitz(self.g_h, np.zeros(len(self.g_h))))

    def __call__(self, x_d: ArrayLike) -> Array:
        """Return ``G_h x_d + free`` for commands ``x_d``, ``(n,)``, m."""
        return np.asarray(lfilter(self.g_h, [1.0], as_samples(x_d, "x_d", len(self.g_h)))) + self.free
