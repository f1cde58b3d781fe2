"""A co-simulation's command, FMUs and their parameters, checked before any work."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..base.data_files import COMMANDS
from ..base.errors import ParameterError
from ..base.signals import Array
from ..fmi.archive import fmu_names
from ..fmi.libraries import check_available
from ..logs.log import check_reading
from ..machines.agree import check_interval
from ..machines.machine import Machine
from ..plants.trajectory import PAPER_LIMITS, read_trajectory, spiral, staircase
from .fmus import check_controller, check_plant
from .run import COMPENSATOR, PREDICTOR

__all__ = ["check_pair", "check_predictor", "default_trajectory", "read_command", "values_to_build"]

_WEIGHTS = "--weights go into an FMU that is built here; leave out --predictor"


def default_trajectory(machine: str | Path) -> str:
    """Return what is played where nothing is given: a fit's commands beside the machine file, else the staircase."""
    path = Path(machine)
    commands = path.with_name(COMMANDS)
    return str(commands) if path.suffix == ".toml" and commands.is_file() else "staircase"


def read_command(trajectory: str, axis: Machine, unit: str | None, T_s: float | None) -> Array:
    """Return the samples of a named trajectory or of a file, at the machine's sampling interval."""
    check_reading(unit, T_s)
    limits = PAPER_LIMITS if axis.limits is None else axis.trajectory_limits()
    if trajectory == "staircase":
        return staircase(axis.T_s, limits=limits)
    if trajectory in ("spiral_x", "spiral_y"):
        return spiral(axis.T_s, limits=limits)[trajectory == "spiral_y"]
    command, found = read_trajectory(trajectory, unit=unit, T_s=T_s)
    check_interval(trajectory, found, axis)
    return command


def values_to_build(axis: Machine, model: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Check the FMI values of a look-ahead FMU that will be built; return them with what must change with them."""
    if model == "HybridPredictor":
        axis.changed("predictor", values)
        return dict(values)
    settings = axis.changed("compensator", values).compensator_settings
    windows = {"preview": settings.preview, "spacing": settings.spacing} if "Np" in values else {}
    return {**values, **windows}


def check_predictor(axis: Machine, predictor: Path | None, weights: Path | None) -> None:
    """Check the predictor FMU that is given; where none is, check that the native one can be built.

    Raises
    ------
    FmuError
        If the given one is no predictor, or there is neither a library nor a compiler for this platform.
    ParameterError
        If weights are given for an FMU that is.
    """
    if predictor is None:
        check_available(("host",))
    else:
        if weights is not None:
            raise ParameterError(_WEIGHTS)
        check_controller(predictor, PREDICTOR)


def check_pair(
    axis: Machine,
    model: str,
    predictor: Path | None,
    plant: Path | None,
    weights: Path | None,
    flavour: str,
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
    flavour : {"native", "python"}
    """
    models = fmu_names(axis, flavour).values()
    if plant is None and "FeedDrive" not in models:
        raise ParameterError(
            f"machine {axis.name} has no plant: `hybridsep fit` writes one from a log of the axis; or name a plant "
            "FMU with --plant"
        )
    if predictor is None and model not in models:
        raise ParameterError(
            f"machine {axis.name} has no [drive_limits], which a compensator must keep; add them, or name a "
            "compensator FMU with --predictor"
        )
    if predictor is not None and weights is not None:
        raise ParameterError(_WEIGHTS)
    if predictor is not None:
        check_controller(predictor, PREDICTOR if model == "HybridPredictor" else COMPENSATOR)
    if plant is not None:
        check_plant(plant)
    if flavour == "native" and None in (predictor, plant):
        check_available(("host",))
