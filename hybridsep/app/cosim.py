"""Commands of a controller and a drive together: ``cosim`` runs them, ``system`` writes them as one file."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..base.files import COMMANDS, DEFAULT_MACHINE
from ..base.settings import PARAMETERS, check
from ..fmi.flavours import FLAVOURS
from .options import (
    COMPENSATOR_ENTRIES,
    PREDICTOR_ENTRIES,
    TRAJECTORIES,
    FlavourOption,
    ForceOption,
    JsonOption,
    MachineOption,
    TargetOption,
    TrajectoryOption,
    TsOption,
    UnitOption,
    WeightsOption,
    parameter_help,
    takes_parameters,
)

if TYPE_CHECKING:
    from ..base.signals import Array
    from ..machines.machine import Machine

__all__ = ["cosim", "system"]


@takes_parameters(PREDICTOR_ENTRIES, COMPENSATOR_ENTRIES)
def cosim(
    machine: MachineOption = DEFAULT_MACHINE,
    trajectory: TrajectoryOption = None,
    unit: UnitOption = None,
    T_s: TsOption = None,
    compensate: Annotated[
        str | None,
        typer.Option(
            help=f"{PARAMETERS['compensate'].help}. The drive gets "
            "the command that a SepCompensator FMU has modified; if left out, a HybridPredictor only predicts."
        ),
    ] = None,
    predictor: Annotated[
        Path | None,
        typer.Option(help="Predictor FMU, or with --compensate a compensator FMU; built from the machine if left out."),
    ] = None,
    plant: Annotated[Path | None, typer.Option(help="Plant FMU; built from the machine if left out.")] = None,
    weights: WeightsOption = None,
    seed: Annotated[int | None, typer.Option(help=parameter_help(PARAMETERS["seed"]))] = None,
    *,
    parameters: dict[str, Any],
    flavour: FlavourOption = FLAVOURS[0],
    out: Annotated[Path | None, typer.Option(help="File for all signals, .csv or .npz.")] = None,
    figure: Annotated[
        Path | None,
        typer.Option(help="PNG with the errors over time: of the predictions, or with --compensate of the position."),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Co-simulate a predictor or compensator FMU with a plant FMU.

    Over the staircase, a spiral's axis or a trajectory in a file.
    """
    from ..compensate.expected import limits_that_bind
    from ..cosim.loop import cosimulate
    from ..fmi.archive import build_here
    from ..machines.machine import load_machine, machine_path
    from .console import RUNS, check_outputs, print_run, print_written, progress_bar

    if figure is not None:
        from ..evaluate.figures import prediction_figure, tracking_figure

    axis = load_machine(machine)
    trajectory = trajectory or _default_trajectory(machine)
    outputs = (("--out", out, RUNS), ("--figure", figure, (".png",)))
    if compensate is not None:
        check("compensate", compensate, label="--compensate")
    model = "HybridPredictor" if compensate is None else "SepCompensator"
    command = _read_command(trajectory, axis, unit, T_s)
    if compensate is None and (wrong := [f"--{name}" for name in parameters if name in COMPENSATOR_ENTRIES]):
        raise ParameterError(f"{', '.join(wrong)} must come with --compensate")
    values = dict(parameters)
    if predictor is None:
        values = _values_to_build(axis, model, values)
    if seed is not None:
        check("seed", seed)
    if compensate is not None:
        values["compensate"] = PARAMETERS["compensate"].to_fmi(compensate)
    _check_pair(axis, model, predictor, plant, weights, flavour)
    file = None if trajectory in TRAJECTORIES else trajectory
    inputs = {"trajectory": file, "predictor": predictor, "plant": plant, "saved predictor": weights}
    check_outputs(outputs, {"machine file": machine_path(machine), **inputs}, force=force)
    title = f"{' and '.join(path.name for path in (predictor, plant) if path is not None) or axis.title}, {trajectory}"
    with tempfile.TemporaryDirectory() as place, progress_bar(as_json) as advance:
        folder = Path(place)
        ahead = predictor or build_here(axis, model, folder, flavour, weights=weights)
        drive = plant or build_here(axis, "FeedDrive", folder, flavour)
        run = cosimulate(
            ahead,
            drive,
            command,
            controller_values=values,
            plant_values={} if seed is None else {"seed": seed},
            progress=lambda k, n: advance("co-simulation", k / n),
        )
    if out is not None:
        run.save(out)
    if figure is not None:
        if compensate is None:
            prediction_figure(run, title, figure)
        else:
            tracking_figure({compensate: run}, title, figure)
    limits = None
    if compensate is not None and predictor is None and axis.drive_limits is not None:
        limits = limits_that_bind(run.x_d, run.x_dm, run.T_s, axis.compensator_settings)
    print_run(run, as_json, title, limits)
    if not as_json:
        print_written(out, figure)


