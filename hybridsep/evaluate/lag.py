"""First-order lag with dead time, fitted to the columns of a log by least squares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from ..base.signals import Array

__all__ = ["FirstOrderLag", "fitted_lag"]

DEAD_TIME_MAX = 20
"""Largest dead time, samples, that is tried."""

TIME_CONSTANTS = (0.05, 1e4)
"""Least and largest time constant that are tried, samples."""


@dataclass(frozen=True)
class FirstOrderLag:
    """Lag ``1/(τs + 1)`` behind a dead time, over a zero-order hold.

    Attributes
    ----------
    tau : float
        Time constant, samples.
    dead_time : int
        Whole samples.
    """

    tau: float
    dead_time: int

    def position(self, x_d: Array) -> Array:
        """Return the position under a command ``(n,)``, m, from rest at the first one."""
        u = x_d - x_d[0]
        pole = math.exp(-1.0 / self.tau)
        delayed = np.concatenate((np.zeros(self.dead_time), u))[: len(u)]
        return np.asarray(x_d[0] + lfilter([0.0, 1.0 - pole], [1.0, -pole], delayed))


def fitted_lag(recordings: Sequence[tuple[Array, Array]]) -> FirstOrderLag:
    """Return the lag that fits recordings best.

    Parameters
    ----------
    recordings : sequence of two (n,) arrays, m
        Commanded and measured positions, sampled alike; measured ones are NaN where missing.
    """
    known = [~np.isnan(x) for _, x in recordings]

    def misfit(log_tau: float, dead_time: int) -> float:
        lag = FirstOrderLag(math.exp(log_tau), dead_time)
        errors = [(x - lag.position(x_d))[at] for (x_d, x), at in zip(recordings, known, strict=True)]
        return float(sum(error @ error for error in errors))

    bounds = [math.log(samples) for samples in TIME_CONSTANTS]
    fits = [
        (minimize_scalar(misfit, bounds=bounds, args=(dead_time,), method="bounded"), dead_time)
        for dead_time in range(DEAD_TIME_MAX + 1)
    ]
    best, dead_time = min(fits, key=lambda fit: float(fit[0].fun))
    return FirstOrderLag(math.exp(best.x), dead_time)
