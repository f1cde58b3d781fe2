"""Command ``hybridsep report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .options import (
    PREDICTOR_ENTRIES,
    ForceOption,
    LogArgument,
    MachineOption,
    ReadingOptions,
    SavedOption,
    takes_parameters,
    takes_reading,
)

__all__ = ["report"]


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
    from ..fitting.fit import SAMPLES_MAX, step_times
    from ..fitting.replay import Recording, knew, replay
    from ..fitting.report import write_errors, write_findings, write_use
    from ..fmi.weights import warm_predictor
    from ..logs.units import shown_of
    from ..machines.machine import load_machine, machine_name, machine_path
    from ..predict.predictor import HybridPredictor
    from .console import check_outputs, console, progress_bar
    from .logs import read_checked, reading_of

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
        steps = {}
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
        write_use(written, [fmu.name], steps, whole.T_s, settings.Np)
    written.write(page)
    for line in dict.fromkeys((partly_used(whole), recommendation(judged), words)):
        if line:
            console.print(line)
    console.print(f"report: {page}", soft_wrap=True)
