"""Look-ahead window: its prediction, pending and published, and its lifted affine operator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from ..base.signals import Array, as_published, as_samples
from .uncertainty import PredictedError

__all__ = [
    "FeatureScales",
    "Forecast",
    "PredictedWindow",
    "Prediction",
    "ResidualWindow",
    "WindowOperator",
]


class ResidualWindow(NamedTuple):
    """What is known of a window before its residual is predicted.

    Attributes
    ----------
    x_d, x_pb : (n,) array, m
        Commands and physics-based prediction, relative to ``start``.
    start : float, m
        Initial position.
    path : (m,) array, m
        Commands as they came, as far as they are known, relative to ``start``: behind a compensator they are more than
        the window's, and not modified but for those that are late.
    """

    x_d: Array
    x_pb: Array
    start: float
    path: Array


class FeatureScales(NamedTuple):
    """Scales that the features with averaging and their priors are relative to, from the commands ahead.

    Attributes
    ----------
    velocity : float, m/s
        Velocity scale of the friction features.
    largest : (n_static,) array
        Largest magnitudes of the static features, so far and ahead.
    step : float, m
        Largest change of the command from sample to sample, so far and ahead.
    command_step, command_square : float, m and m²
        That change, and the largest mean square of the command's residual, that priors of the command's expert come
        from.
    """

    velocity: float
    largest: Array
    step: float
    command_step: float
    command_square: float


@dataclass(frozen=True)
class Forecast:
    """Residual of a window, predicted before it is measured.

    Attributes
    ----------
    window : ResidualWindow
    e_h : (n,) array, m
        Predicted residual.
    variance : (n,) array, m²
        What the model knows of the error of ``e_h``: the variance of the mixture of its experts; 0 without experts.
    scales : FeatureScales, optional
        With averaging.
    """

    window: ResidualWindow
    e_h: Array
    variance: Array
    scales: FeatureScales | None


@dataclass(frozen=True)
class Prediction:
    """Prediction of one window.

    Attributes
    ----------
    x_pb : (n,) array, m
        Physics-based prediction, eq. (2).
    e_h : (n,) array, m
        Predicted residual ``wᵀφ``, during the warm-up too.
    x_h_std : (n,) array, m
        Standard deviation of the error ``x − x_h`` against the measured position.
    n_warm_up : int
        Leading samples within the warm-up, where ``x_h = x_pb``.
    """

    x_pb: Array
    e_h: Array
    x_h_std: Array
    n_warm_up: int

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
    """Predicted window pending measurement.

    Attributes
    ----------
    forecast : Forecast
        Prediction of the residual by its model.
    error : PredictedError
        Published residual, and what is known of its error.
    """

    forecast: Forecast
    error: PredictedError


@dataclass(frozen=True)
class WindowOperator:
    """The hybrid model over one window, affine in its commands; eq. (3).

    ``x_h = G_h x_d + free`` with ``G_h`` lower-triangular Toeplitz, and the same for the physics model alone.

    Attributes
    ----------
    g_h, g_pb : (n,) array, m/m
        First columns of ``G_h`` and ``G_pb``.
    free, free_pb : (n,) array, m
        Free responses, to zero commands over the window.
    """

    g_h: Array
    free: Array
    g_pb: Array
    free_pb: Array

    @property
    def G_h(self) -> Array:
        """``(n, n)`` array, lower-triangular Toeplitz."""
        return np.asarray(toeplitz(self.g_h, np.zeros(len(self.g_h))))

    @property
    def G_pb(self) -> Array:
        """``(n, n)`` array, lower-triangular Toeplitz."""
        return np.asarray(toeplitz(self.g_pb, np.zeros(len(self.g_pb))))

    def __call__(self, x_d: ArrayLike) -> Array:
        """Return ``G_h x_d + free`` for commands ``x_d``, ``(n,)``, m."""
        command = as_samples(x_d, "x_d", len(self.g_h))
        return np.asarray(lfilter(self.g_h, [1.0], command)) + self.free
