"""Replay of a predictor over a random drive."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace

import numpy as np
from c_core import TABLES, CModel, RefusedError
from stream import PREDICTOR, table_of_model

from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor
from random_drives.drive import Drive

Replayed = Callable[[str, ModalModel, PredictorSettings, Array, Array], Array]
"""Replay of a predictor of :data:`PREDICTORS`, with the physics model and the drive's settings, over commanded and
measured positions, (n,), m. It returns x_h, (n,), m, each window predicted before its measurement is known; SignalError
if it refuses a sample."""

PREDICTORS: dict[str, Callable[[PredictorSettings], PredictorSettings]] = {
    "default": lambda settings: settings,
    "paper": lambda settings: replace(settings, averaging=False),
}
"""Settings of a predictor, from the settings of a drive."""


def library_replay(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    """Return ``x_h`` of the library's predictor, ``(n,)``, m; with averaging ``x_meas`` is NaN where missing."""
    return backtest(HybridPredictor(model, PREDICTORS[predictor](settings)), x_d, x_meas).x_h


def physics_alone(drive: Drive) -> Array:
    """Return ``x_pb`` from rest, ``(n,)``, m."""
    discrete = drive.model.discretise(drive.settings.T_s)
    start = drive.x_d[0]
    return np.asarray(start + discrete.forced_response(discrete.rest(), drive.x_d - start)[0])


def core_replay(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    """Return ``x_h`` of the C core's predictor, ``(n,)``, m; with averaging ``x_meas`` is NaN where missing."""
    return np.asarray(core_outputs(predictor, model, settings, x_d, x_meas, ("x_h",))[0])


def core_outputs(
    predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array, names: Sequence[str]
) -> Array:
    """Return outputs of the C core's predictor, ``(len(names), n)``, m."""
    # A last window that is cut off is predicted as part of a whole one, beyond whose end the command rests; the library
    # predicts it alone
    used = PREDICTORS[predictor](settings)
    Np, n, modes = used.Np, len(x_d), model.modes
    name = f"predictor of {len(modes)} modes"
    one = table_of_model(PREDICTOR)
    TABLES.setdefault(name, replace(one, name=name, modes=one.modes * len(modes)))
    start = {f"mode[{i}].{key}": value for i, mode in enumerate(modes, 1) for key, value in asdict(mode).items()}
    start |= {**used.to_fmi(), "dead_time": model.dead_time, "x_d_ahead": x_d[0], "x_meas": x_d[0]}
    core = CModel(name, start).initialise()
    outputs: Array = np.empty((n, len(names)))
    x_d_ahead, measured = (core.place[key] for key in ("x_d_ahead", "x_meas"))
    shown = [core.place[name] for name in names]
    try:
        for k in range(n + Np - 1):
            core.values[x_d_ahead] = x_d[min(k, n - 1)]
            core.values[measured] = x_meas[k - Np] if k >= Np else x_d[0]
            core.step(k * used.T_s, used.T_s)
            if k + 1 >= Np:
                outputs[k + 1 - Np] = core.values[shown]
    except RefusedError as error:
        raise SignalError(str(error)) from error
    return np.asarray(outputs.T)
