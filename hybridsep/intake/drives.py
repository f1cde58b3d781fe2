"""Search for a drive that explains a motion: one mode of any bandwidth, with dead time, from any state."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from ..base.signals import Array
from .relation import DeadTime, poles_of, shifted

__all__ = ["DRIVE_GAINS", "NO_BETTER", "drive_explaining"]

DRIVE_GAINS = (0.15, 1.05)
"""Static gains that a position loop may have: a small servo under load was recorded at 0.25, none reaches more than
its command."""

NO_BETTER = 4.0
"""Largest variance that a fault may leave unexplained, relative to the variance that a drive leaves: else the drive
explains the motion as well."""

_OMEGA, _ZETA, _DEAD_TIME = np.geomspace(4e-3, 1.5, 12), (0.1, 0.4, 1.0, 4.0), (0.0, 4.0)
"""Natural frequencies, rad a sample, damping ratios and dead times, samples, that the search begins with."""

_DEAD_TIME_MAX = 8.0
"""Largest dead time, samples: with a longer one any phase of a sine is a drive's."""

_SEARCHES, _EVALUATIONS = 3, 60
"""Best initial values from which the search goes on, and evaluations from each."""


def drive_explaining(x_d: Array, x: Array, gains: tuple[float, float] = DRIVE_GAINS) -> DeadTime:
    """Return the mode with dead time that leaves least of a motion, its static gain within bounds.

    Above its bandwidth a drive turns its motion round, shrinks it and integrates the command: what looks like a flipped
    sign, another unit or a velocity may be a drive that is driven so. The state in which it begins is free.

    Parameters
    ----------
    x_d, x : (n,) array
        Commanded and measured positions.
    gains : pair of float
        Least and largest static gain.
    """
    start = float(x_d[0])
    command, response = x_d - start, x - x.mean()
    total = float(response @ response)
    if total == 0.0 or not command.any():
        return DeadTime(0.0, 0.0, 1.0, 0.0)

    def left(parameters: Array) -> tuple[float, float]:
        omega, zeta = math.exp(parameters[0]), math.exp(parameters[1])
        poles = poles_of(omega, zeta)
        late = shifted(command, float(parameters[2])) if parameters[2] > 0.0 else command
        y = lfilter([0.0, sum(poles)], poles, late)
        impulse = np.zeros(len(y))
        impulse[0] = 1.0
        free = lfilter([1.0], poles, impulse)  # response to an initial state; and one sample later
        others = np.stack((np.ones(len(y)), free, np.concatenate(([0.0], free[:-1]))), axis=1)
        basis, sizes = np.linalg.qr(others)
        basis = basis[:, np.abs(np.diag(sizes)) > 1e-9 * np.abs(sizes).max()]
        y, own = y - basis @ (basis.T @ y), response - basis @ (basis.T @ response)
        squares = float(y @ y)
        gain = min(max(float(y @ own) / squares, gains[0]), gains[1]) if squares > 0.0 else gains[0]
        rest = own - gain * y
        share = float(rest @ rest) / total
        return (share if math.isfinite(share) else math.inf), gain

    grid = [
        np.array([math.log(omega), math.log(zeta), dead_time])
        for omega, zeta, dead_time in product(_OMEGA, _ZETA, _DEAD_TIME)
    ]
    best = sorted(grid, key=lambda parameters: left(parameters)[0])[:_SEARCHES]
    bounds = [(-6.5, 1.0), (-4.0, 4.0), (0.0, _DEAD_TIME_MAX)]
    found = [
        minimize(
            lambda parameters: math.log(max(left(parameters)[0], 1e-16)),
            *(first,),
            method="Nelder-Mead",
            bounds=bounds,
            options={"maxfev": _EVALUATIONS, "initial_simplex": _simplex(first, bounds)},
        ).x
        for first in best
    ]
    end = min([*best, *found], key=lambda parameters: left(parameters)[0])
    share, gain = left(end)
    return DeadTime(float(end[2]), 2 * math.exp(end[1] - end[0]), share, gain)


def _simplex(first: Array, bounds: list[tuple[float, float]]) -> Array:
    corners = np.tile(first, (4, 1))
    corners[1:] += np.diag([0.25, 0.4, 2.0])
    return np.asarray(np.clip(corners, *np.transpose(bounds)))
