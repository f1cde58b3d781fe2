"""Forecast of the trusted model over a window, kept until the window is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...base.signals import Array
from ..forecast import FeatureScales, Forecast
from .experts import ExpertPrediction

__all__ = ["TrustedForecast"]


@dataclass(frozen=True)
class TrustedForecast(Forecast):
    """Window predicted by the trusted model.

    Attributes
    ----------
    x : (n,) array, m
        Position that the stiffness acts at.
    stacked : (n_experts, n) array, m
        Predictions that are stacked; 0 where an expert knows nothing.
    predictions : mapping
        Of the experts that know something, by their places in the stack.
    scales : FeatureScales
    """

    x: Array
    stacked: Array
    predictions: Mapping[int, ExpertPrediction]
    scales: FeatureScales
