"""What the trusted model predicts of a window, kept until the window is measured."""

from __future__ import annotations

from dataclasses import dataclass

from ...base.signals import Array
from ..forecast import FeatureScales, Forecast
from .candidates import CandidatePrediction

__all__ = ["TrustedForecast"]


@dataclass(frozen=True)
class TrustedForecast(Forecast):
    """Window predicted by the trusted model.

    Attributes
    ----------
    x : (n,) array, m
        Position that the stiffness acts at.
    hold : float, m
        Last residual, bounded: the prediction of the hold candidate.
    predictions : tuple of CandidatePrediction
        Of the learned candidates; empty before anything is learned.
    scales : FeatureScales
    """

    x: Array
    hold: float
    predictions: tuple[CandidatePrediction, ...]
    scales: FeatureScales
