"""Times of an FMU's steps, as an importer in Python sees them."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import numpy as np

from ..base.signals import Array
from ..cosim.fmus import FmuController

__all__ = ["SAMPLES_MAX", "step_times"]

SAMPLES_MAX = 5000
"""Samples that are timed, at most."""


def step_times(fmu: Path, x_d: Array, x: Array) -> dict[str, float]:
    """Return times of a predictor FMU's steps over the beginning of a log, s.

    Parameters
    ----------
    fmu : Path
        A HybridPredictor.
    x_d, x : (n,) array, m
        Commanded and measured positions.

    Returns
    -------
    dict
        ``median``, ``p99_9`` and ``largest``.
    """
    n = min(len(x_d), SAMPLES_MAX)
    taken = np.empty(n)
    controller = FmuController(fmu, {}, 0.0)
    with controller:
        controller.initialise(float(x_d[0]))
        for k in range(n):
            begin = perf_counter()
            controller.step(k, float(x_d[k]), float(x[max(k - controller.delay, 0)]))
            taken[k] = perf_counter() - begin
    return {"median": float(np.median(taken)), "p99_9": float(np.quantile(taken, 0.999)), "largest": float(taken.max())}
