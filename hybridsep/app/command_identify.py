"""``hybridsep identify``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.output import written_text
from ..identify.kinds import KINDS
from .options import (
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

    from ..identify.frequency_response import IdentifiedResponse
    from ..identify.model import IdentifiedModel
    from ..logs.units import Shown

__all__ = ["identify"]


def identify(
    recording: Annotated[
        Path,
        typer.Argument(
            help="Log of commanded and measured positions, frequency response (CSV, MAT), or Klipper's accelerometers."
        ),
    ],
    kind: Annotated[
        str,
        typer.Option(
            help=f"What the file is: {', '.join(KINDS)}. auto: by its columns, a log being one of operation; sweep: a "
            "log of a swept sine, at rest at both ends."
        ),
    ] = "auto",
    out: Annotated[Path | None, typer.Option(help="Machine file to write.")] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG to draw.")] = None,
    name: Annotated[str | None, typer.Option(help="Name of the machine in its file; the file's if left out.")] = None,
    fix: Annotated[
        bool, typer.Option("--fix", help="Apply what puts a finding of the checks of a log right, and go on.")
    ] = False,
    unit_gain: Annotated[
        bool | None, typer.Option("--unit-gain/--free-gain", help="Static gain of 1, or estimated; chosen if left out.")
    ] = None,
    modes: Annotated[int | None, typer.Option(help="Number of modes of a response; chosen if left out.")] = None,
    hold: Annotated[str, typer.Option(help="Hold of the command with a response: zoh or foh.")] = "zoh",
    dead_time: Annotated[int, typer.Option(help="Whole samples of dead time in a response.")] = 0,
    measurement_delay: Annotated[
        int,
        typer.Option(
            "--measurement-delay",
            "--measurement_delay",
            min=0,
            help="Whole samples by which the measured position of a log is late; the model is then without them.",
        ),
    ] = 0,
    unit: UnitOption = None,
    T_s: TsOption = None,
    t: TimeColumnOption = None,
    x_d: CommandColumnOption = None,
    x: MeasuredColumnOption = None,
    axis: Annotated[str | None, typer.Option(help="Axis of a file that holds several: x, y or z of Klipper's.")] = None,
    *,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Identify the physics model of an axis.

    From a log, a frequency response, a swept sine or Klipper's accelerometers.
    """
    from ..fitting.advice import partly_used
    from ..identify.figures import operation_figure, response_figure
    from ..identify.frequency_response import IdentifiedResponse
    from ..identify.recording import Choices, FileReading, identify_recording, read_recording
    from ..logs.units import shown_in
    from ..machines.naming import checked_name, machine_name
    from .log_intake import show
    from .overwrite import MACHINE, PNG, Output, check_outputs
    from .progress import progress_bar
    from .tables import console, print_written

    outputs = (Output("--out", out, {".toml": MACHINE}), Output("--figure", figure, PNG))
    machine = checked_name(name) if name else machine_name(out or recording)
    check_outputs(outputs, {"recording": recording}, force=force)
    columns = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x)) if column}
    reading = FileReading(kind, columns, unit, T_s, axis, measurement_delay, fix)
    with progress_bar(as_json) as advance:
        read = read_recording(recording, reading)
        if read.log is not None and read.is_operation:
            show(read.log.remarks, read.findings)
        found = identify_recording(read, Choices(unit_gain, modes, hold, dead_time), advance)
    shown = shown_in("m") if read.log is None else read.log.shown
    if figure is not None:
        if isinstance(found, IdentifiedResponse):
            response_figure(found, recording.name, figure)
        else:
            operation_figure(found, read.pieces, recording.name, figure, shown)
    if out is not None:
        entries: dict[str, Any] = {"predictor": {"measurement_delay": measurement_delay}} if measurement_delay else {}
        if read.changed:
            entries["sources"] = [f"identified from {recording.name}", *read.changed]
        _write_machine(found, machine, recording.name, entries, out)
    if not as_json and read.log is not None and read.is_operation and (line := partly_used(read.log)):
        console.print(line)
    _print_identified(found, as_json, recording.name, shown)
    if not as_json:
        print_written(out, figure)


def _write_machine(
    found: IdentifiedModel | IdentifiedResponse, name: str, recording: str, entries: Mapping[str, Any], out: Path
) -> None:
    """Write the machine file, with the deviations and findings as comments."""
    from ..identify.shown import deviation_words
    from ..machines.seal import sealed
    from ..machines.text import machine_text

    deviations = [
        f"{e.name} = {e.value:.6g} {deviation_words(e.std, '± ')}{'' if e.unit == '1' else ' ' + e.unit}"
        for e in found.parameters
    ]
    comments = [f"Identified by hybridsep from {recording}.", *deviations, *found.findings]
    machine = found.machine(name, f"Axis identified from {recording}", **entries)
    with written_text(out) as file:
        file.write(sealed(machine_text(machine, comments), "identify"))


def _print_identified(found: IdentifiedModel | IdentifiedResponse, as_json: bool, title: str, shown: Shown) -> None:
    """Print an identified model, as tables in the units of its log, or as JSON."""
    from ..identify.model import IdentifiedModel
    from .tables import console, print_json

    if as_json:
        print_json(dict(found.summary()))
        return
    console.print(_parameters(found, title, shown))
    if isinstance(found, IdentifiedModel):
        console.print(_structures(found, shown))
    elif found.criteria:
        console.print(_sizes(found))
    for finding in found.findings:
        console.print(f"- {finding}")


def _parameters(found: IdentifiedModel | IdentifiedResponse, title: str, shown: Shown) -> Table:
    from rich import box
    from rich.table import Table

    from ..identify.model import IdentifiedModel
    from ..identify.shown import deviation_words, shown_estimates

    chosen = found.structure if isinstance(found, IdentifiedModel) else f"{len(found.model.modes)} modes"
    table = Table("", "value", "± (1σ)", "unit", title=f"{title}: {chosen}, {found.input_hold}", box=box.SIMPLE)
    for name, value, std, unit in shown_estimates(map(vars, found.parameters), shown):
        table.add_row(name, f"{value:.7g}", deviation_words(std), "" if unit == "1" else unit)
    return table


def _structures(found: IdentifiedModel, shown: Shown) -> Table:
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


def _sizes(found: IdentifiedResponse) -> Table:
    from rich import box
    from rich.table import Table

    table = Table("modes", "RMS of the relative error", "BIC", "", title="Numbers of modes", box=box.SIMPLE)
    for n_modes, rms, criterion in found.criteria:
        chosen = "chosen" if n_modes == len(found.model.modes) else ""
        table.add_row(str(n_modes), f"{100 * rms:.3g} %", f"{criterion:.1f}", chosen)
    return table
