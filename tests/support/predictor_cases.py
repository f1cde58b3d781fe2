"""Predictors of the default drive, and signals for them; with averaging, drives whose residual is known."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import staircase_data as staircase

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.averaging.model import AveragedModel
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.window import Prediction

MODEL = ModalModel.spring_mass_damper(staircase.M, staircase.C, staircase.K)


def replay(predictor: HybridPredictor, x_d: Array, x: Array) -> tuple[Array, Array, Array]:
    """Predict then measure, window after window, the last one short; return x_pb, x_h and whether x_h is hybrid."""
    windows: list[Prediction] = []
    for first in range(0, len(x_d), predictor.Np):
        windows.append(predictor.predict(x_d[first : first + predictor.Np]))
        predictor.update(x[first : first + predictor.Np])
    return (
        np.array([position for window in windows for position in window.x_pb]),
        np.array([position for window in windows for position in window.x_h]),
        np.array([active for window in windows for active in window.active], dtype=bool),
    )


def small_signals(n: int, seed: int = 0, start: float = 0.0) -> tuple[Array, Array]:
    """Return a smooth command and a measurement off the model by a smooth residual and noise, (n,), m."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 1e-3
    x_d = start + 0.01 * (np.sin(40 * t) + 0.3 * np.cos(97 * t + seed) - 0.3 * math.cos(seed))
    x = x_d + 1e-4 * np.tanh(3 * np.cos(40 * t)) + 1e-5 * rng.normal(size=n)
    return np.asarray(x_d, dtype=np.float64), np.asarray(x, dtype=np.float64)


def trained(n: int, **changes: Any) -> HybridPredictor:
    """Return a small predictor in mid-run, after n samples."""
    settings_ = {"T_s": 1e-3, "Np": 10, "p": 4, "q": 2, "lam": 1e-9, "t_init": 0.0} | changes
    predictor = HybridPredictor(
        ModalModel([Mode(25.0, 0.05, 24674.0, 15.7)]), PredictorSettings(**{"averaging": False, **settings_})
    )
    x_d, x = small_signals(n)
    replay(predictor, x_d, x)
    return predictor


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
