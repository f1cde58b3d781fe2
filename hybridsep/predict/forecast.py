"""What the residual model with trust predicts of a window, kept until the window is measured."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.signals import Array
from .candidates import CandidatePrediction

__all__ = ["Forecast"]


@dataclass(frozen=True)
class Forecast:
    """Window predicted before it is measured.

    Attributes
    ----------
    x_d, x_pb : (n,) array, m
        Commands and physics-based prediction, relative to the start.
    e_h : (n,) array, m
        Predicted residual.
    disagreement : (n,) array, m²
        Variance of the candidates about their blend.
    hold : float, m
        Last residual, bounded: the prediction of the hold candidate.
    predictions : tuple of CandidatePrediction
        Of the learned candidates; empty before anything is learned.
    largest : (n_static,) array
        Largest magnitudes of the static features, this window included.
    velocity_scale : float, m/s
        Velocity scale of the friction features.
    """

    x_d: Array
    x_pb: Array
    e_h: Array
    disagreement: Array
    hold: float
    predictions: tuple[CandidatePrediction, ...]
    largest: Array
    velocity_scale: float
