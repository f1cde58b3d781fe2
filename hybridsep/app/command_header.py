"""Command ``hybridsep header``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .estimates import warn_of_estimates
from .options import ForceOption, WeightsOption

__all__ = ["header"]


def header(
    machine: Annotated[str, typer.Argument(help="Machine file (.toml) or name.")],
    out: Annotated[Path | None, typer.Option(help="The header; named after the machine if left out.")] = None,
    predictor: Annotated[
        bool, typer.Option("--predictor", help="Of the predictor alone; it needs no limits of the drive.")
    ] = False,
    weights: WeightsOption = None,
    force: ForceOption = False,
) -> None:
    """Write an axis as a C header for the library in C.

    The library is fmu_src/c: a compensator, or a predictor, for a controller that runs no FMU. The header has the
    axis's modes, settings and, with ``--weights``, what an earlier run has learned.
    """
    from ..base.output import written_text
    from ..fmi.controllers import axis_header
    from ..fmi.weights import load_trained
    from ..machines.machine import load_machine, machine_path
    from .outputs import check_outputs

    axis = load_machine(machine)
    model = "HybridPredictor" if predictor else "SepCompensator"
    trained = None if weights is None else load_trained(weights, axis, model)
    text = axis_header(axis, model, trained)
    path = Path(f"{axis.name}.h") if out is None else out
    inputs = {f"machine file {machine}": machine_path(machine), "saved predictor": weights}
    check_outputs([("--out", path, (".h",))], inputs, force=force)
    if not predictor:
        warn_of_estimates([axis])
    with written_text(path) as file:
        file.write(text)
    typer.echo(f"{path} written: include it after installing the library, whose README.md says how (fmu_src/c)")
