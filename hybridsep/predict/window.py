"""Look-ahead window: prediction, pending and published data, and its lifted affine operator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from ..base.signals import Array, as_published, as_samples
from .forecast import Forecast
from .uncertainty import PredictedError

__all__ = ["PredictedWindow", "Prediction", "PublishedWindow", "WindowOperator"]


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


@dataclass(frozen=True)
class PredictedWindow:
    """Predicted window pending measurement.

    Attributes
    ----------
    start : float
        Initial position, m.
    error : PredictedError
        Published residual, and what is known of its error.
    forecast : Forecast
        Commands, response of the physics model, and prediction of the residual by its model, relative to ``start``.
    """

    start: float
    error: PredictedError
    forecast: Forecast


@dataclass(frozen=True)
class PublishedWindow:
    """Commands of a window and the position predicted under them.

    Attributes
    ----------
    x_d, x_dm : (Np,) arrays, m
        Commanded position, and the modified command sent to the drive; the same without a planner.
    x_pb, x_h : (Np,) arrays, m
        Physics-based prediction under ``x_dm``, and that of the best available model.
    x_h_std : (Np,) array, m
        Standard deviation of the error of ``x_h``; 0 where it is not known.
    state : int
        Model that planned it (:class:`~hybridsep.compensate.plan.SepState`); 0 without a planner.
    n_warm_up : int
        Leading samples where ``x_h = x_pb``.
    n_followed, state_before : int
        Leading samples that follow the plan before, in which a real-time implementation makes this one, and the model
        that planned them.
    """

    SIGNALS: ClassVar[tuple[str, ...]] = ("x_d", "x_dm", "x_pb", "x_h", "x_h_std")

    x_d: Array
    x_dm: Array
    x_pb: Array
    x_h: Array
    x_h_std: Array
    state: int
    n_warm_up: int
    n_followed: int = 0
    state_before: int = 0

    @classmethod
    def at_rest(cls, start: float, Np: int) -> PublishedWindow:
        """Return the window of a drive at rest at ``start``, m, without a prediction."""
        rest = np.full(Np, start)
        return cls(rest, rest, rest, rest, np.zeros(Np), 0, Np)

    @classmethod
    def of_prediction(cls, x_d: Array, prediction: Prediction) -> PublishedWindow:
        """Return the window of unmodified commands; SignalError if its prediction diverges."""
        return cls(x_d, x_d, prediction.x_pb, prediction.x_h, prediction.x_h_std, 0, prediction.n_warm_up)


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
