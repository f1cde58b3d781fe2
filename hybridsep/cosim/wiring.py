"""The loop of a look-ahead FMU and a plant FMU through fmpy: how they are wired, stepped and recorded.

The Jacobi wiring: at ``t_k`` the plant gets the command that the look-ahead gives it, the look-ahead gets
``plant.x_meas`` and ``x_d_ahead = r(k)``; then both step. The look-ahead delays the trajectory, so ``r`` is held at its
end for as many samples more, and the record begins after the first fill.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import FmuError
from ..base.interrupt import interrupts_between_calls
from ..base.output import written_text, written_whole
from ..base.signals import Array, as_samples
from ..base.threads import one_blas_thread
from .importer import FmuInstance, read_description

__all__ = ["RESULT_SUFFIXES", "Record", "Role", "check_look_ahead", "check_plant", "run_pair", "save_columns"]

RESULT_SUFFIXES = (".csv", ".npz")
"""Endings of files that :func:`save_columns` can write."""


@dataclass(frozen=True)
class Role:
    """What a look-ahead FMU is to the loop.

    Attributes
    ----------
    name : str
        As error messages call it.
    outputs : tuple of str
        Reals to record, m; the first one goes to the drive.
    state : str
        An Integer or Boolean output to record.
    delay : str
        The parameter that says by how many samples the trajectory is delayed.
    """

    name: str
    outputs: tuple[str, ...]
    state: str
    delay: str


@dataclass(frozen=True)
class Record:
    """What happened from the end of the first fill on.

    Attributes
    ----------
    t : (n,) array, s
        Communication points.
    signals : dict of (n,) arrays, m
        The outputs of the role, and the plant's ``x`` and ``x_meas`` as the look-ahead got it.
    state : (n,) array of int
        The role's state.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples in a batch.
    """

    t: Array
    signals: dict[str, Array]
    state: NDArray[np.int64]
    T_s: float
    Np: int


@one_blas_thread
def run_pair(
    role: Role,
    look_ahead: str | Path,
    plant: str | Path,
    r: ArrayLike,
    *,
    look_ahead_values: Mapping[str, Any] | None = None,
    plant_values: Mapping[str, Any] | None = None,
    start_time: float = 0.0,
    sensor: Callable[[int, float], float] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Record:
    """Run a look-ahead FMU and a plant FMU together over a trajectory.

    Parameters
    ----------
    role : Role
        What the look-ahead is.
    look_ahead, plant : str or Path
        The archives.
    r : (n,) array_like, m
        Commanded positions at ``k·T_s``.
    look_ahead_values, plant_values : mapping, optional
        Parameters to set before the initialization.
    start_time : float
        Start of the experiment, s.
    sensor : callable, optional
        Called as ``sensor(k, x_meas)``, ``k`` counted from the end of the fill; returns what arrives in its place.
    progress : callable, optional
        Called with ``(k, n)`` about a hundred times.

    Raises
    ------
    FmuError
        If an FMU refuses to load, to initialise or to step, or does not fit; its message is part of the error.
    SignalError
        If ``r`` is empty or not finite.
    """
    command = as_samples(r, "r")
    as_samples(command[:1], "r", 1)
    check_look_ahead(look_ahead, role)
    check_plant(plant)
    with (
        interrupts_between_calls(),
        FmuInstance(look_ahead, role.name) as ahead_fmu,
        FmuInstance(plant, "plant") as plant_fmu,
    ):
        start = float(command[0])
        ahead_fmu.initialise({**(look_ahead_values or {}), "x_d_ahead": start, "x_meas": start}, start_time=start_time)
        plant_fmu.initialise({**(plant_values or {}), "x_d": start}, start_time=start_time)
        delay, Np, h = int(ahead_fmu.get(role.delay)), int(ahead_fmu.get("Np")), float(ahead_fmu.get("T_s"))
        if "T_s" in plant_fmu.variables and abs(float(plant_fmu.get("T_s")) - h) > 1e-6 * h:
            raise FmuError(
                f"{plant_fmu.path.name} has T_s = {plant_fmu.get('T_s'):g} s, but {ahead_fmu.path.name} has "
                f"{h:g} s; they must agree"
            )
        n = len(command) + delay
        every = max(1, n // 100)
        get_ahead, get_plant = ahead_fmu.real_reader(role.outputs), plant_fmu.real_reader(["x", "x_meas"])
        set_ahead, set_plant = ahead_fmu.real_writer(["x_d_ahead", "x_meas"]), plant_fmu.real_writer(["x_d"])
        signals = np.empty((n, len(role.outputs) + 2))
        state = np.empty(n, dtype=np.int64)
        for k in range(n):
            t = start_time + k * h
            outputs = get_ahead()
            x, x_meas = get_plant()
            if sensor is not None:
                x_meas = sensor(k - delay, x_meas)
            signals[k] = *outputs, x, x_meas
            state[k] = ahead_fmu.get(role.state)
            set_plant(outputs[:1])
            set_ahead([float(command[min(k, len(command) - 1)]), x_meas])
            plant_fmu.step(t, h)
            ahead_fmu.step(t, h)
            if progress is not None and (k % every == 0 or k == n - 1):
                progress(k + 1, n)
    return Record(
        t=np.asarray(start_time + np.arange(delay, n) * h, dtype=np.float64),
        signals=dict(zip((*role.outputs, "x", "x_meas"), signals[delay:].T.copy(), strict=True)),
        state=state[delay:],
        T_s=h,
        Np=Np,
    )


def save_columns(columns: Mapping[str, Any], path: str | Path) -> None:
    """Write arrays of one length to ``path``: ``.csv`` with one row a sample, or ``.npz``.

    Parameters
    ----------
    columns : mapping
        Name → ``(n,)`` array; truth values become 0 and 1 in a CSV.
    path : str or Path

    Raises
    ------
    ValueError
        If the suffix is another one.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".npz":
        with written_whole(path) as archive:
            np.savez_compressed(archive, **columns)
    elif suffix == ".csv":
        texts = [
            map(repr, (column.astype(np.int64) if column.dtype == np.bool_ else column).tolist())
            for column in columns.values()
        ]
        with written_text(path) as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*texts, strict=True))
    else:
        raise ValueError(f"results are written as {' or '.join(RESULT_SUFFIXES)}, got {path.name!r}")


def check_look_ahead(path: str | Path, role: Role) -> None:
    """Raise FmuError if an archive is no FMU, or lacks what the role needs."""
    _check_role(path, role.name, ("x_d_ahead", "x_meas"), (*role.outputs, role.state))


def check_plant(path: str | Path) -> None:
    """Raise FmuError if an archive is no FMU, or lacks what a plant has."""
    _check_role(path, "plant", ("x_d",), ("x", "x_meas"))


def _check_role(path: str | Path, role: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    causalities = {variable.name: variable.causality for variable in read_description(path).modelVariables}
    for causality, names in (("input", inputs), ("output", outputs)):
        for name in names:
            if causalities.get(name) != causality:
                raise FmuError(f"{Path(path).name} is no {role}: it has no {causality} {name}")
