"""Commands that make a model of a log: ``fit`` with FMUs and a report, ``identify`` the physics model alone."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.files import written_text
from ..base.settings import DRIVE_LIMIT_ENTRIES, Limits
from .options import (
    KNOWN_ENTRIES,
    AxisOption,
    CommandColumnOption,
    ForceOption,
    JsonOption,
    MeasuredColumnOption,
    ReadingOptions,
    TimeColumnOption,
    TsOption,
    UnitOption,
    takes_parameters,
    takes_reading,
)

if TYPE_CHECKING:
    from rich.table import Table

    from ..fitting.fit import Fit
    from ..identify.model import IdentifiedModel
    from ..logs.units import DisplayUnits

__all__ = ["fit", "identify"]


@takes_reading
@takes_parameters(KNOWN_ENTRIES, DRIVE_LIMIT_ENTRIES, otherwise="none, or the usual one")
def fit(
    logs: Annotated[list[Path], typer.Argument(help="Recorded logs of one axis: commanded and measured positions.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for machine file, FMUs and report; named after the log if left out.")
    ] = None,
    Np: Annotated[
        int | None,
        typer.Option("--Np", min=1, help="Samples of the controller's look-ahead; 100 ms if left out."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the axis; the log's, with --axis, if left out.")] = None,
    *,
    reading: ReadingOptions,
    parameters: dict[str, Any],
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """From the log of an axis to its model, FMUs and a report."""
    from ..logs.log import read_log
    from ..machines.machine import checked_name, machine_name
    from .console import check_outputs, written_before

    machine = checked_name(name) if name else machine_name(logs[0], reading.axis)
    inputs: dict[str, str | Path | None] = {f"log {path.name}": path for path in logs}
    check_outputs((), inputs)
    found = [read_log(path, **reading.arguments) for path in logs]
    # What computes takes seconds to import: a log that cannot be read is said before
    from ..fitting.build import fit_files
    from ..fitting.compensation import drive_limits
    from ..fitting.fit import fit as fit_logs
    from ..logs.checks import findings_table
    from .console import console, print_json, progress_bar
    from .logs import different_logs, show

    folder = out or Path(machine)
    files = fit_files(folder, machine, compensator=bool(drive_limits(parameters)))
    outputs = [("--out", path, ()) for path in files.values()]
    check_outputs(outputs, inputs, force=force, ours=written_before(files["results"], logs))
    used = different_logs(found)
    for log in used:
        show((f"{log.path.name}: {remark}" for remark in log.remarks), ())
    with progress_bar(as_json) as advance:
        result = fit_logs(
            used, Np=Np, name=machine, progress=lambda words, done: advance(words, 0.87 * done), **parameters
        )
        built = result.build(folder, progress=lambda words, done: advance(words, 0.87 + 0.13 * done))
    if as_json:
        listed = {log_name: findings_table(one) for log_name, one in result.findings.items()}
        written = {what: str(path) for what, path in files.items()}
        print_json({**result.results(), "advice": result.advice, "findings": listed, "files": written})
        return
    _print_fit(result)
    if built.untimed:
        console.print(f"the FMU's steps are not timed: {built.untimed}")
    console.print(f"\n{result.advice}")
    console.print("\n".join(f"{what}: {path}" for what, path in files.items()), soft_wrap=True)
    given = {"out": out, "Np": Np, "name": name, **vars(reading)}
    given |= {entry: parameters[entry] for entry in KNOWN_ENTRIES if entry in parameters}
    console.print("\n".join(_next_steps(result, files, _again(logs, given))), soft_wrap=True, highlight=False)


def _again(logs: Sequence[Path], given: Mapping[str, Any]) -> str:
    """Return the command line of this fit, with the options that are given."""
    words = ["hybridsep", "fit", *map(str, logs)]
    for option, value in given.items():
        if value:
            words += [f"--{option}", *([] if value is True else [str(value)])]
    return shlex.join(words)


def _print_fit(found: Fit) -> None:
    """Print what was read and what the checks found, what was identified and how it was judged."""
    import numpy as np
    from rich import box
    from rich.table import Table

    from ..base.metrics import shown_figure
    from ..fitting.advice import extent
    from .console import console

    judged, model, settings = found.judged, found.identification, found.machine.predictor_settings
    factor, position = judged.shown.position
    for log in found.logs:
        travel = float(np.ptp(log.x_d))
        stated = "" if log.unit_stated else f", as the file states no unit of positions: taken as {log.unit} (--unit)"
        console.print(f"{log.path.name}: {extent([log])}, travel {factor * travel:.4g} {position}{stated}")
    for name, of_log in found.findings.items():
        for finding in of_log:
            console.print(f"{name}: {finding}")
    scale, error = judged.unit
    table = Table("prediction by", title=f"Error on held-out samples [{error}]", box=box.SIMPLE, pad_edge=False)
    table.add_column("RMS", justify="right")
    for one in judged.replay.scored():
        table.add_row(one.name, "diverged" if one.diverged else shown_figure(scale * one.rms))
    console.print(f"{model.structure}, dead time {model.model.dead_time} samples")
    for line in model.findings:
        console.print(f"  {line}")
    window = f"{1e3 * settings.Np * settings.T_s:.4g} ms"
    console.print(f"Np = {settings.Np} ({window}), p = {settings.p}, q = {settings.q}")
    console.print(table)
    console.print(str(judged.replay.verdict()))
    for line in found.tracking.lines(judged.shown) if found.tracking else ():
        console.print(line)


def _next_steps(found: Fit, files: Mapping[str, Path], again: str) -> list[str]:
    """Return what to do after a fit that wrote ``files`` and is repeated by a line, as lines to paste."""
    from ..fmi.archive import other_platforms

    file, state = (shlex.quote(str(files[what])) for what in ("machine file", "trained predictor"))
    limits = found.machine.drive_limits
    lines = ["", "Next, to paste:"]
    if found.machine.plant is None:
        lines.append(f"  # no plant to try with: {found.plant.reason}")
    else:
        # What was learned of the axis helps on a plant that has its disturbances, and on no other.
        warm = f" --weights {state}" if found.plant.disturbed else ""
        how = f" --compensate hybrid{warm}" if limits is not None else ""
        what = "the compensated axis" if limits is not None else "prediction"
        lines.append(f"  # {what}, on the identified model: to try with, results are optimistic")
        lines += [f"  hybridsep cosim -m {file} --compensate off"] if limits is not None else []
        lines += [
            f"  hybridsep cosim -m {file}{how}",
            "  # the same as one file for tools that read SSP",
            f"  hybridsep system -m {file}{how}",
        ]
    if limits is not None and limits.estimated:
        names = [(one.name, getattr(limits, entry)) for entry, one in DRIVE_LIMIT_ENTRIES.items()]
        known = [f"--{name} {value:g}" for name, value in names[: len(Limits.parameters())]]
        lines.append("  # a compensator FMU for the drive; the limits are estimates: put in your drive's")
        lines.append(f"  {again} {' '.join(known)}")
    native = files.get("native FMU")
    if native and (note := other_platforms(native, files["machine file"], files["trained predictor"])):
        says, _, command = note.rpartition(": ")
        lines += [f"  # {says}", f"  {command}"]
    lines.append("  # your own compensator, sample by sample, in Python: docs/howto/python.md")
    return lines


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
    for name, value, std, unit in shown_estimates(found.parameters, shown):
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
