"""Commands that replay a log: ``backtest`` and ``report``; how a log is read as a machine's, checked, and shown."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import LogError
from ..base.files import written_text
from .options import (
    PREDICTOR_ENTRIES,
    ForceOption,
    JsonOption,
    LogArgument,
    MachineOption,
    ReadingOptions,
    SavedOption,
    takes_parameters,
    takes_reading,
)

if TYPE_CHECKING:
    from ..logs.checks import Finding
    from ..logs.log import Log
    from ..machines.machine import Machine

__all__ = ["backtest", "different_logs", "read_checked", "reading_of", "report", "show"]


@takes_reading
@takes_parameters(PREDICTOR_ENTRIES)
def backtest(
    log: LogArgument,
    machine: MachineOption,
    weights: SavedOption = None,
    *,
    reading: ReadingOptions,
    parameters: dict[str, Any],
    out: Annotated[Path | None, typer.Option(help="CSV for the RMS errors batch by batch.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG, PDF or SVG with the errors of the predictions over time.")
    ] = None,
    save: Annotated[
        list[Path] | None,
        typer.Option(
            help="File for what was learned (.state, for --weights here, of build and of cosim), or for the "
            "predictions sample by sample (.csv, .npz); may be given for each."
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Check a recorded log and replay it causally.

    Physics model, hold baseline, ARX models and hybrid are compared.
    """
    from ..fitting.advice import partly_used, whole_log_words
    from ..fitting.replay import knew, replay_log
    from ..fmi.weights import warm_predictor
    from ..logs.checks import findings_table
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_path
    from ..predict.predictor import HybridPredictor
    from .console import (
        FIGURES,
        RUNS,
        check_outputs,
        console,
        print_scores,
        print_without_first,
        print_written,
        progress_bar,
    )

    if figure is not None:
        from ..evaluate.figures import prediction_figure

    axis_machine = load_machine(machine)
    saved = list(save or [])
    predictor = warm_predictor(axis_machine.changed("predictor", parameters), weights)
    how = reading_of(axis_machine, reading)
    outputs = [
        ("--out", out, ()),
        ("--figure", figure, FIGURES),
        *(("--save", path, (".state", *RUNS)) for path in saved),
    ]
    inputs = {"log": log, "machine file": machine_path(machine), "saved predictor": weights}
    check_outputs(outputs, inputs, force=force)
    read, findings = read_checked(log, how, axis_machine, may_miss=predictor.settings.averaging)
    shown = shown_of(read.file_unit, axis_machine.unit)
    title = f"{axis_machine.title}, {log.name}"
    states = [path for path in saved if path.suffix.lower() == ".state"]
    predictions = [path for path in saved if path not in states]
    with progress_bar(as_json) as advance:
        replayed = replay_log(predictor, read, advance)
        for path in predictions:
            replayed.run.save(path)
        if figure is not None:
            prediction_figure(replayed.run, title, figure, shown)
    known = weights is not None and knew(HybridPredictor.load(weights), predictor)
    for path in states:
        predictor.save(path)
    if out is not None:
        with written_text(out) as file:
            csv.writer(file).writerows([("t", "rms_pb", "rms_hold", "rms_h"), *replayed.batches])
    if not as_json and (line := partly_used(read)):
        console.print(line)
    more: dict[str, Any] = {"findings": findings_table(findings)}
    in_motion = any(finding.name == "start in motion" for finding in findings)
    rest = replayed.without_first_window() if in_motion else {}
    if rest:
        unit = f"u{axis_machine.unit}"
        more["without_first_window"] = {f"rms_{name}_{unit}": 1e6 * value for name, value in rest.items()}
    summary: dict[str, Any] = replayed.summary()
    print_scores(summary, replayed.verdict, as_json, title, unit=axis_machine.unit, shown=shown, more=more)
    if not as_json:
        console.print(whole_log_words(warm=weights is not None, known=known))
        if rest:
            print_without_first(rest, shown)
        print_written(out, figure, *saved)


