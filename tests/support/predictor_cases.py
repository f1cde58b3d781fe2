"""Predictors of the default drive, and signals for them."""

import math
from typing import Any

import numpy as np
import staircase_data as staircase

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode
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
