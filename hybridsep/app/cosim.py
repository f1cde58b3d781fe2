"""Commands of a controller and a drive together: ``cosim`` runs them, ``system`` writes them as one file."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import astuple, replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..base.files import COMMANDS, DEFAULT_MACHINE
from ..base.settings import PARAMETERS, Limits, check
from . import options

if TYPE_CHECKING:
    from ..base.signals import Array
    from ..machines.machine import Machine


def cosim(
    axes: Annotated[
        list[str] | None, typer.Argument(help="With --path, X and Y: machine files (.toml) or names.", metavar="AXIS")
    ] = None,
    path: Annotated[
        Path | None,
        typer.Option(help="Path of two axes: a G-code program (G0 to G4), or a log with the commands x and y."),
    ] = None,
    machine: options.MachineOption = DEFAULT_MACHINE,
    entries: options.SetOption = None,
    trajectory: options.TrajectoryOption = None,
    unit: options.UnitOption = None,
    compensate: options.CompensateOption = None,
    predictor: Annotated[
        Path | None,
        typer.Option(help="Predictor FMU, or with --compensate a compensator FMU; built from the machine if left out."),
    ] = None,
    plant: Annotated[Path | None, typer.Option(help="Plant FMU; built from the machine if left out.")] = None,
    weights: options.WeightsOption = None,
    *,
    out: Annotated[Path | None, typer.Option(help="File for all signals, .csv or .npz.")] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            help="PNG with the errors over time: of the predictions, with --compensate of the position, with --path "
            "along it."
        ),
    ] = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Co-simulate a predictor or compensator FMU with a plant FMU.

    Over the staircase, a spiral's axis or a trajectory in a file. Or compensate both axes of a machine along a path:
    contour errors of the true positions with no compensation, physics model, hybrid cold, and warm from such a run.
    """
    if path is not None or axes:
        if machine != DEFAULT_MACHINE or any((trajectory, compensate, predictor, plant, weights)):
            raise ParameterError("-m, --trajectory, --compensate, --predictor, --plant and --weights are for one axis")
        _two_axes(axes or [], path, entries or (), unit, out=out, figure=figure, force=force, as_json=as_json)
        return
    from ..cosim.loop import cosimulate
    from ..fitting.expected import Trial, limits_that_bind
    from ..fitting.replay import Recording
    from ..fitting.stretch import Stretch
    from ..fmi.archive import build_here
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_path
    from .console import RUNS, check_outputs, console, print_run, print_written, progress_bar

    if figure is not None:
        from ..evaluate.figures import prediction_figure, tracking_figure

    if compensate is not None:
        check("compensate", compensate, label="--compensate")
    axis = load_machine(machine, entries or ())
    model = "HybridPredictor" if compensate is None else "SepCompensator"
    trajectory, command, of_file = _command(trajectory, machine, axis, unit)
    shown = shown_of(of_file or axis.log.unit or "", axis.unit)
    _check_pair(axis, model, predictor, plant, weights, entries or ())
    file = None if trajectory in options.TRAJECTORIES else trajectory
    inputs = {"trajectory": file, "predictor": predictor, "plant": plant, "saved predictor": weights}
    outputs = (("--out", out, RUNS), ("--figure", figure, (".png",)))
    check_outputs(outputs, {"machine file": machine_path(machine), **inputs}, force=force)
    title = f"{' and '.join(path.name for path in (predictor, plant) if path is not None) or axis.title}, {trajectory}"
    values = {} if compensate is None else {"compensate": PARAMETERS["compensate"].to_fmi(compensate)}
    limits, costs = None, None
    with tempfile.TemporaryDirectory() as folder, progress_bar(as_json) as advance:
        controller = predictor or build_here(axis, model, Path(folder), weights=weights, reference=False)
        drive = plant or build_here(axis, "FeedDrive", Path(folder), reference=False)
        run = cosimulate(
            controller, drive, command, controller_values=values, progress=lambda k, n: advance("co-simulation", k / n)
        )
        if predictor is None and compensate not in (None, "off"):
            settings = replace(axis.compensator_settings, compensate=compensate)
            limits = limits_that_bind(run.x_d, run.x_dm, run.T_s, settings)
            trial = Trial(axis, None if weights else controller)  # with weights it has only their p and q
            if limits and (stretch := Stretch.of(trial, [Recording(run.x_d, run.x, 0)])):
                advance("what limits cost", 0.0)
                costs = stretch.limit_costs()
    if out is not None:
        run.save(out)
    if figure is not None and compensate is None:
        prediction_figure(run, title, figure, shown)
    elif figure is not None:
        tracking_figure({str(compensate): run}, title, figure, shown)
    bound = None if limits is None else {"limits_that_bind": limits, "limit_costs": costs}
    print_run(run, as_json, title, axis.unit, shown, bound)
    if not as_json:
        for line in () if costs is None else costs.lines(shown, "--set drive_limits.{entry}="):
            console.print(line)
        if plant is None:
            _say_optimistic(axis)
        print_written(out, figure)


