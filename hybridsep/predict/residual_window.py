"""Window whose residual a model predicts, and its forecast, kept until the window is measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ..base.signals import Array

__all__ = ["FeatureScales", "Forecast", "ResidualWindow"]


class ResidualWindow(NamedTuple):
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


class FeatureScales(NamedTuple):
    """Scales that the features with trust and their priors are relative to, from the commands ahead.

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
    """

    window: ResidualWindow
    e_h: Array
    variance: Array
