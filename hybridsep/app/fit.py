"""``fit``, from the log of an axis to its model, FMUs and a report; ``tune``, settings of the predictor by replays."""

from __future__ import annotations

import math
import os
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..base.files import atomic_open_text
from ..base.settings import DRIVE_LIMIT_ENTRIES, Limits, PredictorSettings
from .options import (
    ForceOption,
    JsonOption,
    LogsArgument,
    MachineOption,
    ReadingOptions,
    SetOption,
    takes_known,
    takes_reading,
)

if TYPE_CHECKING:
    from rich.table import Table

    from ..base.signals import Array
    from ..fitting.fit import Fit
    from ..fitting.tuning import Tuning

_ROWS = 10
"""Candidates that are printed, besides the machine's own settings."""

_LOGS = 4
"""Logs whose RMS errors have a column each."""

_FIELDS = {PredictorSettings.parameters()[field].name: field for field in PredictorSettings.TUNED}
"""Fields of settings by their names."""


@takes_reading
def tune(
    logs: LogsArgument,
    machine: MachineOption,
    entries: SetOption = None,
    tried: Annotated[
        list[str] | None,
        typer.Option(
            "--try",
            metavar="NAME=VALUES",
            help=f"Values to try of one of {', '.join(_FIELDS)}, as p=5,10,50; may be repeated. Of those that are left "
            "out some of its own.",
        ),
    ] = None,
    *,
    reading: ReadingOptions,
    out: Annotated[Path | None, typer.Option(help="Machine file to write, with what was chosen.")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Rank settings of the predictor by causal replays of logs.

    The look-ahead is the controller's.
    """
    from ..fitting.advice import extent
    from ..fitting.tuning import candidates, default_values, unsettled
    from ..fitting.tuning import tune as tune_on
    from ..logs.checks import findings_table
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_path
    from ..machines.text import machine_text
    from .console import check_outputs, console, print_json, print_written, progress_bar
    from .logs import read_checked, show

    axis = load_machine(machine, entries or ())
    inputs: dict[str, str | Path | None] = {f"log {path}": path for path in logs}
    inputs["machine file"] = machine_path(machine)
    check_outputs([("--out", out, (".toml",))], inputs, force=force)
    settings = axis.predictor_settings
    given = candidates(settings, {**default_values(settings), **_values(tried or ())})
    if out is not None:  # a [compensator] that takes over p and q may not allow the largest
        axis.changed("predictor", {"p": max(one.p for one in given), "q": max(one.q for one in given)})
    names = [path.name if [one.name for one in logs].count(path.name) == 1 else str(path) for path in logs]
    read = {name: read_checked(path, reading, axis) for name, path in zip(names, logs, strict=True)}
    Np = settings.Np
    pieces = {name: [unsettled(one.x_d, one.x_meas, Np) for one in log.segments()] for name, (log, _) in read.items()}
    with progress_bar(as_json) as advance:
        tuning = tune_on(
            *(axis.model, pieces, given),
            jobs=os.cpu_count() or 1,
            progress=lambda done: advance(f"replay {len(given)} candidates", done),
        )
    chosen = tuning.entries(tuning.chosen)
    if as_json:
        print_json({**tuning.results(), "findings": {name: findings_table(found) for name, (_, found) in read.items()}})
    else:
        if in_motion := [name for name, log in pieces.items() if any(one.n_settling for one in log)]:
            show([f"{', '.join(in_motion)}: begins in motion, and is ranked without its first window"], ())
        for name, (log, _) in read.items():
            console.print(f"{name}: {extent([log])}")
        shown = shown_of(read[names[-1]][0].file_unit, axis.unit)
        print_tuning(tuning, axis.title, *shown.error(float(max(tuning.rms_pb))))
    if out is not None:
        comment = f"Settings of [predictor] from hybridsep tune on {', '.join(path.name for path in logs)}."
        with atomic_open_text(out) as file:
            file.write(machine_text(axis.changed("predictor", chosen), [comment]))
    if not as_json:
        print_written(out)


def _values(tried: Iterable[str]) -> dict[str, tuple[Any, ...]]:
    """Return the values to try, ascending, by the fields of settings."""
    values = {}
    for text in tried:
        name, _, listed = (part.strip() for part in text.partition("="))
        if name not in _FIELDS or not listed:
            raise ParameterError(f"--try must be as p=5,10,50, of {', '.join(_FIELDS)}, got {text!r}")
        field, found = _FIELDS[name], set()
        for one in listed.split(","):
            try:
                value: Any = float(one)
            except ValueError:
                value = one  # refused by its name
            found.add(PredictorSettings.parameters()[field].checked(value, f"--try {name}"))
        values[field] = tuple(sorted(found))
    return values


def print_tuning(tuning: Tuning, title: str, factor: float, unit: str) -> None:
    """Print a tuning, errors in a unit of which ``factor`` are one m or rad."""
    from .console import console

    chosen = tuning.candidates[tuning.chosen]
    console.print(f"{title}: RMS in {unit} against the measured position, Np = {chosen.Np}")
    console.print(_ranked(tuning, factor))
    entries = (f"{name} = {value}" for name, value in tuning.entries(tuning.chosen).items())
    console.print("\n".join((*_words(tuning), "For the machine file:\n\n[predictor]", *entries)))


def _ranked(tuning: Tuning, factor: float) -> Table:
    """Return the table of the best candidates and of the machine's own, below the baselines."""
    from rich import box
    from rich.table import Table

    from ..base.metrics import reduction_percent, shown_figure
    from ..fitting.tuning import joint_ratio

    table = Table("", box=box.SIMPLE, pad_edge=False)
    names = tuning.logs if len(tuning.logs) <= _LOGS else ()
    for column in ("λ" if field == "lam" else field for field in tuning.fields):
        table.add_column(column, justify="right")
    for name in names:
        table.add_column(name, justify="right", max_width=16)
    table.add_column("reduction", justify="right")
    table.add_column("× hold", justify="right")

    def row(label: str, cells: Sequence[str], rms: Array, ratio: float) -> None:
        errors = [shown_figure(factor * value) for value in rms.tolist()] if names else []
        reduction = reduction_percent(joint_ratio(rms, tuning.rms_hold), tuning.ratio_pb)
        last = ["diverges", ""] if math.isinf(ratio) else [shown_figure(reduction, " %"), f"{ratio:.3f}"]
        table.add_row(label, *cells, *errors, *last)

    empty = [""] * len(tuning.fields)
    row("physics", empty, tuning.rms_pb, tuning.ratio_pb)
    row("hold", empty, tuning.rms_hold, 1.0)
    shown = tuning.ranking[:_ROWS]
    for i in shown if 0 in shown else [*shown, 0]:
        rank = tuning.ranking.index(i) + 1
        cells = [f"{value:g}" for value in tuning.entries(i).values()]
        row(f"{rank}{', as it is' if i == 0 else ''}", cells, tuning.rms_h[i], float(tuning.ratio[i]))
    return table


def _words(tuning: Tuning) -> list[str]:
    """Return how the candidates were ranked, how many are alike, and what was chosen."""
    from ..base.metrics import reduction_percent
    from ..fitting.choice import WORTH

    n, best, margin = len(tuning.candidates), tuning.ranking[0], f"{100 * WORTH:.0f} %"
    if tuning.n_diverged == n:
        return [f"all {n} candidates diverge; try larger lambda or smaller p"]
    lines = []
    if len(tuning.logs) > 1:
        lines.append("ranked by the geometric mean over the logs of RMS relative to hold; reduction is from physics")
    spans = []
    for name in tuning.entries(0):
        alike = [tuning.entries(i)[name] for i in tuning.alike]
        spans.append(f"{name} {min(alike):g}" + (f" … {max(alike):g}" if max(alike) > min(alike) else ""))
    lines.append(f"{len(tuning.alike)} of {n} candidates are within {margin} of the best: {', '.join(spans)}")
    if tuning.n_diverged:
        lines.append(f"{tuning.n_diverged} of {n} diverge")
    gain = reduction_percent(float(tuning.ratio[best]), float(tuning.ratio[0]))
    if tuning.chosen:
        described = ", ".join(f"{name} = {value:g}" for name, value in tuning.entries(best).items())
        lines.append(f"chosen: {described}, {gain:.1f} % better than the machine's own settings")
    else:
        lines.append(
            f"chosen: the machine's own settings; the best is {gain:.1f} % better, less than {margin} may be chance"
        )
    if min(tuning.ratio) >= 1.0:
        lines.append("no candidate is better than holding the last residual")
    return lines


@takes_reading
@takes_known
def fit(
    logs: LogsArgument,
    out: Annotated[
        Path | None, typer.Option(help="Folder for machine file, FMUs and report; named after the log if left out.")
    ] = None,
    Np: Annotated[
        int | None,
        typer.Option("--Np", min=1, help="Samples of the controller's look-ahead; 100 ms if left out."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the axis; the log's, with --axis, if left out.")] = None,
    *,
    known: dict[str, float],
    reading: ReadingOptions,
    list_channels: Annotated[
        bool,
        typer.Option("--list-channels", help="Print what the log holds, with units and rates, and do nothing else."),
    ] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """From the log of an axis to its model, FMUs and a report."""
    from ..logs.log import read_log
    from ..machines.machine import checked_name, machine_name
    from .console import check_outputs, print_channels, written_before

    if list_channels:
        print_channels(logs, as_json=as_json)
        return
    machine = checked_name(name) if name else machine_name(logs[0], reading.axis)
    inputs: dict[str, str | Path | None] = {f"log {path.name}": path for path in logs}
    check_outputs((), inputs)
    found = [read_log(path, **reading.arguments()) for path in logs]
    # What computes takes seconds to import: a log that cannot be read is said before
    from ..fitting.build import fit_files
    from ..fitting.compensation import drive_limits
    from ..fitting.fit import fit as fit_logs
    from ..logs.checks import findings_table
    from .console import console, print_json, progress_bar
    from .logs import different_logs, show

    folder = out or Path(machine)
    files = fit_files(folder, machine, compensator=bool(drive_limits(known)))
    outputs = [("--out", path, ()) for path in files.values()]
    check_outputs(outputs, inputs, force=force, ours=written_before(files["results"], logs))
    used = different_logs(found)
    for log in used:
        show((f"{log.path.name}: {remark}" for remark in log.remarks), ())
    with progress_bar(as_json) as advance:
        given: dict[str, Any] = {"Np": Np, "name": machine, **known}
        result = fit_logs(used, progress=lambda words, done: advance(words, 0.87 * done), **given)
        result.build(folder, progress=lambda words, done: advance(words, 0.87 + 0.13 * done))
    if as_json:
        listed = {log_name: findings_table(one) for log_name, one in result.findings.items()}
        written = {what: str(path) for what, path in files.items()}
        print_json({**result.results(), "advice": result.advice, "findings": listed, "files": written})
        return
    _print_fit(result)
    console.print(f"\n{result.advice}")
    console.print("\n".join(f"{what}: {path}" for what, path in files.items()), soft_wrap=True)
    console.print("\n".join(_next_steps(result, files)), soft_wrap=True, highlight=False)


def _print_fit(found: Fit) -> None:
    """Print what was read and what the checks found, what was identified and how it was judged."""
    import numpy as np

    from ..fitting.advice import extent
    from .console import console, print_judged

    judged, model, settings = found.judged, found.identification, found.machine.predictor_settings
    factor, position = judged.shown.position
    for log in found.logs:
        travel = float(np.ptp(log.x_d))
        stated = "" if log.unit_stated else f", as the file states no unit of positions: taken as {log.unit} (--unit)"
        console.print(f"{log.path.name}: {extent([log])}, travel {factor * travel:.4g} {position}{stated}")
    for name, of_log in found.findings.items():
        for finding in of_log:
            console.print(f"{name}: {finding}")
    console.print(f"{model.structure}, dead time {model.model.dead_time} samples")
    for line in model.findings:
        console.print(f"  {line}")
    window = f"{1e3 * settings.Np * settings.T_s:.4g} ms"
    console.print(f"Np = {settings.Np} ({window}), p = {settings.p}, q = {settings.q}")
    print_judged(judged, "Error on held-out samples", str(judged.replay.verdict()))
    for line in found.tracking.lines(judged.shown) if found.tracking else ():
        console.print(line)


def _next_steps(found: Fit, files: Mapping[str, Path]) -> list[str]:
    """Return what to do after a fit that wrote ``files``, as lines to paste."""
    from ..fmi.archive import other_platforms
    from ..fmi.compile import no_native

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
        unit = found.machine.unit
        rates = f"in {unit}/s, {unit}/s² and {unit}/s³"
        lines.append(f"  # a compensator FMU for the drive; the limits are estimates: put in your drive's, {rates}")
        lines.append(f"  hybridsep {shlex.join(sys.argv[1:])} {' '.join(known)}")
    native = files.get("native FMU")
    if native is None:
        lines += [f"  # no FMUs, {no_native()}; then", f"  hybridsep build -m {file}"]
    elif said := other_platforms(native, files["machine file"], files["trained predictor"]):
        lines += [f"  # {said[0]}", f"  {said[1]}"]
    lines.append("  # your own compensator, sample by sample, in Python: docs/howto/python.md")
    return lines
