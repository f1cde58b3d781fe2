"""Drives whose residual is known, and predictors with averaging for them."""

from dataclasses import replace
from typing import Any

import numpy as np
from predictor_cases import MODEL

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.predict.averaging.model import AveragedModel
from hybridsep.predict.predictor import HybridPredictor

TS = 1e-3  # s
PERIOD = 1000  # samples of a cycle
FRICTION = 2e-5  # offset of the command, m, that friction is worth


def averaged(**changes: Any) -> HybridPredictor:
    """Return a predictor with averaging of the default drive."""
    return HybridPredictor(MODEL, PredictorSettings(averaging=True, **changes))


def averaged_model(predictor: HybridPredictor) -> AveragedModel:
    """Return the residual model of a predictor with averaging."""
    assert isinstance(predictor.residual, AveragedModel)
    return predictor.residual


def change_learned(predictor: HybridPredictor, **changes: Any) -> None:
    """Change numbers that a predictor with averaging has learned."""
    model = averaged_model(predictor)
    residual = replace(model, learned=replace(model.learned, **changes))
    predictor.state = replace(predictor.state, residual=residual)


def cycles(n: int) -> Array:
    """Return a command to and fro, (n,), m, fastest at the beginning."""
    return np.asarray(5e-3 * np.sin(2 * np.pi * np.arange(n) / PERIOD))


def physics(x_d: Array) -> Array:
    """Return x_pb from rest at the first command, (n,), m."""
    discrete = MODEL.discretise(TS)
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


def friction(x_d: Array, size: float = FRICTION) -> Array:
    """Return the residual of friction that follows the command's sign: the model's response to it, (n,), m."""
    discrete = MODEL.discretise(TS)
    v_d = np.diff(x_d, prepend=x_d[0]) / TS
    return np.asarray(-size * discrete.forced_response(discrete.rest(), np.tanh(v_d / (0.03 * np.abs(v_d).max())))[0])


def run(predictor: HybridPredictor, x_d: Array, x: Array, n: int = 100, measured: int | None = None) -> Array:
    """Predict windows of ``n`` samples and measure their first ``measured``, all if left out; return x_h of those."""
    found, k = [], 0
    while k < len(x_d):
        window = slice(k, min(k + (measured or n), len(x_d)))
        found.append(predictor.predict(x_d[k : k + n]).x_h[: window.stop - k])
        predictor.update(x[window])
        k = window.stop
    return np.concatenate(found)
