"""Checks of the command line's arguments, all of them before any work, and what follows from the arguments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..base.errors import ParameterError
from ..base.signals import Array
from ..compensate.plan import SepState
from ..cosim.fmus import check_controller, check_plant
from ..cosim.run import COMPENSATOR, PREDICTOR
from ..fmi.archive import fmu_names
from ..fmi.compiler import compilers
from ..fmi.warm_start import load_trained
from ..logs.log import check_reading
from ..machine import Machine, load_machine, machine_names
from ..plants.trajectory import PAPER_LIMITS, from_file, spiral, staircase
from .options import COMPENSATIONS, TRAJECTORIES

__all__ = [
    "Job",
    "best_model",
    "check_ending",
    "check_interval",
    "check_pair",
    "extras_of",
    "fitting",
    "jobs_of",
    "read_command",
]

Job = tuple[Machine, str, str]
"""An FMU to build: its machine, name and model."""


def jobs_of(fmus: Sequence[str], machines: Sequence[str], backend: str, targets: Sequence[str]) -> list[Job]:
    """Return the FMUs to build, all of the machines' if none is named."""
    jobs = [
        (axis, name, model)
        for axis in map(load_machine, machines or machine_names())
        for name, model in fmu_names(axis, backend).items()
    ]
    if unknown := sorted(set(fmus) - {name for _, name, _ in jobs}):
        raise ParameterError(f"no FMU {', '.join(unknown)}; there are {', '.join(name for _, name, _ in jobs)}")
    if targets and backend != "native":
        raise ParameterError(f"--target is for native FMUs; with --backend {backend} leave it out")
    if backend == "native":
        compilers(targets or ("host",))
    return [job for job in jobs if not fmus or job[1] in fmus]


def extras_of(
    jobs: Sequence[Job], weights: Path | None, trajectory: Path | None, unit: str, Ts: float | None
) -> dict[str, dict[str, Any]]:
    """Return by model what one of the FMUs gets besides its machine: weights, samples of a trajectory."""
    extras: dict[str, dict[str, Any]] = {}
    check_reading(unit, Ts)
    if weights is not None:
        axis, model = _one_of(jobs, ("HybridPredictor", "SepCompensator"), "--weights")
        load_trained(weights, axis, model)
        extras[model] = {"weights": weights}
    if trajectory is not None:
        axis, model = _one_of(jobs, ("ReferenceTrajectory",), "--trajectory")
        samples, found = from_file(trajectory, unit=unit, Ts=Ts)
        check_interval(trajectory.name, found, axis)
        extras[model] = {"samples": samples}
    return extras


def read_command(trajectory: str, axis: Machine, unit: str, Ts: float | None) -> Array:
    """Return the samples of a named trajectory or of a file, at the machine's sampling interval."""
    check_reading(unit, Ts)
    limits = PAPER_LIMITS if axis.limits is None else axis.trajectory_limits()
    if trajectory == "staircase":
        return staircase(axis.T_s, limits=limits)
    if trajectory in TRAJECTORIES:
        return spiral(axis.T_s, limits=limits)[trajectory == "spiral_y"]
    command, found = from_file(trajectory, unit=unit, Ts=Ts)
    check_interval(trajectory, found, axis)
    return command


def best_model(compensate: str) -> SepState:
    """Return the best model to compensate with, as ``--compensate`` names it."""
    if compensate not in COMPENSATIONS:
        raise ParameterError(f"--compensate must be one of {', '.join(COMPENSATIONS)}, got {compensate!r}")
    return SepState(COMPENSATIONS.index(compensate))


def fitting(axis: Machine, model: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Check the FMI values of a look-ahead FMU that will be built; return them with what must change with them."""
    changes = {"lam" if name == "lambda" else name: value for name, value in values.items()}
    if model == "HybridPredictor":
        axis.new_predictor(**changes)
        return dict(values)
    compensator = axis.new_compensator(**changes)
    windows = {"preview": compensator.preview, "spacing": compensator.spacing} if "Np" in values else {}
    return {**values, **windows}


def check_pair(
    axis: Machine,
    model: str,
    predictor: Path | None,
    plant: Path | None,
    weights: Path | None,
    backend: str,
) -> None:
    """Check a co-simulation's two FMUs: those that are given, and that the others can be built.

    Parameters
    ----------
    axis : Machine
    model : {"HybridPredictor", "SepCompensator"}
        The look-ahead.
    predictor, plant : Path, optional
        Archives; built if left out.
    weights : Path, optional
        For a look-ahead that is built.
    backend : {"native", "python"}
    """
    models = fmu_names(axis, backend).values()
    if plant is None and "FeedDrive" not in models:
        raise ParameterError(f"machine {axis.name} has no plant; name a plant FMU with --plant")
    if predictor is None and model not in models:
        raise ParameterError(
            f"machine {axis.name} has no [drive_limits], which a compensator must keep; add them, or name a "
            "compensator FMU with --predictor"
        )
    if predictor is not None and weights is not None:
        raise ParameterError("--weights go into an FMU that is built here; leave out --predictor")
    if predictor is not None:
        check_controller(predictor, PREDICTOR if model == "HybridPredictor" else COMPENSATOR)
    if plant is not None:
        check_plant(plant)
    if weights is not None:
        load_trained(weights, axis, model)
    if backend == "native" and None in (predictor, plant):
        compilers(("host",))


def check_interval(name: str, Ts: float, axis: Machine) -> None:
    """Say that a file is sampled at another interval than the machine, if it is."""
    if abs(Ts - axis.T_s) <= 0.01 * axis.T_s:
        return
    hint = "resample the file or correct T_s"
    for factor, unit in ((1e3, "ms"), (1e6, "µs")):
        if abs(Ts / axis.T_s / factor - 1) < 0.01:
            hint = f"is its time in {unit}? It must be in seconds"
    raise ParameterError(f"{name} is sampled every {Ts:g} s, but machine {axis.name} has T_s = {axis.T_s:g} s; {hint}")


def check_ending(path: Path | None, option: str, endings: Sequence[str]) -> None:
    """Say that a file has another ending than those that can be written, if it is given."""
    if path is not None and path.suffix.lower() not in endings:
        raise ParameterError(f"{option} must end in {' or '.join(endings)}, got {path.name!r}")


def _one_of(jobs: Sequence[Job], models: Sequence[str], option: str) -> tuple[Machine, str]:
    """Return machine and model of the only FMU of these models that is built, which an option is meant for."""
    found = [job for job in jobs if job[2] in models]
    if len(found) != 1:
        names = ", ".join(name for _, name, _ in found) or "none"
        raise ParameterError(
            f"{option} is for one {' or '.join(models)}, this would build {names}; name one, or its --machine"
        )
    return found[0][0], found[0][2]
