"""Co-simulate a compensator FMU with a plant FMU through fmpy: the drive gets the modified command.

``x_d(k) = r(k − preview)``, so the trajectory is held at its end for ``preview`` samples more, and results are reported
without the first ``preview`` samples; :mod:`hybridsep._wiring` has the loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.signals import Array
from ..compensate.compensator import SepState
from .wiring import Role, run_pair, save_columns

__all__ = ["COLUMNS", "COMPENSATOR", "SepCoSimulation", "cosimulate_sep"]

COMPENSATOR = Role("compensator", ("x_dm", "x_d", "x_pb", "x_h"), state="sep_state", delay="preview")
COLUMNS = ("t", "x_d", "x_dm", "x", "x_meas", "x_pb", "x_h", "state")
"""What :meth:`SepCoSimulation.save` writes."""


@dataclass(frozen=True)
class SepCoSimulation:
    """What a compensated co-simulation came to, sample by sample, without the first fill.

    Attributes
    ----------
    t : (n,) array, s
        Communication points.
    x_d, x_dm : (n,) array, m
        Commanded position and what the drive got in its place.
    x, x_meas : (n,) array, m
        True and measured position.
    x_pb, x_h : (n,) array, m
        Physics-based prediction under ``x_dm``, and the one by the model that planned the window.
    state : (n,) array of int
        :class:`~hybridsep.compensator.SepState` of each sample: which model planned it.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples in a window.
    """

    t: Array
    x_d: Array
    x_dm: Array
    x: Array
    x_meas: Array
    x_pb: Array
    x_h: Array
    state: NDArray[np.int64]
    T_s: float
    Np: int

    @property
    def change(self) -> Array:
        """How the command was modified, ``x_dm − x_d``, ``(n,)``, m."""
        return np.asarray(self.x_dm - self.x_d, dtype=np.float64)

    @property
    def error(self) -> Array:
        """Tracking error ``x_d − x`` of the true position, ``(n,)``, m."""
        return np.asarray(self.x_d - self.x, dtype=np.float64)

    def summary(self) -> dict[str, float | int]:
        """Return what compensation came to over the whole trajectory.

        Returns
        -------
        dict
            RMS and largest magnitude in µm of the tracking error, against the true position and (``_measured_``) the
            measured one, and of the command's change; the largest velocity, acceleration and jerk of ``x_dm``, of its
            differences; the share of the samples that each model planned, 0 … 1.
        """
        figures: dict[str, float | int] = {}
        for name, signal in (
            ("tracking", self.error),
            ("tracking_measured", self.x_d - self.x_meas),
            ("change", self.change),
        ):
            figures[f"{name}_rms_um"] = 1e6 * float(np.sqrt(np.mean(signal**2)))
            figures[f"{name}_max_um"] = 1e6 * float(np.max(np.abs(signal)))
        for order, name in enumerate(("velocity_m_s", "acceleration_m_s2", "jerk_m_s3"), start=1):
            steps = np.abs(np.diff(self.x_dm, order))
            figures[f"peak_{name}"] = float(np.max(steps, initial=0.0)) / self.T_s**order
        for state in SepState:
            figures[f"share_{state.name.lower()}"] = float(np.mean(self.state == state))
        return {**figures, "n_samples": len(self.t)}

    def save(self, path: str | Path) -> None:
        """Write all signals to ``path``: ``.csv`` with one row a sample, or ``.npz``.

        Raises
        ------
        ValueError
            If the suffix is another one.
        """
        save_columns({name: getattr(self, name) for name in COLUMNS}, path)


def cosimulate_sep(
    compensator: str | Path,
    plant: str | Path,
    r: ArrayLike,
    *,
    compensator_values: Mapping[str, Any] | None = None,
    plant_values: Mapping[str, Any] | None = None,
    start_time: float = 0.0,
    sensor: Callable[[int, float], float] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> SepCoSimulation:
    """Run a compensator FMU and a plant FMU together over a trajectory.

    Parameters
    ----------
    compensator, plant : str or Path
        The archives.
    r : (n,) array_like, m
        Commanded positions at ``k·T_s``.
    compensator_values, plant_values : mapping, optional
        Parameters to set before the initialization, for example ``{"compensate": 1}`` and ``{"seed": 3}``.
    start_time : float
        Start of the experiment, s.
    sensor : callable, optional
        Called as ``sensor(k, x_meas)``, ``k`` counted from the end of the fill; returns what arrives in its place.
    progress : callable, optional
        Called with ``(k, n)`` about a hundred times.

    Returns
    -------
    SepCoSimulation

    Raises
    ------
    FmuError
        If an FMU refuses to load, to initialise or to step; its message is part of the error.
    SignalError
        If ``r`` is empty or not finite.
    """
    record = run_pair(
        COMPENSATOR,
        compensator,
        plant,
        r,
        look_ahead_values=compensator_values,
        plant_values=plant_values,
        start_time=start_time,
        sensor=sensor,
        progress=progress,
    )
    return SepCoSimulation(t=record.t, **record.signals, state=record.state, T_s=record.T_s, Np=record.Np)
