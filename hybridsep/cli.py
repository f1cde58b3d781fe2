"""The command line: ``hybridsep demo | build | cosim | backtest``."""

from __future__ import annotations

import csv
import json
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from . import __version__
from .backtest import Batch, Scores, backtest_stream
from .cosim import cosimulate
from .demo import PRINTED
from .demo import demo as run_demo
from .errors import HybridSepError, ParameterError
from .fmi.archive import BACKENDS, build_fmu, fmu_names
from .fmi.compiler import TARGET_NAMES
from .logs import open_log
from .machine import DEFAULT_MACHINE, Machine, load_machine, machine_names
from .parameters import PARAMETERS, check
from .signals import Array
from .trajectory import PAPER_LIMITS, from_file, spiral, staircase

__all__ = ["app", "main"]

app = typer.Typer(
    help="Predict a CNC feed drive's servo error one look-ahead window early, with a linear hybrid model.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
_out, _err = Console(), Console(stderr=True)

PAPER_COLUMN = "paper: physics → hybrid, reduction, as printed there"

JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
MachineOption = Annotated[
    str, typer.Option("--machine", "-m", help="Machine file (.toml), or the name of one that comes with the library.")
]
BackendOption = Annotated[str, typer.Option(help=f"Flavour of the FMUs: {', '.join(BACKENDS)}.")]
TsOption = Annotated[
    float | None, typer.Option("--Ts", help="Sampling interval [s], for a file without a time column.")
]
UnitOption = Annotated[str, typer.Option(help="Unit of the positions in the file: m, mm or um.")]


def _help(name: str) -> str:
    return PARAMETERS[name].help + "; the machine's own if left out"


NpOption = Annotated[int | None, typer.Option("--Np", help=_help("Np"))]
POption = Annotated[int | None, typer.Option("--p", help=_help("p"))]
QOption = Annotated[int | None, typer.Option("--q", help=_help("q"))]
LamOption = Annotated[float | None, typer.Option("--lam", help=_help("lambda"))]
InitOption = Annotated[float | None, typer.Option("--t-init", help=_help("t_init"))]


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, figures, results and summary.json.")] = Path("demo"),
    emps: Annotated[Path | None, typer.Option(help="A DATA_EMPS.mat: replay this recorded axis too.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Noise seeds the staircase is averaged over.")] = 10,
    backend: Annotated[
        str | None,
        typer.Option(help=f"Flavour of the FMUs: {', '.join(BACKENDS)}; native where there is a C compiler."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Build the FMUs, co-simulate the paper's staircase and spiral, draw and score them."""
    with _progress(as_json) as advance:
        summary = run_demo(out, emps=emps, seeds=seeds, backend=backend, progress=advance)
    if as_json:
        _print_json(summary)
        return
    table = Table(
        title="Prediction error, RMS in µm against the measured position",
        caption=PAPER_COLUMN,
        box=box.SIMPLE,
        pad_edge=False,
    )
    for column in ("case", "physics", "hold", "hybrid", "reduction", "paper"):
        table.add_column(column, justify="left" if column == "case" else "right", no_wrap=True)
    for name, case in summary.items():
        table.add_row(name, *_figures(case), _printed(PRINTED[name]))
        for part in ("friction_alone", "stiffness_alone"):
            if part in case:
                table.add_row(f"  {part.replace('_', ' ')}", *_figures(case[part]))
    _out.print(table)
    _out.print(
        "The stage is tuned to the printed figures (see its machine file): there, their agreement is no evidence."
    )
    for name, case in summary.items():
        n, worse = case["n_batches"], case["batches_hybrid_worse"]
        text = f"{name}: of {n} batches the hybrid is worse than physics in {len(worse)}"
        times = ", ".join(f"{batch['t_s']:g}" for batch in worse)
        _out.print(
            f"{text}{f' (from {times} s on)' if worse else ''}, worse than hold in {case['n_batches_worse_than_hold']}",
            highlight=False,
        )
    _out.print(f"\nFigures, FMUs, results and summary.json are in {out}")


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
    weights: Annotated[
        Path | None,
        typer.Option(help="A predictor saved with HybridPredictor.save: its machine's HybridPredictor starts warm."),
    ] = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(help="CSV, .npz or .mat file with the columns t and x_d, for ReferenceTrajectory to play."),
    ] = None,
    unit: UnitOption = "m",
    Ts: TsOption = None,
    out: Annotated[Path, typer.Option(help="Folder for the archives.")] = Path("dist"),
    as_json: JsonOption = False,
) -> None:
    """Build FMUs from machine files; the same machine gives the same bytes."""
    wanted = list(fmus or [])
    jobs = []
    for source in machine or machine_names():
        axis = load_machine(source)
        jobs += [(axis, name, model) for name, model in fmu_names(axis, backend).items()]
    if unknown := sorted(set(wanted) - {name for _, name, _ in jobs}):
        raise ParameterError(f"no FMU {', '.join(unknown)}; there are {', '.join(name for _, name, _ in jobs)}")
    jobs = [job for job in jobs if not wanted or job[1] in wanted]
    if target and backend != "native":
        raise ParameterError(f"--target is for native FMUs; with --backend {backend} leave it out")
    extras: dict[str, dict[str, Any]] = {}
    if weights is not None:
        _one_of(jobs, "HybridPredictor", "--weights")
        extras["HybridPredictor"] = {"weights": weights}
    if trajectory is not None:
        axis = _one_of(jobs, "ReferenceTrajectory", "--trajectory")
        samples, found = from_file(trajectory, unit=unit, Ts=Ts)
        _check_interval(trajectory.name, found, axis)
        extras["ReferenceTrajectory"] = {"samples": samples}
    paths = []
    with _progress(as_json) as advance:
        for i, (axis, name, model) in enumerate(jobs):
            advance(name, i / len(jobs))
            paths.append(build_fmu(axis, name, out, backend, targets=target or None, **extras.get(model, {})))
        advance("done", 1.0)
    if as_json:
        _print_json([str(path) for path in paths])
    else:
        for path in paths:
            _out.print(f"{path}  {path.stat().st_size / 1024:.0f} KiB", highlight=False)


@app.command()
def cosim(
    machine: MachineOption = DEFAULT_MACHINE,
    trajectory: Annotated[
        str, typer.Option(help="staircase, spiral_x, spiral_y, or a CSV, .npz or .mat file with the columns t and x_d.")
    ] = "staircase",
    unit: UnitOption = "m",
    Ts: TsOption = None,
    predictor: Annotated[Path | None, typer.Option(help="Predictor FMU; built from the machine if left out.")] = None,
    plant: Annotated[Path | None, typer.Option(help="Plant FMU; built from the machine if left out.")] = None,
    seed: Annotated[int | None, typer.Option(help=_help("seed"))] = None,
    Np: NpOption = None,
    p: POption = None,
    q: QOption = None,
    lam: LamOption = None,
    t_init: InitOption = None,
    backend: BackendOption = BACKENDS[0],
    out: Annotated[Path | None, typer.Option(help="File for all signals, .csv or .npz.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Co-simulate a predictor FMU with a plant FMU over a trajectory."""
    axis = load_machine(machine)
    if out is not None:
        if out.suffix.lower() not in (".csv", ".npz"):
            raise ParameterError(f"--out must end in .csv or .npz, got {out.name!r}")
        _make_folder(out)
    command = _command(trajectory, axis, unit, Ts)
    values = {"Np": Np, "p": p, "q": q, "lambda": lam, "t_init": t_init}
    if predictor is None:  # say what is wrong with them before anything is built
        axis.new_predictor(**{"lam" if name == "lambda" else name: v for name, v in values.items() if v is not None})
    if seed is not None:
        check("seed", seed)
    with tempfile.TemporaryDirectory() as folder, _progress(as_json) as advance:
        names = {model: name for name, model in fmu_names(axis, backend).items()}
        if plant is None and "FeedDrive" not in names:
            raise ParameterError(f"machine {axis.name} has no plant; name a plant FMU with --plant")
        run = cosimulate(
            predictor or build_fmu(axis, names["HybridPredictor"], folder, backend, targets=("host",)),
            plant or build_fmu(axis, names["FeedDrive"], folder, backend, targets=("host",)),
            command,
            predictor_values={name: value for name, value in values.items() if value is not None},
            plant_values={} if seed is None else {"seed": seed},
            progress=lambda k, n: advance("co-simulation", k / n),
        )
    if out is not None:
        run.save(out)
    fmus = [path.name for path in (predictor, plant) if path is not None]
    _print_scores(run.summary(), as_json, f"{' and '.join(fmus) or axis.title}, {trajectory}")


@app.command("backtest")
def backtest_command(
    log: Annotated[Path, typer.Argument(help="CSV with the columns t, x_d, x, or .npz or .mat with named columns.")],
    machine: MachineOption,
    unit: UnitOption = "m",
    Ts: TsOption = None,
    t: Annotated[str | None, typer.Option("--t", help="Name of the time column.")] = None,
    x_d: Annotated[str | None, typer.Option("--x-d", help="Name of the commanded position's column.")] = None,
    x: Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")] = None,
    Np: NpOption = None,
    p: POption = None,
    q: QOption = None,
    lam: LamOption = None,
    t_init: InitOption = None,
    out: Annotated[Path | None, typer.Option(help="CSV for the RMS errors batch by batch.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Replay a recorded log causally: physics model, hold baseline and hybrid."""
    axis = load_machine(machine)
    given = {"t": t, "x_d": x_d, "x": x}
    names = {role: given[role] or column for role, column in axis.log.model_dump().items()}
    if Ts is not None and t is None:
        del names["t"]  # there may be none
    if out is not None:
        _make_folder(out)
    reader = open_log(log, columns=names, unit=unit, Ts=Ts)
    _check_interval(log.name, reader.Ts, axis)
    changes = {"Np": Np, "p": p, "q": q, "lam": lam, "t_init": t_init}
    predictor = axis.new_predictor(**{name: value for name, value in changes.items() if value is not None})
    with _progress(as_json) as advance, _batch_writer(out, reader.Ts) as write:

        def on_batch(batch: Batch) -> None:
            write(batch)
            if batch.j % 100 == 0:
                advance("replay", batch.k / reader.n_samples)

        scores: Scores = backtest_stream(predictor, reader.chunks(), on_batch=on_batch)
    _print_scores(scores.summary(), as_json, f"{axis.title}, {log.name}")


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        typer.echo(__version__)
        raise typer.Exit


def main() -> None:
    """Run the command line; an error of ours is one line on stderr and exit status 2."""
    try:
        app()
    except HybridSepError as error:
        _fail(f"{type(error).__name__}: {error}")
    except OSError as error:
        _fail(f"cannot read or write {error.filename}: {error.strerror}")


def _fail(message: str) -> None:
    _err.print("[bold red]error:[/] ", end="")
    _err.print(message, markup=False, highlight=False, soft_wrap=True)
    sys.exit(2)


def _command(trajectory: str, axis: Machine, unit: str, Ts: float | None) -> Array:
    """Return the samples of a named trajectory or of a file, at the machine's sampling interval."""
    limits = PAPER_LIMITS if axis.limits is None else axis.trajectory_limits()
    if trajectory == "staircase":
        return staircase(axis.T_s, limits=limits)
    if trajectory in ("spiral_x", "spiral_y"):
        return spiral(axis.T_s, limits=limits)[trajectory == "spiral_y"]
    command, found = from_file(trajectory, unit=unit, Ts=Ts)
    _check_interval(trajectory, found, axis)
    return command


def _one_of(jobs: Sequence[tuple[Machine, str, str]], model: str, option: str) -> Machine:
    """Return the machine of the only FMU of a model that is built, which an option is meant for."""
    found = [(axis, name) for axis, name, built in jobs if built == model]
    if len(found) != 1:
        names = ", ".join(name for _, name in found) or "none"
        raise ParameterError(f"{option} is for one {model}, this would build {names}; name one, or its --machine")
    return found[0][0]


def _check_interval(name: str, Ts: float, axis: Machine) -> None:
    """Say that a file is sampled at another interval than the machine, if it is."""
    if abs(Ts - axis.T_s) <= 0.01 * axis.T_s:
        return
    hint = "resample the file or correct T_s"
    for factor, unit in ((1e3, "ms"), (1e6, "µs")):
        if abs(Ts / axis.T_s / factor - 1) < 0.01:
            hint = f"is its time in {unit}? It must be in seconds"
    raise ParameterError(f"{name} is sampled every {Ts:g} s, but machine {axis.name} has T_s = {axis.T_s:g} s; {hint}")


def _make_folder(path: Path) -> None:
    """Make the folder of a file that will be written, before the work whose result it takes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise ParameterError(f"--out must be a file, got the folder {path}")


@contextmanager
def _progress(quiet: bool) -> Iterator[Any]:
    """Show a progress bar on stderr; give a function of a message and the fraction done."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=_err, transient=True, disable=quiet or not _err.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda message, fraction: bar.update(task, description=message, completed=fraction)


@contextmanager
def _batch_writer(path: Path | None, Ts: float) -> Iterator[Any]:
    """Give a function that writes one batch to a CSV, or does nothing without a path."""
    if path is None:
        yield lambda batch: None
        return
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["t", "rms_pb", "rms_hold", "rms_h"])
        yield lambda batch: writer.writerow([round(batch.k * Ts, 9), batch.rms_pb, batch.rms_hold, batch.rms_h])


def _figures(case: Mapping[str, Any]) -> list[str]:
    """Return physics, hold, hybrid and reduction of a case as text, a dash where there is no figure."""
    figures = [_figure(case.get(name)) for name in ("rms_pb_um", "rms_hold_um", "rms_h_um")]
    return [*figures, _figure(case.get("reduction_percent"), " %")]


def _printed(case: Mapping[str, float]) -> str:
    """Return what the paper prints of a case."""
    if not case:
        return ""
    physics, hybrid = (f"{case[name]:g}" if name in case else "–" for name in ("rms_pb_um", "rms_h_um"))
    return f"{physics}→{hybrid}, {case['reduction_percent']:g} %"


def _figure(value: float | None, unit: str = "") -> str:
    if value is None or not np.isfinite(value):
        return "–"
    return f"{value:.1f}{unit}" if unit else f"{value:.2f}"


def _print_scores(summary: Mapping[str, float | int], as_json: bool, title: str) -> None:
    if as_json:
        _print_json(summary)
        return
    table = Table(title=f"{title}: prediction error in µm against the measured position")
    for column in ("", "physics", "hold", "hybrid", "reduction"):
        table.add_column(column, justify="right")
    for suffix, label in (("", ""), ("_after_warm_up", " after warm-up")):
        for quantity in ("rms", "max"):
            figures = [summary.get(f"{quantity}_{name}_um{suffix}") for name in ("pb", "hold", "h")]
            if all(figure is not None for figure in figures):
                reduction = summary[f"reduction_percent{suffix}"] if quantity == "rms" else None
                shown = _figure(reduction, " %") if quantity == "rms" else ""
                label_text = f"{quantity.upper() if quantity == 'rms' else quantity}{label}"
                table.add_row(label_text, *map(_figure, figures), shown)
    _out.print(table)


def _print_json(result: Any) -> None:
    """Print JSON; figures that do not exist, such as scores over no sample, are null."""
    typer.echo(json.dumps(_finite(result), indent=2))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


if __name__ == "__main__":
    main()
