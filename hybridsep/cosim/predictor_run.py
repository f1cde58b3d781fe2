"""Co-simulate a predictor FMU with a plant FMU through fmpy.

The drive gets ``x_d(k) = r(k − Np)``, so the trajectory is held at its end for ``Np`` samples more, and results are
reported without the first fill; :mod:`hybridsep._wiring` has the loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.signals import Array
from .wiring import Role, run_pair, save_columns

__all__ = ["COLUMNS", "PREDICTOR", "CoSimulation", "cosimulate"]

PREDICTOR = Role("predictor", ("x_d", "x_pb", "x_h"), state="hybrid_active", delay="Np")
COLUMNS = ("t", "x_d", "x", "x_meas", "x_pb", "x_hold", "x_h", "active")
"""What :meth:`CoSimulation.save` writes."""


@dataclass(frozen=True)
class CoSimulation:
    """What a co-simulation came to, sample by sample, without the first fill.

    Attributes
    ----------
    t : (n,) array, s
        Communication points.
    x_d, x, x_meas : (n,) array, m
        Commanded, true and measured position.
    x_pb, x_hold, x_h : (n,) array, m
        Physics-based prediction, hold baseline, hybrid prediction.
    active : (n,) array of bool
        Whether ``x_h`` is the hybrid prediction there.
    Np : int
        Samples in a batch.
    """

    t: Array
    x_d: Array
    x: Array
    x_meas: Array
    x_pb: Array
    x_hold: Array
    x_h: Array
    active: NDArray[np.bool_]
    Np: int

    def summary(self) -> dict[str, float | int]:
        """Return RMS errors in µm over the whole trajectory, against the measured position unless named true."""

        def rms(error: Array) -> float:
            return 1e6 * float(np.sqrt(np.mean(error**2)))

        rms_pb, rms_h = rms(self.x_meas - self.x_pb), rms(self.x_meas - self.x_h)
        return {
            "rms_pb_um": rms_pb,
            "rms_hold_um": rms(self.x_meas - self.x_hold),
            "rms_h_um": rms_h,
            "reduction_percent": 100.0 * (1.0 - rms_h / rms_pb) if rms_pb else 0.0,
            "rms_pb_true_um": rms(self.x - self.x_pb),
            "rms_h_true_um": rms(self.x - self.x_h),
            "servo_error_rms_um": rms(self.x_d - self.x),
            "max_h_um": 1e6 * float(np.max(np.abs(self.x_meas - self.x_h))),
            "n_samples": len(self.t),
        }

    def batch_rms(self) -> dict[str, Array]:
        """Return the RMS errors batch by batch, m, ``(n_batches,)`` each, of ``x_pb``, ``x_hold`` and ``x_h``."""
        starts = np.arange(0, len(self.t), self.Np)
        lengths = np.diff(np.append(starts, len(self.t)))
        errors = {name: self.x_meas - getattr(self, name) for name in ("x_pb", "x_hold", "x_h")}
        return {name: np.sqrt(np.add.reduceat(error**2, starts) / lengths) for name, error in errors.items()}

    def save(self, path: str | Path) -> None:
        """Write all signals to ``path``: ``.csv`` with one row a sample, or ``.npz``.

        Raises
        ------
        ValueError
            If the suffix is another one.
        """
        save_columns({name: getattr(self, name) for name in COLUMNS}, path)


def cosimulate(
    predictor: str | Path,
    plant: str | Path,
    r: ArrayLike,
    *,
    predictor_values: Mapping[str, Any] | None = None,
    plant_values: Mapping[str, Any] | None = None,
    start_time: float = 0.0,
    progress: Callable[[int, int], object] | None = None,
) -> CoSimulation:
    """Run a predictor FMU and a plant FMU together over a trajectory.

    Parameters
    ----------
    predictor, plant : str or Path
        The archives.
    r : (n,) array_like, m
        Commanded positions at ``k·T_s``.
    predictor_values, plant_values : mapping, optional
        Parameters to set before the initialization, for example ``{"seed": 3}``.
    start_time : float
        Start of the experiment, s.
    progress : callable, optional
        Called with ``(k, n)`` about a hundred times.

    Returns
    -------
    CoSimulation

    Raises
    ------
    FmuError
        If an FMU refuses to load, to initialise or to step; its message is part of the error.
    SignalError
        If ``r`` is empty or not finite.
    """
    record = run_pair(
        PREDICTOR,
        predictor,
        plant,
        r,
        look_ahead_values=predictor_values,
        plant_values=plant_values,
        start_time=start_time,
        progress=progress,
    )
    found, active = record.signals, record.state.astype(np.bool_)
    x_hold = _hold(found["x_pb"], found["x_meas"], active, record.Np)
    return CoSimulation(t=record.t, **found, x_hold=x_hold, active=active, Np=record.Np)


def _hold(x_pb: Array, x: Array, active: NDArray[np.bool_], Np: int) -> Array:
    """Return the hold baseline: the last residual before each batch, held over it, after the warm-up."""
    last = np.arange(len(x)) // Np * Np - 1
    residual = np.where(last >= 0, (x - x_pb)[last], 0.0)
    return np.where(active, x_pb + residual, x_pb)