@takes_reading
@takes_parameters(PREDICTOR_ENTRIES)
def report(
    log: LogArgument,
    machine: MachineOption,
    out: Annotated[Path | None, typer.Option(help="The HTML file; named after the log if left out.")] = None,
    fmu: Annotated[Path | None, typer.Option(help="A HybridPredictor whose steps are timed with the log.")] = None,
    weights: SavedOption = None,
    *,
    reading: ReadingOptions,
    parameters: dict[str, Any],
    force: ForceOption = False,
) -> None:
    """Replay a recorded log and write an HTML report about it.

    It is checked and replayed as by backtest. The file needs no network.
    """
    from ..cosim.adapters import check_controller
    from ..cosim.run import PREDICTOR
    from ..evaluate.report import Report
    from ..fitting.advice import Judged, extent, partly_used, recommendation, whole_log_words
    from ..fitting.build import SAMPLES_MAX, step_times
    from ..fitting.replay import Recording, knew, replay
    from ..fitting.report import write_errors, write_findings, write_use
    from ..fmi.weights import warm_predictor
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_name, machine_path
    from ..predict.predictor import HybridPredictor
    from .console import check_outputs, console, progress_bar

    page = out or Path(f"{machine_name(log)}_report.html")
    outputs = [("--out", page, (".html",))]
    inputs = {"log": log, "machine file": machine_path(machine), "saved predictor": weights, "FMU": fmu}
    check_outputs(outputs, inputs, force=force)
    if fmu is not None:
        check_controller(fmu, PREDICTOR)
    axis_machine = load_machine(machine)
    changed = axis_machine.changed("predictor", parameters)
    predictor = warm_predictor(changed, weights)
    how = reading_of(axis_machine, reading)
    whole, findings = read_checked(log, how, axis_machine, may_miss=predictor.settings.averaging)
    with progress_bar(False) as advance:
        recordings = [Recording(one.x_d, one.x_meas, 0) for one in whole.segments()]
        replayed = replay(predictor, recordings, progress=lambda done: advance("replay", 0.8 * done))
        replayed = replayed.with_peers(lambda done: advance("peers", 0.8 + 0.1 * done))
        advance("time the FMU's steps", 0.95)
        steps = None
        if fmu is not None:
            steps = step_times(fmu, whole.x_d[:SAMPLES_MAX], whole.x_meas[:SAMPLES_MAX])
    known = weights is not None and knew(HybridPredictor.load(weights), predictor)
    shown = shown_of(whole.file_unit, axis_machine.unit)
    judged = Judged(replayed, whole.T_s, shown, "the whole log", known=known)
    settings = predictor.settings
    written = Report(
        f"{axis_machine.title}: {log.name}",
        f"{extent([whole])} · look-ahead {settings.Np} samples, "
        f"{1e3 * settings.Np * whole.T_s:.4g} ms · p = {settings.p}, q = {settings.q}",
    )
    written.paragraph(recommendation(judged), "verdict")
    words = whole_log_words(warm=weights is not None, known=known)
    write_errors(written, judged, "Errors of the replay", words)
    write_findings(written, [whole], {log.name: findings})
    if fmu is not None:
        write_use(written, fmu.name, steps, whole.T_s, settings.Np)
    written.write(page)
    for line in dict.fromkeys((partly_used(whole), recommendation(judged), words)):
        if line:
            console.print(line)
    console.print(f"report: {page}", soft_wrap=True)


def reading_of(machine: Machine, options: ReadingOptions) -> dict[str, Any]:
    """Return how a log of a machine is read: as its machine file says, where an option does not say otherwise."""
    own = machine.log
    names = {**own.columns, **options.columns}
    if options.T_s is not None and options.t is None:
        names.pop("t", None)  # there may be none
    given = options.arguments
    return {**given, "columns": names, "unit": options.unit or own.unit, "axis": options.axis or own.axis}


def read_checked(
    path: Path, reading: Mapping[str, Any], machine: Machine, *, may_miss: bool
) -> tuple[Log, tuple[Finding, ...]]:
    """Read a log of a machine and check it; what was found is shown.

    Parameters
    ----------
    path : Path
    reading : mapping
        How it is read.
    machine : Machine
        Whose log it is.
    may_miss : bool
        Whether measured positions may be missing.

    Raises
    ------
    LogError
        If the log cannot be read, its columns mean something else, or a measurement misses.
    ParameterError
        If it is sampled otherwise than the machine, or in another unit.
    """
    import numpy as np

    from ..logs.checks import checked
    from ..logs.log import read_log
    from ..logs.remedies import Samples, whole_turns
    from ..machines.machine import check_interval, check_unit

    log = read_log(path, **reading)
    check_unit(path.name, log, machine)
    log = replace(log, unit=machine.unit)
    if log.unit == "rad":  # where the file states none
        turned, said = whole_turns(Samples(log.t, log.x_d, log.x_meas, log.T_s, log.starts))
        log = replace(log, x_d=turned.x_d, x_meas=turned.x_meas, remarks=(*log.remarks, *([said] if said else [])))
    check_interval(path.name, log.T_s, machine)
    if not may_miss and np.isnan(log.x_meas).any():
        first = int(np.argmax(np.isnan(log.x_meas)))
        raise LogError(
            f"{path}: measured position {first + 1} is missing; it is replayed with averaging alone (--averaging true)"
        )
    findings = checked(log)
    show(log.remarks, findings)
    return log, findings


def different_logs(logs: Sequence[Log]) -> list[Log]:
    """Return the logs, leaving out and reporting each that has the samples of an earlier one."""
    import numpy as np

    kept: list[Log] = []
    for log in logs:
        same = [
            one
            for one in kept
            if np.array_equal(one.x_d, log.x_d) and np.array_equal(one.x_meas, log.x_meas, equal_nan=True)
        ]
        if same:
            show([f"{log.path} has the samples of {same[0].path}: it counts once"], ())
        else:
            kept.append(log)
    return kept


def show(remarks: Iterable[str], findings: Iterable[Finding]) -> None:
    """Print remarks and findings on standard error."""
    from .console import errors_console

    for line in [f"note: {remark}" for remark in remarks] + [str(finding) for finding in findings]:
        errors_console.print(line, soft_wrap=True)
