"""Model of the residual ``e_pb = x − x_pb``: the paper's, or with trust the trusted one.

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
from .paper import PaperModel
from .regression import RidgeRegression
from .residual_window import FeatureScales, Forecast, ResidualWindow
from .trust import forecast as trust_forecast
from .trust import learn as trust_learn
from .trust import state as trust_state
from .trust.disturbances import Disturbance
from .trust.state import TrustedModel

__all__ = ["ResidualModel", "forecast", "init", "learn", "plan_ahead", "restart", "take_over"]

ResidualModel: TypeAlias = PaperModel | TrustedModel
"""State of either model."""


def init(settings: PredictorSettings, discrete: DiscreteModel, own: tuple[Disturbance, ...]) -> ResidualModel:
    """Return the model at rest, with nothing learned: of ``G_pb``, with trust with disturbances of the user's own."""
    return trust_state.init(settings, discrete, own) if settings.trust else paper.init(settings)


def plan_ahead(state: ResidualModel) -> ResidualModel:
    """Return the model where a compensator decides the commands."""
    return trust_state.plan_ahead(state) if isinstance(state, TrustedModel) else state


def take_over(state: ResidualModel, learned: Any, regressions: tuple[RidgeRegression, ...]) -> ResidualModel:
    """Return the model with what another one of its kind has learned."""
    if isinstance(state, TrustedModel):
        return trust_state.take_over(state, learned, regressions)
    return replace(state, regression=regressions[0])


def restart(state: ResidualModel) -> ResidualModel:
    """Return the model at the beginning of another run, at rest; what was learned is kept."""
    return trust_state.restart(state) if isinstance(state, TrustedModel) else paper.restart(state)


def forecast(state: ResidualModel, window: ResidualWindow, scales: FeatureScales | None = None) -> Forecast:
    """Predict the residual over the next window; with trust a compensator gives the ``scales`` of its preview."""
    if isinstance(state, TrustedModel):
        return trust_forecast.forecast(state, window, scales)
    return paper.forecast(state, window)


def learn(
    state: ResidualModel, forecast: Forecast, x: Array, *, fold: bool = True
) -> tuple[ResidualModel, NDArray[np.bool_]]:
    """Return the model that has learned from a window measured at ``x``, and which samples it accepted, ``(m,)`` bool.

    Positions, m, are relative to the start, NaN where missing. Without ``fold`` they are not learned; the next window
    starts from them in any case.
    """
    if isinstance(state, TrustedModel):
        assert isinstance(forecast, trust_forecast.TrustedForecast)
        return trust_learn.learn(state, forecast, x, fold=fold)
    return paper.learn(state, forecast, x, fold=fold)