def _default_trajectory(machine: str | Path) -> str:
    """Return what is played where nothing is given: a fit's commands beside the machine file, else the staircase."""
    path = Path(machine)
    commands = path.with_name(COMMANDS)
    return str(commands) if path.suffix == ".toml" and commands.is_file() else "staircase"


def _read_command(trajectory: str, axis: Machine, unit: str | None, T_s: float | None) -> Array:
    """Return the samples of a named trajectory or of a file, at the machine's sampling interval."""
    from ..logs.log import check_reading
    from ..machines.machine import check_interval
    from ..plants.trajectory import PAPER_LIMITS, read_trajectory, spiral, staircase

    check_reading(unit, T_s)
    limits = PAPER_LIMITS if axis.limits is None else axis.trajectory_limits()
    if trajectory == "staircase":
        return staircase(axis.T_s, limits=limits)
    if trajectory in ("spiral_x", "spiral_y"):
        return spiral(axis.T_s, limits=limits)[trajectory == "spiral_y"]
    command, found = read_trajectory(trajectory, unit=unit, T_s=T_s)
    check_interval(trajectory, found, axis)
    return command


def _values_to_build(axis: Machine, model: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Check the FMI values of a look-ahead FMU that will be built; return them with what must change with them."""
    if model == "HybridPredictor":
        axis.changed("predictor", values)
        return dict(values)
    settings = axis.changed("compensator", values).compensator_settings
    windows = {"preview": settings.preview, "spacing": settings.spacing} if "Np" in values else {}
    return {**values, **windows}


def _check_pair(
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
    from ..cosim.adapters import check_controller, check_plant
    from ..cosim.run import COMPENSATOR, PREDICTOR
    from ..fmi.compile import check_available
    from ..fmi.spec import fmu_names

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
        raise ParameterError("--weights go into an FMU that is built here; leave out --predictor")
    if predictor is not None:
        check_controller(predictor, PREDICTOR if model == "HybridPredictor" else COMPENSATOR)
    if plant is not None:
        check_plant(plant)
    if flavour == "native" and None in (predictor, plant):
        check_available(("host",))


def system(
    machine: MachineOption = DEFAULT_MACHINE,
    compensate: Annotated[
        str | None,
        typer.Option(
            help=f"{PARAMETERS['compensate'].help}. A SepCompensator modifies the command; if left out, a "
            "HybridPredictor only predicts."
        ),
    ] = None,
    trajectory: TrajectoryOption = None,
    unit: UnitOption = None,
    T_s: TsOption = None,
    weights: WeightsOption = None,
    ssp: Annotated[
        str, typer.Option(help="Version of SSP: 1 with FMI 2.0 FMUs, or 2 with FMI 3.0 FMUs, for tools that read it.")
    ] = "1",
    target: TargetOption = None,
    out: Annotated[
        Path | None, typer.Option(help="The archive, .ssp; named after the machine in this folder if left out.")
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a whole system as one file, SSP 1.0 or 2.0.

    Trajectory, predictor or compensator and drive, wired, with their parameters, for tools that read SSP.
    """
    from ..fmi.compile import check_available
    from ..fmi.ssp import build_system, check_system
    from ..machines.machine import load_machine, machine_path
    from .console import check_outputs, console, print_json, progress_bar

    axis = load_machine(machine)
    if compensate is not None:
        check("compensate", compensate, label="--compensate")
    trajectory = trajectory or _default_trajectory(machine)
    out = out or Path(f"{axis.name}.ssp")
    check_system(axis, compensate=compensate, ssp=ssp)
    command = _read_command(trajectory, axis, unit, T_s)
    check_available(target or ("host",))
    file = None if trajectory in TRAJECTORIES else trajectory
    inputs = {"machine file": machine_path(machine), "trajectory": file, "saved predictor": weights}
    check_outputs([("--out", out, (".ssp",))], inputs, force=force)
    with progress_bar(as_json) as advance:
        build_system(
            axis,
            out,
            command,
            compensate=compensate,
            targets=target or None,
            weights=weights,
            ssp=ssp,
            progress=advance,
        )
    if as_json:
        print_json([str(out)])
    else:
        console.print(f"{out}  {out.stat().st_size / 1024:.0f} KiB", soft_wrap=True)
