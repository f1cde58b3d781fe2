"""Hint at a residual that repeats with the position, with the predictor's gain if it is given the period."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..base.metrics import shown_figure
from ..base.settings import PredictorSettings
from ..identify.output_error import in_time
from ..identify.periodic import residual_period
from ..logs.units import DisplayUnits
from ..model.physics import ModalModel
from .choice import trained_rms
from .replay import Recording

__all__ = ["REPEATS", "period_finding"]

REPEATS = "the residual repeats every"
"""Beginning of the finding that a period would help, which names its option."""

_GAIN = 0.9
"""Ratio of the errors with and without the period below which it is worth a hint."""


def period_finding(
    model: ModalModel, recordings: Sequence[Recording], settings: PredictorSettings, shown: DisplayUnits
) -> list[str]:
    """Return that the residual repeats with the position, from the training samples, in words.

    Empty where a period is given, nothing repeats, or the predictor gains little by it.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``.
    recordings : sequence of Recording
    settings : PredictorSettings
    shown : DisplayUnits
        Units of the words.
    """
    late = settings.n_late
    training = [in_time(*one.training, late) for one in recordings if one.n_train > late + 1]
    if settings.period or not training:
        return []
    period = residual_period(training, model, settings.T_s, settings.input_hold)
    if period == 0.0 or period > PredictorSettings.parameters()["period"].maximum:
        return []
    without, with_it = (trained_rms(model, one, recordings) for one in (settings, replace(settings, period=period)))
    if not with_it < _GAIN * without:
        return []
    factor, position = shown.position
    scale, unit = shown.error(without)
    return [
        f"{REPEATS} {factor * period:.6g} {position}: with --period {period:g} the hybrid's error would go from "
        f"{shown_figure(scale * without)} to {shown_figure(scale * with_it)} {unit}, by replays of the training half"
    ]
