"""Interface of a model of the residual ``e_pb = x − x_pb``, which the predictor adds to the physics model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.saved import Saved
from ..base.settings import PredictorSettings
from ..base.signals import Array
from .forecast import FeatureScales, Forecast
from .regression import RidgeRegression

__all__ = ["ResidualModel", "SavedFields", "WindowInputs"]

AnyForecast = TypeVar("AnyForecast", bound=Forecast)


class WindowInputs(NamedTuple):
    """What is known of a window before its residual is predicted.

    Attributes
    ----------
    x_d, x_pb : (n,) array, m
        Commands and physics-based prediction, relative to ``start``.
    start : float, m
        Initial position.
    """

    x_d: Array
    x_pb: Array
    start: float


@dataclass(frozen=True)
class SavedFields:
    """Fields of a saved state: scalars, arrays and nested blobs, by their names."""

    meta: Mapping[str, Any]
    arrays: Mapping[str, Array]
    parts: Mapping[str, bytes]


class ResidualModel(ABC, Generic[AnyForecast]):
    """Model of the residual, learned window by window from its own forecasts and their measurement.

    Attributes
    ----------
    may_miss : bool
        Whether measurements may be NaN, which is missing.
    regression : RidgeRegression
        Of all learned samples.
    n_rejected : int
        Measurements of this run that were missing or not plausible.
    """

    may_miss: ClassVar[bool]
    regression: RidgeRegression
    n_rejected: int

    @property
    def regressions(self) -> tuple[RidgeRegression, ...]:
        """All regressions that another run begins with, in the order of a weights file."""
        return (self.regression,)

    @property
    @abstractmethod
    def lag_weights(self) -> Array:
        """Weights of the lags of ``e_pb`` from all learned samples, ``(p,)``."""

    @property
    @abstractmethod
    def last(self) -> float:
        """Last residual that was accepted, m: that which the next window starts from."""

    @property
    def may_begin_in_motion(self) -> bool:
        """Whether the state of ``G_pb`` that a run begins with follows from its first residuals; else it is rest."""
        return False

    @abstractmethod
    def restart(self) -> None:
        """Begin another run, at rest; what was learned is kept."""

    @abstractmethod
    def forecast(self, window: WindowInputs, scales: FeatureScales | None = None) -> AnyForecast:
        """Predict the residual over the next window; nothing that is learned is changed.

        Parameters
        ----------
        window : WindowInputs
        scales : FeatureScales, optional
            Scales of the features over a preview; those of the window if left out. For a model that has some.
        """

    @abstractmethod
    def learn(self, forecast: AnyForecast, x: Array, *, fold: bool = True) -> NDArray[np.bool_]:
        """Learn from the measurement of a window; return which samples are accepted, ``(m,)`` bool.

        Parameters
        ----------
        forecast : Forecast
            The last one.
        x : (m,) array, m
            Measured positions of its first ``m`` samples, relative to the start; NaN where missing.
        fold : bool
            Whether they are learned; the next window starts from them in any case.
        """

    def begin_in_motion(self, forecast: AnyForecast, x_d: Array, x_pb: Array) -> AnyForecast:
        """Return the forecast of a run that began in motion, with the commands and ``x_pb`` of that motion."""
        return replace(forecast, x_d=x_d, x_pb=x_pb)

    @staticmethod
    @abstractmethod
    def check_sizes(saved: Saved, settings: PredictorSettings) -> None:
        """Raise StateError if arrays do not have the sizes of the settings, before any is allocated from these."""

    @abstractmethod
    def saved(self) -> SavedFields:
        """Return the complete state."""

    @abstractmethod
    def restore(self, saved: Saved) -> None:
        """Restore the state of :meth:`saved`; StateError if it is inconsistent: the model must not be used then."""

    def saved_forecast(self, forecast: AnyForecast) -> SavedFields:
        """Return what a forecast does not have from the state and its window."""
        return SavedFields({}, {}, {})

    def restored_forecast(self, saved: Saved, window: WindowInputs) -> AnyForecast:
        """Return the forecast of :meth:`saved_forecast`; StateError if it is inconsistent."""
        return self.forecast(window)

    def learned(self) -> dict[str, Array]:
        """Return what has been learned besides the regression, in the order of a weights file."""
        return {}

    def is_sound(self, learned: Mapping[str, Array]) -> bool:
        """Return whether the numbers of :meth:`learned` are finite and in range."""
        return True

    @abstractmethod
    def restore_learned(self, learned: Mapping[str, Array]) -> None:
        """Restore the numbers of :meth:`learned`, which are sound."""
