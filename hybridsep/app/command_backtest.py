"""``hybridsep backtest``."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

import typer

from ..base.output import written_text
from .failures import loading
from .options import ForceOption, JsonOption, MachineOption, TsOption, UnitOption
from .parameter_options import PREDICTOR_ENTRIES, takes_parameters

__all__ = ["backtest"]


@takes_parameters(PREDICTOR_ENTRIES)
def backtest(
    log: Annotated[
        Path, typer.Argument(help="CSV with the columns t, x_d, x_meas or x, or .npz or .mat with named columns.")
    ],
    machine: MachineOption,
    unit: UnitOption = None,
    T_s: TsOption = None,
    t: Annotated[str | None, typer.Option("--t", help="Name of the time column.")] = None,
    x_d: Annotated[str | None, typer.Option("--x-d", help="Name of the commanded position's column.")] = None,
    x: Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")] = None,
    *,
    parameters: dict[str, Any],
    out: Annotated[Path | None, typer.Option(help="CSV for the RMS errors batch by batch.")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Replay a recorded log causally: physics model, hold baseline and hybrid."""
    with loading():
        from ..evaluate.backtest import Batch, backtest_stream
        from ..logs.log import open_log
        from ..machine import load_machine, machine_path
        from .arguments import check_interval
        from .overwrite import BATCH_COLUMNS, BATCHES, Output, check_outputs
        from .progress import progress_bar
        from .tables import print_scores

    axis = load_machine(machine)
    given = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x)) if column}
    names = {**axis.log.given(), **given}
    if T_s is not None and t is None:
        names.pop("t", None)  # there may be none
    predictor = axis.changed("predictor", parameters).new_predictor()
    reader = open_log(log, columns=names, unit=unit, T_s=T_s)
    check_interval(log.name, reader.T_s, axis)
    outputs = [] if out is None else [Output("--out", out, BATCHES)]
    check_outputs(outputs, {"log": log, "machine file": machine_path(machine)}, force=force)
    rows: list[tuple[float, ...]] = []
    with progress_bar(as_json) as advance:

        def on_batch(batch: Batch) -> None:
            if out is not None:
                rows.append((round(batch.k * reader.T_s, 9), batch.rms_pb, batch.rms_hold, batch.rms_h))
            if batch.j % 100 == 0:
                advance("replay", batch.k / reader.n_samples)

        scores = backtest_stream(predictor, reader.chunks(), on_batch=on_batch)
    if out is not None:
        with written_text(out) as file:
            csv.writer(file).writerows([BATCH_COLUMNS, *rows])
    print_scores(scores.summary(), as_json, f"{axis.title}, {log.name}")
