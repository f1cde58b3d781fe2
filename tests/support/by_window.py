"""The library's predictor and compensator given whole windows, as truth for what is computed sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from library_models import library_compensator
from library_stream import start_values
from numpy.typing import NDArray
from stream import COMPENSATOR, Array, Value, machine_of

from hybridsep import backtest


def predictions(x_d: Array, x: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return ``x_pb``, ``x_h`` and whether ``x_h`` is the hybrid one, of a log, by the default machine's predictor."""
    result = backtest(machine_of("HybridPredictor").new_predictor(), x_d, x)
    return result.x_pb, result.x_h, result.active


def plans(values: Mapping[str, Value], r: Array, x: Array) -> dict[str, Array]:
    """Return what plans made window by window of the commands ``r`` and the measured positions ``x`` come to."""
    given: dict[str, Any] = {**start_values(COMPENSATOR), **values}
    compensator, preview, Np = library_compensator(given), given["preview"], given["Np"]
    compensator.restart(float(r[0]), t_init=given["t_init"], lead_in=preview)
    x_d = np.concatenate((np.full(preview, r[0]), r))
    columns: dict[str, list[Array]] = {name: [] for name in ("x_dm", "x_d", "x_pb", "x_h", "sep_state")}
    for k in range(0, len(r), Np):
        plan = compensator.plan(x_d[k : k + preview])
        state = np.where(np.arange(Np) < plan.n_followed, plan.state_before, plan.state).astype(np.float64)
        window = (plan.x_dm, x_d[k : k + Np], plan.x_pb, plan.x_h, state)
        for column, samples in zip(columns.values(), window, strict=True):
            column.append(samples)
        compensator.update(x[k : k + Np])
    return {name: np.concatenate(column) for name, column in columns.items()}
