"""``hybridsep backtest``."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

import typer

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

__all__ = ["backtest"]


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
    from .logs import read_checked, reading_of

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
