"""Hint at a residual that repeats with the position, with the predictor's gain if it is given the period."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.metrics import rms
from ..base.settings import PredictorSettings
from ..identify.output_error import in_time
from ..identify.periodic import residual_period
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor
from .replay import Recording, replay

__all__ = ["PeriodHint", "period_hint"]

_GAIN = 0.9
"""Ratio of the errors with and without the period below which it is worth a hint."""


@dataclass(frozen=True)
class PeriodHint:
    """Period of the residual over the position.

    Attributes
    ----------
    period : float, m
    rms_without, rms_with : float
        RMS of the hybrid over the later half of the training samples, m, by causal replays.
    """

    period: float
    rms_without: float
    rms_with: float


def period_hint(model: ModalModel, recordings: Sequence[Recording], settings: PredictorSettings) -> PeriodHint | None:
    """Return the hint, from the training samples; None where nothing repeats, or the predictor gains little.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``.
    recordings : sequence of Recording
    settings : PredictorSettings
        Without a period.
    """
    late = settings.n_late
    training = [in_time(*one.training, late) for one in recordings if one.n_train > late + 1]
    period = residual_period(training, model, settings.T_s, settings.input_hold) if training else 0.0
    if period == 0.0 or period > PredictorSettings.parameters()["period"].maximum:
        return None
    errors = []
    for tried in (settings, replace(settings, period=period)):
        found = replay(HybridPredictor(model, tried), recordings, training=True).errors(training=True)[2]
        later = found[len(found) // 2 :]
        errors.append(rms(later[~np.isnan(later)]))
    return PeriodHint(period, *errors) if errors[1] < _GAIN * errors[0] else None
