"""Replay by the C core, as an FMU's binary does it, compiled for this machine."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))

from c_core import TABLES, CModel, RefusedError

from benchmarks.random_drives.replay import PREDICTORS
from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

__all__ = ["core_outputs", "core_replay"]


def core_replay(predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array) -> Array:
    """Return ``x_h`` of the C core's predictor, ``(n,)``, m; with trust ``x_meas`` is NaN where missing."""
    outputs = core_outputs(predictor, model, settings, x_d, x_meas, ("x_h",))
    return np.asarray(outputs[0])


def core_outputs(
    predictor: str, model: ModalModel, settings: PredictorSettings, x_d: Array, x_meas: Array, names: Sequence[str]
) -> Array:
    """Return outputs of the C core's predictor, ``(len(names), n)``, m.

    A last window that is cut off is predicted as part of a whole one, beyond whose end the command rests; the library
    predicts it alone.
    """
    used = PREDICTORS[predictor](settings)
    Np, n, modes = used.Np, len(x_d), model.modes
    name = f"predictor of {len(modes)} modes"
    any_modes = TABLES["predictor"].modes * len(modes)
    TABLES.setdefault(name, replace(TABLES["predictor"], name=name, modes=any_modes))
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
