"""A drive and its compensator in closed loop, sample by sample, and how far a path is missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..base.signals import Array, as_samples
from ..base.threads import one_blas_thread
from ..compensate.compensator import SepCompensator
from ..plants.encoder import Encoder
from ..plants.plant import Plant
from ..predict.look_ahead import LookAhead

__all__ = ["ClosedLoop", "contour_error", "run_closed_loop"]

_NODES = 20_000
"""Points of a path among which the nearest one is looked up before it is refined."""


@dataclass(frozen=True)
class ClosedLoop:
    """Signals of one run, without the fill of the look-ahead; all ``(n,)``, m.

    Attributes
    ----------
    x_d, x_dm : arrays
        Commanded position and what the drive got in its place.
    x, x_meas : arrays
        True and measured position.
    x_pb, x_h : arrays
        Predictions under ``x_dm``.
    state : array of int
        :class:`~hybridsep.compensator.SepState` of each sample.
    """

    x_d: Array
    x_dm: Array
    x: Array
    x_meas: Array
    x_pb: Array
    x_h: Array
    state: NDArray[np.int64]

    @property
    def rms(self) -> float:
        """RMS of the servo error ``x_d − x`` against the true position, m."""
        return float(np.sqrt(np.mean((self.x_d - self.x) ** 2)))


@one_blas_thread
def run_closed_loop(
    compensator: SepCompensator,
    plant: Plant,
    r: ArrayLike,
    *,
    encoder: Encoder | None = None,
    t_init: float | None = None,
    disturb: Callable[[int, Plant], object] | None = None,
    sensor: Callable[[int, float], float] | None = None,
) -> ClosedLoop:
    """Run a drive behind a compensator over a trajectory, with the FMU's timing.

    Parameters
    ----------
    compensator : SepCompensator
        Begins a new run, with what it has learned kept.
    plant : Plant
        Reset to rest at ``r(0)``.
    r : (n,) array_like, m
        Commanded positions.
    encoder : Encoder, optional
        Position sensor; without noise if left out.
    t_init : float, optional
        Warm-up, s; the predictor's own if left out, 0 for a warm start.
    disturb : callable, optional
        Called as ``disturb(k, plant)`` before sample ``k`` of the trajectory; may change the plant.
    sensor : callable, optional
        Called as ``sensor(k, x_meas)``; returns what arrives in its place.

    Returns
    -------
    ClosedLoop
    """
    command = as_samples(r, "r")
    encoder = Encoder() if encoder is None else encoder
    look_ahead = LookAhead(compensator, float(command[0]), t_init=t_init)
    preview, n = look_ahead.delay, len(command)
    T_s = compensator.predictor.T_s
    plant.reset(float(command[0]))
    signals = np.empty((n + preview, 6))
    state = np.empty(n + preview, dtype=np.int64)
    for k in range(n + preview):
        if disturb is not None:
            disturb(k - preview, plant)
        x = plant.x
        x_meas = encoder.measure(x)
        if sensor is not None:
            x_meas = sensor(k - preview, x_meas)
        x_dm = look_ahead.x_dm
        signals[k] = look_ahead.x_d, x_dm, x, x_meas, look_ahead.x_pb, look_ahead.x_h
        state[k] = look_ahead.sep_state
        plant.step(x_dm, T_s)
        look_ahead.sample(float(command[min(k, n - 1)]), x_meas)
    x_d, x_dm, x, x_meas, x_pb, x_h = signals[preview:].T.copy()
    return ClosedLoop(x_d, x_dm, x, x_meas, x_pb, x_h, state[preview:])


def contour_error(
    points: ArrayLike, position: Callable[[Array], Array], derivative: Callable[[Array], Array], end: float
) -> Array:
    """Return the distance of each point to a planar path.

    Parameters
    ----------
    points : (n, 2) array_like, m
        Positions reached.
    position, derivative : callable, (n,) → (n, 2)
        The path and its derivative over a parameter from 0 to ``end``, as :func:`~hybridsep.trajectory.along_path`
        takes them.
    end : float
        Last value of the parameter.

    Returns
    -------
    (n,) array, m
    """
    reached = np.asarray(points, dtype=np.float64)
    nodes = np.linspace(0.0, end, _NODES)
    _, nearest = cKDTree(position(nodes)).query(reached)
    u = nodes[nearest]
    for _ in range(5):
        # Gauss-Newton: the point's distance is least where it is perpendicular to the path
        slope = derivative(u)
        along = np.sum((reached - position(u)) * slope, axis=1) / np.sum(slope**2, axis=1)
        u = np.clip(u + along, 0.0, end)
    return np.asarray(np.linalg.norm(reached - position(u), axis=1))
