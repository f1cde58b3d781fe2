"""``hybridsep cosim``."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from ..base.data_files import DEFAULT_MACHINE
from ..base.errors import ParameterError
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
    TrajectoryOption,
    TsOption,
    UnitOption,
    WeightsOption,
    parameter_help,
    takes_parameters,
)

__all__ = ["cosim"]


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
    from ..cosim.loop import cosimulate
    from ..cosim.pairing import check_pair, default_trajectory, read_command, values_to_build
    from ..fmi.builds import build_here
    from ..machines.machine import load_machine, machine_path
    from .outputs import RUNS, check_outputs
    from .progress import progress_bar
    from .tables import print_run, print_written

    if figure is not None:
        from ..evaluate.figures import prediction_figure, tracking_figure

    axis = load_machine(machine)
    trajectory = trajectory or default_trajectory(machine)
    outputs = (("--out", out, RUNS), ("--figure", figure, (".png",)))
    if compensate is not None:
        check("compensate", compensate, label="--compensate")
    model = "HybridPredictor" if compensate is None else "SepCompensator"
    command = read_command(trajectory, axis, unit, T_s)
    if compensate is None and (wrong := [f"--{name}" for name in parameters if name in COMPENSATOR_ENTRIES]):
        raise ParameterError(f"{', '.join(wrong)} must come with --compensate")
    values = dict(parameters)
    if predictor is None:
        values = values_to_build(axis, model, values)
    if seed is not None:
        check("seed", seed)
    if compensate is not None:
        values["compensate"] = PARAMETERS["compensate"].to_fmi(compensate)
    check_pair(axis, model, predictor, plant, weights, flavour)
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
    print_run(run, as_json, title)
    if not as_json:
        print_written(out, figure)
