"""The command line: ``hybridsep demo | build | cosim | backtest``."""

from __future__ import annotations

import csv
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from .. import __version__
from ..base.errors import ParameterError
from ..base.output import written_text
from ..base.settings import check
from ..cosim.compensator_run import SepCoSimulation, cosimulate_sep
from ..cosim.predictor_run import CoSimulation, cosimulate
from ..cosim.wiring import RESULT_SUFFIXES
from ..evaluate.backtest import Batch, backtest_stream
from ..evaluate.plots import prediction_figure
from ..evaluate.sep_plots import tracking_figure
from ..fmi.archive import BACKENDS, build_fmu
from ..fmi.compiler import TARGET_NAMES
from ..logs import open_log
from ..machine import DEFAULT_MACHINE, load_machine, machine_path
from . import failures as _failures
from .arguments import (
    COMPENSATIONS,
    TRAJECTORIES,
    check_ending,
    check_interval,
    check_pair,
    extras_of,
    fitting,
    jobs_of,
    read_command,
)
from .demo import default_backend, demo_files
from .demo import demo as run_demo
from .options import (
    BackendOption,
    ForceOption,
    InitOption,
    JsonOption,
    LamOption,
    MachineOption,
    NpOption,
    POption,
    QOption,
    TsOption,
    UnitOption,
    WeightsOption,
    parameter_help,
)
from .overwrite import BATCH_COLUMNS, BATCHES, BY_ENDING, FIGURE, FMU, RUN, Output, check_outputs
from .sep_demo import build_for_host
from .tables import console, print_compensation, print_json, print_predictions, print_scores, print_tracking

__all__ = ["app", "main"]

app = typer.Typer(
    help="Predict a CNC feed drive's servo error one look-ahead window early, with a linear hybrid model.",
    epilog=f"An error is one line and exit status 2, Ctrl-C 130. {_failures.DEBUG_VARIABLE}=1 in the environment shows "
    "the traceback of an unexpected error.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, figures, results and summary.json.")] = Path("demo"),
    emps: Annotated[Path | None, typer.Option(help="A DATA_EMPS.mat: replay this recorded axis too.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Noise seeds the staircase is averaged over.")] = 10,
    backend: Annotated[
        str | None,
        typer.Option(help=f"Flavour of the FMUs: {', '.join(BACKENDS)}; native where there is a C compiler."),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Build the FMUs, co-simulate the paper's staircase and spiral, draw and score them."""
    backend = backend or default_backend()
    files = demo_files(out, backend, emps=emps is not None)
    check_outputs((Output("--out", path, BY_ENDING[path.suffix]) for path in files), {"recording": emps}, force=force)
    with _progress(as_json) as advance:
        summary = run_demo(out, emps=emps, seeds=seeds, backend=backend, progress=advance)
    if as_json:
        print_json(summary)
        return
    print_predictions(summary)
    print_compensation(summary)
    console.print(f"\nFigures, FMUs, results and summary.json are in {out}")


@app.command()
def build(
    fmus: Annotated[
        list[str] | None, typer.Argument(help="FMUs to build, by name; all of the machines' if left out.")
    ] = None,
    machine: Annotated[
        list[str] | None,
        typer.Option("--machine", "-m", help="Machine file (.toml) or name; may be repeated; all if left out."),
    ] = None,
    backend: BackendOption = BACKENDS[0],
    target: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Platform of a native FMU, may be repeated: {', '.join(TARGET_NAMES)}. If left out: all platforms "
            "where ziglang is installed, this machine (host) otherwise."
        ),
    ] = None,
    weights: WeightsOption = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(help="CSV, .npz or .mat file with the columns t and x_d, for ReferenceTrajectory to play."),
    ] = None,
    unit: UnitOption = "m",
    T_s: TsOption = None,
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = Path("dist"),
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Build FMUs from machine files; the same machine gives the same bytes."""
    jobs = jobs_of(fmus or [], machine or [], backend, target or [])
    extras = extras_of(jobs, weights, trajectory, unit, T_s)
    inputs = {f"machine file {source}": machine_path(source) for source in machine or []}
    check_outputs(
        [Output("--out", out / f"{name}.fmu", FMU) for _, name, _ in jobs],
        {**inputs, "saved predictor": weights, "trajectory": trajectory},
        force=force,
    )
    paths = []
    with _progress(as_json) as advance:
        for i, (axis, name, model) in enumerate(jobs):
            advance(name, i / len(jobs))
            paths.append(build_fmu(axis, name, out, backend, targets=target or None, **extras.get(model, {})))
        advance("done", 1.0)
    if as_json:
        print_json([str(path) for path in paths])
    else:
        for path in paths:
            console.print(f"{path}  {path.stat().st_size / 1024:.0f} KiB", highlight=False)


@app.command()
def cosim(
    machine: MachineOption = DEFAULT_MACHINE,
    trajectory: Annotated[
        str, typer.Option(help=f"{', '.join(TRAJECTORIES)}, or a CSV, .npz or .mat file with the columns t and x_d.")
    ] = "staircase",
    unit: UnitOption = "m",
    T_s: TsOption = None,
    compensate: Annotated[
        str | None,
        typer.Option(
            help=f"Compensate the servo error with the best model given: {', '.join(COMPENSATIONS)}. The drive gets "
            "the command that a SepCompensator FMU has modified; if left out, a HybridPredictor only predicts."
        ),
    ] = None,
    predictor: Annotated[
        Path | None,
        typer.Option(help="Predictor FMU, or with --compensate a compensator FMU; built from the machine if left out."),
    ] = None,
    plant: Annotated[Path | None, typer.Option(help="Plant FMU; built from the machine if left out.")] = None,
    weights: WeightsOption = None,
    seed: Annotated[int | None, typer.Option(help=parameter_help("seed"))] = None,
    Np: NpOption = None,
    p: POption = None,
    q: QOption = None,
    lam: LamOption = None,
    t_init: InitOption = None,
    backend: BackendOption = BACKENDS[0],
    out: Annotated[Path | None, typer.Option(help="File for all signals, .csv or .npz.")] = None,
    figure: Annotated[
        Path | None,
        typer.Option(help="PNG with the errors over time: of the predictions, or with --compensate of the position."),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Co-simulate a predictor FMU, or a compensator FMU, with a plant FMU over a trajectory."""
    axis = load_machine(machine)
    check_ending(out, "--out", RESULT_SUFFIXES)
    check_ending(figure, "--figure", (".png",))
    if compensate is not None and compensate not in COMPENSATIONS:
        raise ParameterError(f"--compensate must be one of {', '.join(COMPENSATIONS)}, got {compensate!r}")
    command = read_command(trajectory, axis, unit, T_s)
    given = {"Np": Np, "p": p, "q": q, "lambda": lam, "t_init": t_init}
    values = {name: value for name, value in given.items() if value is not None}
    if predictor is None:
        values = fitting(axis, compensate, values)
    if seed is not None:
        check("seed", seed)
    model = "HybridPredictor" if compensate is None else "SepCompensator"
    check_pair(axis, model, predictor, plant, weights, backend)
    results = (("--out", out, RUN), ("--figure", figure, FIGURE))
    outputs = [Output(option, path, kind) for option, path, kind in results if path is not None]
    file = None if trajectory in TRAJECTORIES else trajectory
    inputs = {"trajectory": file, "predictor": predictor, "plant": plant, "saved predictor": weights}
    check_outputs(outputs, {"machine file": machine_path(machine), **inputs}, force=force)
    title = f"{' and '.join(path.name for path in (predictor, plant) if path is not None) or axis.title}, {trajectory}"
    with tempfile.TemporaryDirectory() as place, _progress(as_json) as advance:
        folder = Path(place)
        ahead = predictor or build_for_host(axis, model, folder, backend, weights=weights)
        drive = plant or build_for_host(axis, "FeedDrive", folder, backend)
        common: dict[str, Any] = {
            "plant_values": {} if seed is None else {"seed": seed},
            "progress": lambda k, n: advance("co-simulation", k / n),
        }
        run: CoSimulation | SepCoSimulation
        if compensate is None:
            run = cosimulate(ahead, drive, command, predictor_values=values, **common)
        else:
            values["compensate"] = int(COMPENSATIONS[compensate])
            run = cosimulate_sep(ahead, drive, command, compensator_values=values, **common)
    if out is not None:
        run.save(out)
    if isinstance(run, CoSimulation):
        if figure is not None:
            prediction_figure(run, title, figure)
        print_scores(run.summary(), as_json, title)
    else:
        if figure is not None:
            tracking_figure({str(compensate): run}, title, figure)
        print_tracking(run.summary(), as_json, title)


