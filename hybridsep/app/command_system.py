"""``hybridsep system``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..base.data_files import DEFAULT_MACHINE
from ..base.settings import PARAMETERS, check
from .command_cosim import default_trajectory, read_command
from .options import (
    TRAJECTORIES,
    ForceOption,
    JsonOption,
    MachineOption,
    TargetOption,
    TrajectoryOption,
    TsOption,
    UnitOption,
    WeightsOption,
)

__all__ = ["system"]


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
    from .outputs import check_outputs
    from .progress import progress_bar
    from .tables import console, print_json

    axis = load_machine(machine)
    if compensate is not None:
        check("compensate", compensate, label="--compensate")
    trajectory = trajectory or default_trajectory(machine)
    out = out or Path(f"{axis.name}.ssp")
    check_system(axis, compensate=compensate, ssp=ssp)
    command = read_command(trajectory, axis, unit, T_s)
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
