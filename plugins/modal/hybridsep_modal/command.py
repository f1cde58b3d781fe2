"""Command ``hybridsep modal``."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

    from hybridsep.base.signals import Array

    from .frequency_response import IdentifiedResponse

__all__ = ["modal"]


def modal(
    file: Annotated[
        Path,
        typer.Argument(
            help="Frequency response (CSV, MAT, NPZ), Klipper's accelerometer file, or else the log of a swept sine."
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Machine file to write.")] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG to draw.")] = None,
    name: Annotated[str | None, typer.Option(help="Name of the machine in its file; the file's if left out.")] = None,
    modes: Annotated[int | None, typer.Option(help="Number of modes; chosen if left out.")] = None,
    unit_gain: Annotated[bool, typer.Option("--unit-gain", help="Static gain of 1; else it is estimated.")] = False,
    hold: Annotated[str, typer.Option(help="Hold of the command: zoh or foh.")] = "zoh",
    dead_time: Annotated[int, typer.Option(help="Whole samples of dead time in the response.")] = 0,
    T_s: Annotated[
        float | None, typer.Option("--T_s", help="Sampling interval [s]: the model's, 1 ms if left out, or a log's.")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="Unit of the positions of a log, where it does not say it.")] = None,
    t: Annotated[str | None, typer.Option("--t", help="Name of a log's time column.")] = None,
    x_d: Annotated[str | None, typer.Option("--x_d", help="Name of its commanded position's column.")] = None,
    x: Annotated[str | None, typer.Option("--x", help="Name of its measured position's column.")] = None,
    axis: Annotated[str | None, typer.Option(help="Axis of a file with several: x, y or z of Klipper's.")] = None,
    *,
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that exist.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")] = False,
) -> None:
    """Identify the physics model of an axis from a modal test.

    A frequency response, the log of a swept sine that is at rest at both ends, or Klipper's accelerometer file.
    """
    from hybridsep.app.console import progress_bar
    from hybridsep.base.errors import ParameterError
    from hybridsep.base.files import write_whole
    from hybridsep.machines.machine import checked_name, machine_name, machine_text

    from .figure import response_figure

    for option, path in (("--out", out), ("--figure", figure)):
        if path is not None and path.exists() and not force:
            raise ParameterError(f"{option} {path} exists; --force overwrites it")
    machine = checked_name(name) if name else machine_name(out or file)
    columns = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x)) if column}
    with progress_bar(as_json) as advance:
        found = _identified(
            file, columns, unit, T_s, axis, modes, advance, unit_gain=unit_gain, input_hold=hold, dead_time=dead_time
        )
    if figure is not None:
        response_figure(found, file.name, figure)
    if out is not None:
        deviations = [f"{e.name} = {e.value:.6g} ± {e.std:.2g}{_unit(e.unit)}" for e in found.parameters]
        comments = [f"Identified by hybridsep modal from {file.name}.", *deviations, *found.findings]
        write_whole(out, machine_text(found.machine(machine, f"Axis identified from {file.name}"), comments))
    if as_json:
        typer.echo(json.dumps(found.summary(), indent=2))
        return
    _print(found, file.name)
    for path in (out, figure):
        if path is not None:
            typer.echo(f"wrote {path}")


def _identified(
    file: Path,
    columns: dict[str, str],
    unit: str | None,
    T_s: float | None,
    axis: str | None,
    n_modes: int | None,
    progress: "Callable[[str, float], object]",
    *,
    unit_gain: bool,
    input_hold: str,
    dead_time: int,
) -> "IdentifiedResponse":
    """Return the model of a file, whose kind its columns tell."""
    import numpy as np

    from hybridsep.base.errors import ParameterError
    from hybridsep.logs.log import read_log

    from .files import has_response, read_response
    from .frequency_response import identify_frequency_response
    from .klipper import identify_resonance, is_klipper, read_klipper
    from .swept_sine import h1

    if is_klipper(file):
        if axis not in ("x", "y", "z"):
            raise ParameterError(
                f"Klipper's file holds three axes: say which was shaken, --axis x, y or z, got {axis!r}"
            )
        return identify_resonance(read_klipper(file), axis, T_s=1e-3 if T_s is None else T_s)
    sampled = bool(columns) or not has_response(file)
    std: Array | None
    if sampled:
        log = read_log(file, columns=columns, unit=unit, T_s=T_s, axis=axis)
        if len(log.starts) > 1 or np.isnan(log.x_meas).any():
            raise ParameterError(
                f"{file}: a swept sine must have no gap, and be measured in every sample; record it again"
            )
        lines = h1(log.x_d, log.x_meas, log.T_s)
        frequency, response, std, T_s = lines.frequency, lines.response, lines.std, log.T_s
    else:
        frequency, response, std = read_response(file)
    return identify_frequency_response(
        frequency,
        response,
        std=std,
        n_modes=n_modes,
        unit_gain=unit_gain,
        T_s=1e-3 if T_s is None else T_s,
        input_hold=input_hold,
        dead_time=dead_time,
        sampled=sampled,
        progress=progress,
    )


def _print(found: "IdentifiedResponse", title: str) -> None:
    """Print an identified model as tables."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    chosen = f"{len(found.model.modes)} modes, {found.input_hold}"
    table = Table("", "value", "± (1σ)", "unit", title=f"{title}: {chosen}", box=box.SIMPLE)
    for one in found.parameters:
        table.add_row(one.name, f"{one.value:.7g}", f"{one.std:.2g}", _unit(one.unit))
    console.print(table)
    if found.criteria:
        sizes = Table("modes", "RMS of the relative error", "BIC", "", title="Numbers of modes", box=box.SIMPLE)
        for n_modes, rms, criterion in found.criteria:
            mark = "chosen" if n_modes == len(found.model.modes) else ""
            sizes.add_row(str(n_modes), f"{100 * rms:.3g} %", f"{criterion:.1f}", mark)
        console.print(sizes)
    for finding in found.findings:
        console.print(f"- {finding}", soft_wrap=True)


def _unit(name: str) -> str:
    return "" if name == "1" else f" {name}"
