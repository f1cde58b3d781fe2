"""Numbers of lags of a fit, the settings that online model averaging leaves open; and a hint at a period.

Windows of all that is tried are equally long: a shorter one is always predicted better, by holding the last residual
best of all, so ``Np`` is the controller's look-ahead and is never chosen.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ..base.errors import SignalError
from ..base.metrics import known_rms, shown_figure
from ..base.settings import PARAMETERS, PredictorSettings
from ..identify.output_error import in_time
from ..identify.periodic import residual_period
from ..logs.units import DisplayUnits
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor
from .replay import Recording, replay

WORTH = 0.05  # relative gain below which the default settings stay: less may be chance
_SHARES = (0.1, 0.25, 1.0)  # numbers of lags ``p`` that are tried besides the default, in windows
_Q = (1,)  # numbers of lags ``q`` of the physics-based position that are tried besides the default
_GAIN = 0.9  # ratio of the errors with and without a period below which it is worth a hint


@dataclass(frozen=True)
class Tried:
    """Settings that were tried."""

    p: int  # lags
    q: int
    rms_h: float  # RMS of the hybrid as of :func:`_trained_rms`, m, infinite if it diverged
    chosen: bool


def with_window(settings: PredictorSettings, Np: int) -> PredictorSettings:
    """Return settings for another window, with as many of their lags as fit into it."""
    return replace(settings, Np=Np, p=min(settings.p, Np), q=min(settings.q, Np - 1))


def settings_to_try(
    settings: PredictorSettings, p: Sequence[int] = (), most: int = int(PARAMETERS["p"].maximum)
) -> list[PredictorSettings]:
    """Return the settings and others with the same window, with lags ``p`` if some are given, else at most ``most``."""
    Np = settings.Np
    lags = dict.fromkeys([settings.p, *(p or (min(max(1, round(share * Np)), most) for share in _SHARES))])
    return [replace(settings, p=p) for p in lags] + [replace(settings, q=q) for q in _Q if q < Np and q != settings.q]


def choose_settings(
    model: ModalModel,
    recordings: Sequence[Recording],
    settings: PredictorSettings,
    progress: Callable[[float], object] = lambda _done: None,
    p: Sequence[int] = (),
    most: int = int(PARAMETERS["p"].maximum),
) -> tuple[PredictorSettings, tuple[Tried, ...]]:
    """Return the settings with the least error of causal replays over the training samples, and all that were tried.

    The given ones, the default, are tried first, and stay unless others are better by 5 %; ``p`` and ``most`` as of
    :func:`settings_to_try`.
    """
    candidates, errors = settings_to_try(settings, p, most), []
    for i, candidate in enumerate(candidates):
        try:
            errors.append(_trained_rms(model, candidate, recordings))
        except SignalError:  # it diverges
            errors.append(math.inf)
        progress((i + 1) / len(candidates))
    best = min(range(len(errors)), key=errors.__getitem__)
    chosen = best if errors[best] < (1.0 - WORTH) * errors[0] else 0
    return candidates[chosen], tuple(Tried(one.p, one.q, errors[i], i == chosen) for i, one in enumerate(candidates))


def _trained_rms(model: ModalModel, settings: PredictorSettings, recordings: Sequence[Recording]) -> float:
    """Return the RMS of the hybrid's error over the later half of the training samples, m."""
    # The earlier half shows which learns fastest, but machines run warm
    training = [Recording(*one.training, 0) for one in recordings if one.n_train]
    errors = replay(HybridPredictor(model, settings), training).errors()[2]
    return known_rms(errors[len(errors) // 2 :])


def period_finding(
    model: ModalModel, recordings: Sequence[Recording], settings: PredictorSettings, shown: DisplayUnits
) -> str:
    """Return that the residual repeats with the position, and what the predictor would gain by it, in words.

    Empty where a period is given, nothing repeats in the training samples, or the predictor gains little by it.
    """
    late = settings.n_late
    training = [in_time(*one.training, late) for one in recordings if one.n_train > late + 1]
    if settings.period or not training:
        return ""
    period = residual_period(training, model, settings.T_s, settings.input_hold)
    if period == 0.0 or period > PARAMETERS["period"].maximum:
        return ""
    without, with_it = (_trained_rms(model, one, recordings) for one in (settings, replace(settings, period=period)))
    if not with_it < _GAIN * without:
        return ""
    factor, position = shown.position
    scale, unit = shown.error(without)
    return (
        f"the residual repeats every {factor * period:.6g} {position}: with --period {period:g} the hybrid's error "
        f"would go from {shown_figure(scale * without)} to {shown_figure(scale * with_it)} {unit}, by replays of the "
        "training half"
    )
