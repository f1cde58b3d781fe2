"""``hybridsep identify``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.files import written_text
from .options import (
    AxisOption,
    CommandColumnOption,
    ForceOption,
    JsonOption,
    MeasuredColumnOption,
    TimeColumnOption,
    TsOption,
    UnitOption,
)

if TYPE_CHECKING:
    from rich.table import Table

    from ..identify.model import IdentifiedModel
    from ..logs.units import DisplayUnits

__all__ = ["identify"]


def identify(
    recording: Annotated[Path, typer.Argument(help="Log of commanded and measured positions, in operation.")],
    out: Annotated[Path | None, typer.Option(help="Machine file to write.")] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG to draw.")] = None,
    name: Annotated[str | None, typer.Option(help="Name of the machine in its file; the file's if left out.")] = None,
    unit_gain: Annotated[
        bool | None, typer.Option("--unit-gain/--free-gain", help="Static gain of 1, or estimated; chosen if left out.")
    ] = None,
    measurement_delay: Annotated[
        int,
        typer.Option(
            "--measurement_delay",
            min=0,
            help="Whole samples by which the measured position is late; the model is then without them.",
        ),
    ] = 0,
    unit: UnitOption = None,
    T_s: TsOption = None,
    t: TimeColumnOption = None,
    x_d: CommandColumnOption = None,
    x: MeasuredColumnOption = None,
    axis: AxisOption = None,
    *,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Identify the physics model of an axis from a log of its work.

    From a frequency response, a swept sine or Klipper's accelerometer: hybridsep modal, a plug-in.
    """
    from ..fitting.advice import partly_used
    from ..identify.figures import operation_figure
    from ..identify.operation import identify_operation
    from ..identify.output_error import in_time
    from ..logs.checks import checked
    from ..logs.log import read_log
    from ..machines.machine import checked_name, machine_name
    from .console import check_outputs, console, print_json, print_written, progress_bar
    from .logs import show

    outputs = (("--out", out, (".toml",)), ("--figure", figure, (".png",)))
    machine = checked_name(name) if name else machine_name(out or recording)
    check_outputs(outputs, {"recording": recording}, force=force)
    columns = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x)) if column}
    with progress_bar(as_json) as advance:
        log = read_log(recording, columns=columns, unit=unit, T_s=T_s, axis=axis)
        show(log.remarks, checked(log))
        late = (in_time(piece.x_d, piece.x_meas, measurement_delay) for piece in log.segments())
        pieces = [piece for piece in late if len(piece[0])]
        found = identify_operation(
            pieces, log.T_s, unit_gain=unit_gain, unit=log.unit, shown=log.shown, progress=advance
        )
    if figure is not None:
        operation_figure(found, pieces, recording.name, figure, log.shown)
    if out is not None:
        entries: dict[str, Any] = {"predictor": {"measurement_delay": measurement_delay}} if measurement_delay else {}
        _write_machine(found, machine, recording.name, entries, out)
    if as_json:
        print_json(dict(found.summary()))
        return
    if line := partly_used(log):
        console.print(line)
    _print_identified(found, recording.name, log.shown)
    print_written(out, figure)


def _write_machine(found: IdentifiedModel, name: str, recording: str, entries: Mapping[str, Any], out: Path) -> None:
    """Write the machine file, with the deviations and findings as comments."""
    from ..identify.model import deviation_words
    from ..machines.text import machine_text

    deviations = [
        f"{e.name} = {e.value:.6g} {deviation_words(e.std, '± ')}{'' if e.unit == '1' else ' ' + e.unit}"
        for e in found.parameters
    ]
    comments = [f"Identified by hybridsep from {recording}.", *deviations, *found.findings]
    machine = found.machine(name, f"Axis identified from {recording}", **entries)
    with written_text(out) as file:
        file.write(machine_text(machine, comments))


def _print_identified(found: IdentifiedModel, title: str, shown: DisplayUnits) -> None:
    """Print an identified model as tables in the units of its log."""
    from rich import box
    from rich.table import Table

    from ..identify.model import deviation_words, shown_estimates
    from .console import console

    table = Table(
        *("", "value", "± (1σ)", "unit"), title=f"{title}: {found.structure}, {found.input_hold}", box=box.SIMPLE
    )
    for name, value, std, unit in shown_estimates(map(vars, found.parameters), shown):
        table.add_row(name, f"{value:.7g}", deviation_words(std), "" if unit == "1" else unit)
    console.print(table)
    console.print(_structures(found, shown))
    for finding in found.findings:
        console.print(f"- {finding}")


def _structures(found: IdentifiedModel, shown: DisplayUnits) -> Table:
    from rich import box
    from rich.table import Table

    factor, unit = shown.error(found.rms)
    table = Table(
        *("structure", "parameters", "fitted", "held out", ""),
        title=f"RMS error of the simulated position, in {unit}",
        box=box.SIMPLE,
    )
    for other in found.alternatives:
        remark = "chosen" if other.name == found.structure else other.objection
        errors = (f"{factor * other.rms_fitted:.4g}", f"{factor * other.rms_held_out:.4g}")
        table.add_row(other.name, str(other.n_parameters), *errors, remark)
    return table
