"""Model of the residual ``e_pb = x − x_pb``: the paper's, or with averaging the averaged one.

Each function calls its counterpart for the model that a state is of. A state is a record; a function returns another.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..model.discrete import DiscreteModel
from . import paper
from .averaging import model as averaging
from .averaging.features import Disturbance
from .averaging.model import AveragedModel
from .paper import PaperModel
from .regression import RidgeRegression
from .window import FeatureScales, Forecast, ResidualWindow

__all__ = ["ResidualModel", "forecast", "init", "learn", "plan_ahead", "restart", "take_over"]

ResidualModel: TypeAlias = PaperModel | AveragedModel
"""State of either model."""


def init(settings: PredictorSettings, discrete: DiscreteModel, own: tuple[Disturbance, ...]) -> ResidualModel:
    """Return the model at rest, with nothing learned: of ``G_pb``, with averaging with the user's own disturbances."""
    return averaging.init(settings, discrete, own) if settings.averaging else paper.init(settings)


def plan_ahead(state: ResidualModel) -> ResidualModel:
    """Return the model where a compensator decides the commands."""
    return averaging.plan_ahead(state) if isinstance(state, AveragedModel) else state


def take_over(state: ResidualModel, learned: Any, regressions: tuple[RidgeRegression, ...]) -> ResidualModel:
    """Return the model with what another one of its kind has learned."""
    if isinstance(state, AveragedModel):
        return averaging.take_over(state, learned, regressions)
    return replace(state, regression=regressions[0])


def restart(state: ResidualModel) -> ResidualModel:
    """Return the model at the beginning of another run, at rest; what was learned is kept."""
    return averaging.restart(state) if isinstance(state, AveragedModel) else paper.restart(state)


def forecast(state: ResidualModel, window: ResidualWindow, scales: FeatureScales | None = None) -> Forecast:
    """Predict the residual over the next window; with averaging a compensator gives the ``scales`` of its preview."""
    if isinstance(state, AveragedModel):
        return averaging.forecast(state, window, scales)
    return paper.forecast(state, window)


def learn(
    state: ResidualModel, forecast: Forecast, x: Array, *, fold: bool = True
) -> tuple[ResidualModel, NDArray[np.bool_]]:
    """Return the model that has learned from a window measured at ``x``, and which samples it accepted, ``(m,)`` bool.

    Positions, m, are relative to the start, NaN where missing. Without ``fold`` they are not learned; the next window
    starts from them in any case.
    """
    if isinstance(state, AveragedModel):
        assert isinstance(forecast, averaging.AveragedForecast)
        return averaging.learn(state, forecast, x, fold=fold)
    return paper.learn(state, forecast, x, fold=fold)