@app.command("backtest")
def backtest_command(
    log: Annotated[Path, typer.Argument(help="CSV with the columns t, x_d, x, or .npz or .mat with named columns.")],
    machine: MachineOption,
    unit: UnitOption = "m",
    T_s: TsOption = None,
    t: Annotated[str | None, typer.Option("--t", help="Name of the time column.")] = None,
    x_d: Annotated[str | None, typer.Option("--x-d", help="Name of the commanded position's column.")] = None,
    x: Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")] = None,
    Np: NpOption = None,
    p: POption = None,
    q: QOption = None,
    lam: LamOption = None,
    t_init: InitOption = None,
    out: Annotated[Path | None, typer.Option(help="CSV for the RMS errors batch by batch.")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Replay a recorded log causally: physics model, hold baseline and hybrid."""
    axis = load_machine(machine)
    given = {"t": t, "x_d": x_d, "x": x}
    names = {role: given[role] or column for role, column in axis.log.model_dump().items()}
    if T_s is not None and t is None:
        del names["t"]  # there may be none
    changes = {"Np": Np, "p": p, "q": q, "lambda": lam, "t_init": t_init}
    given_values = {name: value for name, value in changes.items() if value is not None}
    predictor = axis.changed("predictor", given_values).new_predictor()
    reader = open_log(log, columns=names, unit=unit, T_s=T_s)
    check_interval(log.name, reader.T_s, axis)
    outputs = [] if out is None else [Output("--out", out, BATCHES)]
    check_outputs(outputs, {"log": log, "machine file": machine_path(machine)}, force=force)
    rows: list[tuple[float, ...]] = []
    with _progress(as_json) as advance:

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


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        typer.echo(__version__)
        raise typer.Exit


def main() -> None:
    """Run the command line; an error is one line on stderr and exit status 2, Ctrl-C another and 130."""
    sys.exit(_failures.run(app))


@contextmanager
def _progress(quiet: bool) -> Iterator[Any]:
    """Show a progress bar on stderr; give a function of a message and the fraction done."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    stderr = _failures.errors_console
    with Progress(*columns, console=stderr, transient=True, disable=quiet or not stderr.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda message, fraction: bar.update(task, description=message, completed=fraction)


if __name__ == "__main__":
    main()