def _two_axes(
    axes: Sequence[str],
    path: Path | None,
    entries: Sequence[str],
    unit: str | None,
    *,
    out: Path | None,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Co-simulate the compensators of X and Y along a path: off, physics, hybrid cold and warm, and a rival."""
    from ..cosim.compensated import COMPENSATED, compensate
    from ..cosim.contour import contours_of
    from ..cosim.run import save_columns
    from ..fmi.archive import build_here
    from ..machines.machine import load_machine, machine_path
    from ..plants.path import read_path
    from .console import RUNS, check_outputs, print_contours, print_written, progress_bar

    if path is None or len(axes) != 2:
        raise ParameterError(
            f"two machines and a path belong together, got {len(axes)}{'' if path else ' and none'}: "
            "hybridsep cosim x.toml y.toml --path part.ngc; one axis alone is --machine"
        )
    machines = [load_machine(axis, entries) for axis in axes]
    for axis in machines:
        _check_pair(axis, "SepCompensator", None, None, None, ())
    delays = [f"{axis.T_s:g} s and {axis.compensator_settings.preview} samples" for axis in machines]
    if delays[0] != delays[1]:
        raise ParameterError(
            f"both axes must have one T_s and one preview, got {' and '.join(delays)}; fit them to logs of one "
            "rate with one --look-ahead, or set compensator.preview in both files"
        )
    inputs = {"path": path, **{f"machine file {axis}": machine_path(axis) for axis in axes}}
    check_outputs((("--out", out, RUNS), ("--figure", figure, (".png",))), inputs, force=force)
    limits = Limits(*map(min, *map(_path_limits, machines)))
    meant = read_path(path, limits, machines[0].T_s, unit)
    runs, steps = [], count()
    with tempfile.TemporaryDirectory() as temporary, progress_bar(as_json) as advance:

        def say(what: str) -> None:
            advance(what, next(steps) / (2 * (2 + len(COMPENSATED))))

        for name, axis, command in zip("XY", machines, meant.axes, strict=True):
            folder = Path(temporary, name)
            plant = build_here(axis, "FeedDrive", folder, reference=False)
            runs.append(compensate(axis, plant, command, folder, f"{name} axis", say, reference=False)[0])
    x, y = runs
    contours = contours_of(x, y, meant)
    title = f"{path.name}: {machines[0].title}; {machines[1].title}"
    if out is not None:
        columns = {"t": x["off"].t, "x_d": meant.axes[0], "y_d": meant.axes[1]}
        for key, contour in contours.items():
            columns |= {f"x_{key}": x[key].x, f"y_{key}": y[key].x, f"contour_{key}": contour.error}
        save_columns(columns, out)
    if figure is not None:
        from ..evaluate.figures import contour_figure

        contour_figure(contours, title, figure)
    print_contours({key: contour.figures() for key, contour in contours.items()}, as_json, title)
    if not as_json:
        _say_optimistic(*machines)
        print_written(out, figure)


def _say_optimistic(*machines: Machine) -> None:
    """Say what errors on an identified plant are worth, if one of the machines has such a plant."""
    from ..machines.sections import IdentifiedSection
    from .console import console

    if any(isinstance(axis.plant, IdentifiedSection) for axis in machines):
        console.print("The plant is identified from a log, to try with, no measurement: results on it are optimistic.")


def _path_limits(axis: Machine) -> tuple[float, ...]:
    """Return velocity, acceleration and jerk for paths: ``[limits]``, or the drive's with the room of a fit's."""
    from ..fitting.limits import MARGINS

    drive, _ = axis.command_limits()
    if axis.limits is not None or drive is None:
        return astuple(axis.trajectory_limits())
    return tuple(most / more for most, more in zip(astuple(drive), MARGINS.tolist(), strict=True))


def _command(trajectory: str | None, machine: str, axis: Machine, unit: str | None) -> tuple[str, Array, str]:
    """Return the trajectory that is meant, its samples at the machine's interval, and the unit of its file or ""."""
    # Where none is given it is a fit's commands beside the machine file, else the staircase
    from ..logs.log import check_reading, read_log
    from ..plants.trajectory import PAPER_LIMITS, spiral, staircase

    check_reading(unit, None)
    if trajectory is None:
        beside = Path(machine).with_name(COMMANDS)
        trajectory = str(beside) if machine.endswith(".toml") and beside.is_file() else options.TRAJECTORIES[0]
    limits = PAPER_LIMITS if axis.limits is None else axis.trajectory_limits()
    if trajectory == "staircase":
        return trajectory, staircase(axis.T_s, limits=limits), ""
    if trajectory in options.TRAJECTORIES:
        return trajectory, spiral(axis.T_s, limits=limits)[trajectory == "spiral_y"], ""
    log = read_log(trajectory, columns={"x_d": "x_d", "x": "x_d"}, unit=unit, T_s=axis.T_s)
    return trajectory, log.x_d, log.file_unit if log.unit_stated else ""


def _check_pair(
    axis: Machine, model: str, predictor: Path | None, plant: Path | None, weights: Path | None, entries: Sequence[str]
) -> None:
    """Check the FMUs of a look-ahead ``model`` and a plant: those that are given, and that the others can be built."""
    from ..cosim.loop import check_controller, check_plant
    from ..cosim.run import COMPENSATOR, PREDICTOR
    from ..fmi.compile import check_available

    if plant is None:
        axis.check_section("plant", ", or name a plant FMU with --plant")
    if predictor is None and model == "SepCompensator":
        axis.check_section("drive_limits", ", or name a compensator FMU with --predictor")
    if predictor is not None and weights is not None:
        raise ParameterError("--weights go into an FMU that is built here; leave out --predictor")
    there = (("--predictor", predictor, ("predictor", "compensator")), ("--plant", plant, ("plant",)))
    for option, given, sections in there:
        if given is not None and any(entry.strip().startswith(sections) for entry in entries):
            raise ParameterError(f"--set {sections[0]}.… is for an FMU that is built here; leave out {option}")
    if predictor is not None:
        check_controller(predictor, PREDICTOR if model == "HybridPredictor" else COMPENSATOR)
    if plant is not None:
        check_plant(plant)
    if None in (predictor, plant):
        check_available(("host",))


def system(
    machine: options.MachineOption = DEFAULT_MACHINE,
    compensate: options.CompensateOption = None,
    trajectory: options.TrajectoryOption = None,
    unit: options.UnitOption = None,
    weights: options.WeightsOption = None,
    ssp: Annotated[
        str, typer.Option(help="Version of SSP: 1 with FMI 2.0 FMUs, or 2 with FMI 3.0 FMUs, for tools that read it.")
    ] = "1",
    target: options.TargetOption = None,
    out: Annotated[
        Path | None, typer.Option(help="The archive, .ssp; named after the machine in this folder if left out.")
    ] = None,
    force: options.ForceOption = False,
) -> None:
    """Write a whole system as one file, SSP 1.0 or 2.0.

    Trajectory, predictor or compensator and drive, wired, with their parameters, for tools that read SSP.
    """
    from ..fmi.compile import check_available
    from ..fmi.ssp import build_system, check_system
    from ..machines.machine import load_machine, machine_path
    from .console import check_outputs, print_built, progress_bar

    if compensate is not None:
        check("compensate", compensate, label="--compensate")
    axis = load_machine(machine)
    out = out or Path(f"{axis.name}.ssp")
    check_system(axis, compensate=compensate, ssp=ssp)
    trajectory, command, _ = _command(trajectory, machine, axis, unit)
    check_available(target or ("host",))
    file = None if trajectory in options.TRAJECTORIES else trajectory
    inputs = {"machine file": machine_path(machine), "trajectory": file, "saved predictor": weights}
    check_outputs([("--out", out, (".ssp",))], inputs, force=force)
    given: dict[str, Any] = {"compensate": compensate, "targets": target or None, "weights": weights, "ssp": ssp}
    with progress_bar(False) as advance:
        build_system(axis, out, command, progress=advance, **given)
    print_built([out])
