"""Model of the residual ``e_pb = x − x_pb``: what the paper's and the averaged one have in common.

A state is a record; a method returns another.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array
from .regression import RidgeRegression
from .window import FeatureScales, Forecast, ResidualWindow

__all__ = ["ResidualModel"]


class ResidualModel(Protocol):
    """State of either model."""

    @property
    def may_miss(self) -> bool:
        """Whether a measurement may be missing, and a run begin in motion."""

    @property
    def learned(self) -> Any:
        """What has been learned besides the rows: a record of the numbers of a weights file."""

    @property
    def regressions(self) -> tuple[RidgeRegression, ...]:
        """All regressions that another run begins with."""

    @property
    def lag_weights(self) -> Array:
        """Autoregressive weights, ``(p,)``."""

    @property
    def n_scaled(self) -> int:
        """Features with scales; 0 if it has none."""

    @property
    def last(self) -> float:
        """Last residual that counts, m."""

    @property
    def farthest(self) -> float:
        """Largest residual among the last samples, m, where these were rejected; else 0."""

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible."""

    @property
    def is_sound(self) -> bool:
        """Whether the numbers, which are in range, fit each other."""

    def restart(self) -> ResidualModel:
        """Return the model at the beginning of another run, at rest; what was learned is kept."""

    def plan_ahead(self) -> ResidualModel:
        """Return the model where a compensator decides the commands."""

    def take_over(self, learned: Any, regressions: tuple[RidgeRegression, ...]) -> ResidualModel:
        """Return the model with what another one of its kind has learned."""

    def begin_in_motion(self, window: ResidualWindow, scales: Any) -> ResidualModel:
        """Return the model at the beginning of a run whose first window, of ``scales``, has motion before it."""

    def forecast(self, window: ResidualWindow, scales: FeatureScales | None = None) -> Forecast:
        """Predict the residual over the next window; a compensator gives the ``scales`` of its preview."""

    def learn(self, forecast: Any, x: Array, *, fold: bool = True) -> tuple[ResidualModel, NDArray[np.bool_]]:
        """Return the model that has learned from a window measured at ``x``, and which samples it accepted, ``(m,)``.

        Positions, m, are relative to the start, NaN where missing. Without ``fold`` they are not learned; the next
        window starts from them in any case.
        """
