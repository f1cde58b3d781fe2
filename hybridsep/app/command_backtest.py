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
    import numpy as np

    from ..evaluate.backtest import Batch, backtest_stream
    from ..evaluate.backtest import backtest as backtest_whole
    from ..evaluate.replayed import replayed_run
    from ..evaluate.scores import Scores
    from ..fmi.warm_start import warm_predictor
    from ..intake.finding import findings_table
    from ..intake.repair import changed_by
    from ..logs.log import Log
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_path
    from ..reports.backtest_peers import backtest_peers
    from ..reports.extent import partly_used
    from ..reports.judged import whole_log_words
    from .log_intake import CHECKED_MAX, open_checked, reading_of
    from .overwrite import BATCH_COLUMNS, BATCHES, FIGURES, RUNS, STATE, Output, check_outputs
    from .progress import progress_bar
    from .tables import console, print_scores, print_without_first, print_written

    if figure is not None:
        from ..evaluate.time_plots import prediction_figure

    axis_machine = load_machine(machine)
    saved = list(save or [])
    changed = axis_machine.changed("predictor", parameters)
    predictor = warm_predictor(changed, weights)
    how = reading_of(axis_machine, reading, may_miss=predictor.settings.trust)
    outputs = [Output("--out", out, BATCHES), Output("--figure", figure, FIGURES)]
    outputs += [Output("--save", path, {".state": STATE, **RUNS}) for path in saved]
    inputs = {"log": log, "machine file": machine_path(machine), "saved predictor": weights}
    opened, intake = open_checked(log, how, axis_machine, fix=fix, as_is=as_is)
    check_outputs(outputs, inputs, force=force)
    shown = shown_of(opened.file_unit, axis_machine.unit)
    n_samples = len(opened.t) if isinstance(opened, Log) else opened.n_samples
    rows: list[tuple[float, ...]] = []
    first: list[Batch] = []
    title = f"{axis_machine.title}, {log.name}{changed_by(intake.findings)}"
    peers = None
    with progress_bar(as_json) as advance:

        def on_batch(batch: Batch) -> None:
            if out is not None:
                rows.append((round(batch.k * opened.T_s, 9), batch.rms_pb, batch.rms_hold, batch.rms_h))
            if batch.j == 0:
                first.append(batch)
            if batch.j % 100 == 0:
                advance("replay", 0.8 * batch.k / n_samples)

        predictions = [path for path in saved if path.suffix.lower() != ".state"]
        if isinstance(opened, Log) or n_samples <= CHECKED_MAX or figure is not None or predictions:
            whole = opened if isinstance(opened, Log) else opened.read()
            found = backtest_whole(predictor, whole.x_d, whole.x_meas, on_batch=on_batch)
            scores: Scores = found
            peers = backtest_peers(
                found, whole.x_d, whole.x_meas, predictor, lambda done: advance("ARX models", 0.8 + 0.2 * done)
            )
            run = replayed_run(
                found,
                whole.x_d,
                whole.x_meas,
                whole.T_s,
                predictor.Np,
                measurement_delay=predictor.settings.measurement_delay,
            )
            for path in predictions:
                run.save(path)
            if figure is not None:
                prediction_figure(run, title, figure, shown)
        else:
            scores = backtest_stream(predictor, opened.chunks(), on_batch=on_batch)
    for path in saved:
        if path.suffix.lower() == ".state":
            predictor.save(path)
    if out is not None:
        with written_text(out) as file:
            csv.writer(file).writerows([BATCH_COLUMNS, *rows])
    if isinstance(opened, Log) and not as_json and (line := partly_used(opened)):
        console.print(line)
    more: dict[str, Any] = {"findings": findings_table(intake.findings)}
    verdict, summary = scores.verdict, dict[str, Any](scores.summary())
    if peers is not None:
        verdict, summary = peers.verdict, {**summary, **peers.summary()}
    elif not as_json:
        console.print(f"ARX models are left out: they take at most {CHECKED_MAX} samples.")
    in_motion = any(finding.name == "start in motion" and not finding.applied for finding in intake.findings)
    rest: dict[str, float] = {}
    if in_motion and scores.n_batches > 1:
        n = int(np.count_nonzero(~np.isnan(first[0].x)))
        without = scores.overall.rms_without(n, (first[0].rms_pb, first[0].rms_hold, first[0].rms_h))
        rest = dict(zip(("pb", "hold", "h"), without, strict=True))
        rest |= peers.rms_from(predictor.Np) if peers is not None else {}
        unit = f"u{axis_machine.unit}"
        more["without_first_window"] = {f"rms_{name}_{unit}": 1e6 * value for name, value in rest.items()}
    print_scores(summary, verdict, as_json, title, unit=axis_machine.unit, shown=shown, more=more)
    if not as_json:
        console.print(whole_log_words(warm=weights is not None))
        if rest:
            print_without_first(rest, shown)
        print_written(out, figure, *saved)
