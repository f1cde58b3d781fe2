"""``hybridsep backtest``."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

import typer

from ..base.output import written_text
from .options import (
    PREDICTOR_ENTRIES,
    AsIsOption,
    FixOption,
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
    fix: FixOption = False,
    as_is: AsIsOption = False,
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
    from ..intake.finding import findings_table
    from ..intake.repair import changed_by
    from ..logs.log import Log
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_path
    from ..predict.predictor import HybridPredictor
    from .log_intake import CHECKED_MAX, open_checked, reading_of
    from .outputs import FIGURES, RUNS, check_outputs
    from .progress import progress_bar
    from .tables import console, print_scores, print_without_first, print_written

    if figure is not None:
        from ..evaluate.figures import prediction_figure

    axis_machine = load_machine(machine)
    saved = list(save or [])
    predictor = warm_predictor(axis_machine.changed("predictor", parameters), weights)
    how = reading_of(axis_machine, reading, may_miss=predictor.settings.trust)
    outputs = [
        ("--out", out, ()),
        ("--figure", figure, FIGURES),
        *(("--save", path, (".state", *RUNS)) for path in saved),
    ]
    inputs = {"log": log, "machine file": machine_path(machine), "saved predictor": weights}
    check_outputs(outputs, inputs, force=force)
    opened, intake = open_checked(log, how, axis_machine, fix=fix, as_is=as_is)
    shown = shown_of(opened.file_unit, axis_machine.unit)
    title = f"{axis_machine.title}, {log.name}{changed_by(intake.findings)}"
    states = [path for path in saved if path.suffix.lower() == ".state"]
    predictions = [path for path in saved if path not in states]
    with progress_bar(as_json) as advance:
        short = isinstance(opened, Log) or opened.n_samples <= CHECKED_MAX
        whole = short or figure is not None or bool(predictions)
        replayed = replay_log(predictor, opened, whole=whole, progress=advance)
        if replayed.run is not None:
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
    if isinstance(opened, Log) and not as_json and (line := partly_used(opened)):
        console.print(line)
    if replayed.judged is None and not as_json:
        console.print(f"ARX models are left out: they take at most {CHECKED_MAX} samples.")
    more: dict[str, Any] = {"findings": findings_table(intake.findings)}
    in_motion = any(finding.name == "start in motion" and not finding.applied for finding in intake.findings)
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
