"""``backtest``, which replays a log; how a log is read as a machine's, checked, and shown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..base.errors import LogError
from . import options

if TYPE_CHECKING:
    from ..logs.checks import Finding
    from ..logs.log import Log
    from ..machines.machine import Machine


@options.takes_reading
def backtest(
    log: Annotated[
        Path,
        typer.Argument(
            help="Recorded log with the columns t, x_d, x_meas or x, in a format of docs/reference/logs.md: "
            "CSV, .mat, …"
        ),
    ],
    machine: options.MachineOption,
    entries: options.SetOption = None,
    weights: Annotated[
        Path | None,
        typer.Option(help="A predictor saved with hybridsep backtest --save, to begin with what it learned."),
    ] = None,
    *,
    reading: options.ReadingOptions,
    report: Annotated[Path | None, typer.Option(help="HTML file about the replay, which needs no network.")] = None,
    figure: Annotated[Path | None, typer.Option(help="PNG, PDF or SVG with the prediction errors over time.")] = None,
    save: Annotated[
        list[Path] | None,
        typer.Option(
            help="File for what was learned (.state, for --weights here, of build and of cosim), or for the "
            "predictions sample by sample (.csv, .npz); may be given for each."
        ),
    ] = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Check a recorded log and replay it causally.

    Physics model, hold baseline, ARX models and hybrid are compared.
    """
    from ..base.metrics import in_unit
    from ..evaluate.backtest import replayed_run
    from ..fitting.advice import Judged, advice_on, extent, settling_words, whole_log_words
    from ..fitting.replay import knew, replay, split_log
    from ..fmi.weights import warm_predictor
    from ..logs.checks import findings_table
    from ..logs.controller import controller_of
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_path
    from ..predict.predictor import HybridPredictor
    from .console import FIGURES, RUNS, check_outputs, console, print_json, print_judged, print_written, progress_bar

    if figure is not None:
        from ..evaluate.figures import prediction_figure
    if report is not None:
        from ..fitting.sections import begun_report, write_findings

    axis = load_machine(machine, entries or ())
    saved = list(save or [])
    predictor = warm_predictor(axis, weights)
    outputs = [
        ("--report", report, (".html",)),
        ("--figure", figure, FIGURES),
        *(("--save", path, (".state", *RUNS)) for path in saved),
    ]
    inputs = {"log": log, "machine file": machine_path(machine), "saved predictor": weights}
    check_outputs(outputs, inputs, force=force)
    read, findings = read_checked(log, reading, axis)
    shown = shown_of(read.file_unit, axis.unit)
    title = f"{axis.title}, {log.name}"
    with progress_bar(as_json) as advance:
        recordings = split_log([(one.x_d, one.x_meas) for one in read.segments()], 0.0, predictor.Np)
        replayed = replay(predictor, recordings, lambda done: advance("replay", 0.8 * done))
        replayed = replayed.with_peers(lambda done: advance("ARX models", 0.8 + 0.2 * done))
    known = weights is not None and knew(HybridPredictor.load(weights), predictor)
    warm, controller = weights is not None, controller_of([read])
    scores, words = replayed.backtest, whole_log_words(warm=warm, known=known)
    words += "" if known else settling_words(replayed)
    judged = Judged(replayed, read.T_s, shown, "the whole log", known=known, warm=warm, controller=controller)
    settings = predictor.settings
    run = replayed_run(*(scores, read.x_d, read.x_meas, read.T_s, settings.Np), measurement_delay=settings.n_late)
    for path in saved:
        (predictor if path.suffix.lower() == ".state" else run).save(path)
    if figure is not None:
        prediction_figure(run, title, figure, shown)
    if report is not None:
        page = begun_report(title, [read], judged, "Errors of the replay", words)
        write_findings(page, [read], {log.name: findings})
        page.write(report)
    own, found = scores.verdict, replayed.verdict()
    verdict = str(replace(found, n_rejected=own.n_rejected, n_missing=own.n_missing, n_samples=own.n_samples))
    if as_json:
        figures = in_unit(scores.summary(), axis.unit)
        more = {"findings": findings_table(findings), "advice": advice_on(judged), "controller": judged.controller}
        print_json({**figures, "judged": replayed.figures(), "verdict": verdict, **more})
        return
    console.print(f"{log.name}: {extent([read])}")
    print_judged(judged, f"{title}: prediction error against the measured position", verdict)
    for line in dict.fromkeys((words, advice_on(judged))):
        console.print(line)
    print_written(report, figure, *saved)


def read_checked(path: Path, reading: options.ReadingOptions, machine: Machine) -> tuple[Log, tuple[Finding, ...]]:
    """Read a log of a machine and check it; what was found is shown.

    LogError if the log cannot be read, its columns mean something else, or a measurement misses without averaging;
    ParameterError if it is sampled otherwise than the machine, or in another unit.
    """
    import numpy as np

    from ..base.signals import check_interval
    from ..logs.checks import checked
    from ..logs.log import read_log, whole_turns
    from ..machines.machine import check_unit

    log = read_log(path, **reading.arguments(machine))
    check_unit(path.name, log, machine)
    log = replace(log, unit=machine.unit)
    if log.unit == "rad":  # where the file states none
        log, said = whole_turns(log)
        log = replace(log, remarks=(*log.remarks, *([said] if said else [])))
    check_interval(path.name, log.T_s, f"machine {machine.name}", machine.T_s)
    if not machine.predictor_settings.averaging and np.isnan(log.x_meas).any():
        first = int(np.argmax(np.isnan(log.x_meas)))
        raise LogError(
            f"{path}: measured position {first + 1} is missing; it is replayed with averaging only "
            "(--set predictor.averaging=true)"
        )
    findings = checked(log)
    show(log.remarks, findings)
    return log, findings


def different_logs(logs: Sequence[Log]) -> list[Log]:
    """Return the logs, leaving out and reporting each that has the samples of an earlier one."""
    kept: dict[tuple[bytes, bytes], Log] = {}
    for log in logs:
        first = kept.setdefault((log.x_d.tobytes(), log.x_meas.tobytes()), log)
        if first is not log:
            show([f"{log.path} has the samples of {first.path}: it counts once"], ())
    return list(kept.values())


def show(remarks: Iterable[str], findings: Iterable[Finding]) -> None:
    """Print remarks and findings on standard error."""
    from .console import errors_console

    for line in [f"note: {remark}" for remark in remarks] + [str(finding) for finding in findings]:
        errors_console.print(line, soft_wrap=True)
