"""Co-simulate a predictor FMU with a plant FMU through fmpy.

The Jacobi wiring: at ``t_k``, ``plant.x_d = predictor.x_d``, ``predictor.x_meas = plant.x_meas`` and
``predictor.x_d_ahead = r(k)``; then both step. The drive gets ``r(k − Np)``, so the trajectory is held at its end for
``Np`` samples more, and results are reported without the first fill.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FmuError
from .importer import FmuInstance
from .signals import Array, as_samples

__all__ = ["CoSimulation", "cosimulate"]

_SIGNALS = ("t", "x_d", "x", "x_meas", "x_pb", "x_hold", "x_h")


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
        path = Path(path)
        columns = {name: getattr(self, name) for name in (*_SIGNALS, "active")}
        suffix = path.suffix.lower()
        if suffix == ".npz":
            np.savez_compressed(path, **columns)
        elif suffix == ".csv":
            with path.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(columns)
                rows = zip(*(column.tolist() for column in columns.values()), strict=True)
                writer.writerows([*map(repr, numbers), int(active)] for *numbers, active in rows)
        else:
            raise ValueError(f"results are written as .csv or .npz, got {path.name!r}")


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
    command = as_samples(r, "r")
    as_samples(command[:1], "r", 1)
    with FmuInstance(predictor, "predictor") as predictor_fmu, FmuInstance(plant, "plant") as plant_fmu:
        _check_role(predictor_fmu, "predictor", ("x_d_ahead", "x_meas"), ("x_d", "x_pb", "x_h", "hybrid_active"))
        _check_role(plant_fmu, "plant", ("x_d",), ("x", "x_meas"))
        start = float(command[0])
        predictor_fmu.initialise(
            {**(predictor_values or {}), "x_d_ahead": start, "x_meas": start}, start_time=start_time
        )
        plant_fmu.initialise({**(plant_values or {}), "x_d": start}, start_time=start_time)
        Np, h = int(predictor_fmu.get("Np")), float(predictor_fmu.get("T_s"))
        if "T_s" in plant_fmu.variables and abs(float(plant_fmu.get("T_s")) - h) > 1e-6 * h:
            raise FmuError(
                f"{plant_fmu.path.name} has T_s = {plant_fmu.get('T_s'):g} s, but {predictor_fmu.path.name} has "
                f"{h:g} s; they must agree"
            )
        n = len(command) + Np
        every = max(1, n // 100)
        get_predictor, get_plant = (
            predictor_fmu.real_reader(["x_d", "x_pb", "x_h"]),
            plant_fmu.real_reader(["x", "x_meas"]),
        )
        set_predictor, set_plant = predictor_fmu.real_writer(["x_d_ahead", "x_meas"]), plant_fmu.real_writer(["x_d"])
        signals = np.empty((n, 5))
        active = np.zeros(n, dtype=np.bool_)
        for k in range(n):
            t = start_time + k * h
            x_d, x_pb, x_h = get_predictor()
            x, x_meas = get_plant()
            signals[k] = x_d, x_pb, x_h, x, x_meas
            active[k] = predictor_fmu.get("hybrid_active")
            set_plant([x_d])
            set_predictor([float(command[min(k, len(command) - 1)]), x_meas])
            plant_fmu.step(t, h)
            predictor_fmu.step(t, h)
            if progress is not None and (k % every == 0 or k == n - 1):
                progress(k + 1, n)
    x_d, x_pb, x_h, x, x_meas = signals[Np:].T.copy()
    active = active[Np:]
    return CoSimulation(
        t=np.asarray(start_time + np.arange(Np, n) * h, dtype=np.float64),
        x_d=x_d,
        x=x,
        x_meas=x_meas,
        x_pb=x_pb,
        x_hold=_hold(x_pb, x_meas, active, Np),
        x_h=x_h,
        active=active,
        Np=Np,
    )


def _check_role(fmu: FmuInstance, role: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    """Say what an FMU lacks to be a predictor or a plant."""
    for causality, names in (("input", inputs), ("output", outputs)):
        for name in names:
            if name not in fmu.variables or fmu.variables[name].causality != causality:
                raise FmuError(f"{fmu.path.name} is no {role}: it has no {causality} {name}")


def _hold(x_pb: Array, x: Array, active: NDArray[np.bool_], Np: int) -> Array:
    """Return the hold baseline: the last residual before each batch, held over it, after the warm-up."""
    last = np.arange(len(x)) // Np * Np - 1
    residual = np.where(last >= 0, (x - x_pb)[last], 0.0)
    return np.where(active, x_pb + residual, x_pb)
