"""Command ``hybridsep build``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..fmi.flavours import FLAVOURS, FMI_VERSIONS
from .estimates import warn_of_estimates
from .failures import errors_console
from .options import (
    FlavourOption,
    FmiOption,
    ForceOption,
    JsonOption,
    TargetOption,
    TsOption,
    UnitOption,
    WeightsOption,
)

__all__ = ["build"]

CONTROLLERS = ("twincat",)
"""Controllers that ``--for`` takes."""


def build(
    fmus: Annotated[
        list[str] | None, typer.Argument(help="FMUs to build, by name; all of the machines' if left out.")
    ] = None,
    machine: Annotated[
        list[str] | None,
        typer.Option("--machine", "-m", help="Machine file (.toml) or name; may be repeated; all if left out."),
    ] = None,
    flavour: FlavourOption = FLAVOURS[0],
    fmi: FmiOption = FMI_VERSIONS[0],
    target: TargetOption = None,
    weights: WeightsOption = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(help="CSV, .npz or .mat file with the columns t and x_d, for ReferenceTrajectory to play."),
    ] = None,
    unit: UnitOption = None,
    T_s: TsOption = None,
    windows: Annotated[
        bool,
        typer.Option(
            "--windows/--no-windows",
            help="Whether a HybridPredictor shows its whole window, 4·Np scalars or four arrays.",
        ),
    ] = True,
    embed_weights: Annotated[
        bool,
        typer.Option(
            "--embed-weights",
            help="Compile the weights into the sources of a native FMU too, for targets without files (HSEP_NO_FILES).",
        ),
    ] = False,
    controller: Annotated[
        str | None,
        typer.Option(
            "--for",
            help=f"Controller that compiles the sources: {', '.join(CONTROLLERS)}. Weights are compiled in, what "
            "plays files is left out, and a file that its tool needs lies beside the FMUs.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = Path("dist"),
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Build FMUs from machine files.

    The same machine gives the same bytes.
    """
    from ..base.errors import ParameterError
    from ..fmi.archive import build_fmu
    from ..fmi.jobs import extras_of, jobs_of, libraries_of, without_files
    from ..fmi.libraries import library_paths, missing
    from ..fmi.twincat import CONFIGURATION_FILE, write_configuration
    from ..machines.machine import machine_path
    from .overwrite import FMU, TWINCAT, Output, check_outputs
    from .progress import progress_bar
    from .tables import console, print_json

    if embed_weights and flavour != "native":
        raise ParameterError(f"--embed-weights is for native FMUs; with --flavour {flavour} leave it out")
    if controller is not None and controller not in CONTROLLERS:
        raise ParameterError(f"--for must be {' or '.join(CONTROLLERS)}, got {controller}")
    if controller is not None and flavour != "native":
        raise ParameterError(f"--for {controller} is for native FMUs; with --flavour {flavour} leave it out")
    jobs = jobs_of(fmus or [], machine or [], flavour, target or [], fmi)
    if controller is not None:
        jobs = without_files(jobs, f"--for {controller}", named=bool(fmus))
        embed_weights = embed_weights or weights is not None
    extras = extras_of(jobs, weights, trajectory, unit, T_s, windows=windows, embed_weights=embed_weights)
    inputs = {f"machine file {source}": machine_path(source) for source in machine or []}
    check_outputs(
        [
            *(Output("--out", out / f"{name}.fmu", FMU) for _, name, _, _ in jobs),
            *([Output("--out", out / CONFIGURATION_FILE, TWINCAT)] if controller else []),
        ],
        {**inputs, "saved predictor": weights, "trajectory": trajectory},
        force=force,
    )
    warn_of_estimates({axis.name: axis for axis, _, model, _ in jobs if model == "SepCompensator"}.values())
    paths = []
    with progress_bar(as_json) as advance:
        if flavour == "native":
            needed = libraries_of(jobs, target or [])
            compiling = iter(range(1, len(absent := missing(needed)) + 1))

            def on_library(library: tuple[str, str]) -> None:
                i = next(compiling)
                text = f"compile {library[0]} for {library[1]}, {i} of {len(absent)}"
                if as_json or errors_console.is_terminal:
                    advance(text, (i - 1) / len(absent))
                else:
                    errors_console.print(text, soft_wrap=True)

            library_paths(needed, on_library)
        for i, (axis, name, model, version) in enumerate(jobs):
            advance(name, i / len(jobs))
            given = {"targets": target or None, "fmi": version, **extras.get(model, {})}
            paths.append(build_fmu(axis, name, out, flavour, **given))
        if controller is not None:
            paths.append(write_configuration(out, paths))
        advance("done", 1.0)
    if as_json:
        print_json([str(path) for path in paths])
    else:
        for path in paths:
            console.print(f"{path}  {path.stat().st_size / 1024:.0f} KiB", soft_wrap=True)
