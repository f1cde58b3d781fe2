"""The command line: ``hybridsep demo | build | cosim | backtest``."""

from __future__ import annotations

import csv
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from . import __version__
from ._tables import console, print_compensation, print_json, print_predictions, print_scores, print_tracking
from ._wiring import RESULT_SUFFIXES
from .backtest import Batch, Scores, backtest_stream
from .compensator import SepState
from .cosim import CoSimulation, cosimulate
from .demo import demo as run_demo
from .errors import HybridSepError, ParameterError
from .fmi.archive import BACKENDS, build_fmu, fmu_names
from .fmi.compiler import TARGET_NAMES
from .logs import open_log
from .machine import DEFAULT_MACHINE, Machine, load_machine, machine_names
from .parameters import PARAMETERS, check
from .plots import prediction_figure
from .sep_cosim import SepCoSimulation, cosimulate_sep
from .sep_demo import build_for_host
from .sep_plots import tracking_figure
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
_err = Console(stderr=True)

COMPENSATIONS = {"none": SepState.OFF, "physics": SepState.PHYSICS, "hybrid": SepState.HYBRID}
"""What ``--compensate`` takes: the best model to use."""

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
    weights: Annotated[
        Path | None,
        typer.Option(
            help="A predictor saved with HybridPredictor.save: the one HybridPredictor or SepCompensator that is built "
            "starts warm; name it where there are more."
        ),
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
        _, model = _one_of(jobs, ("HybridPredictor", "SepCompensator"), "--weights")
        extras[model] = {"weights": weights}
    if trajectory is not None:
        axis, _ = _one_of(jobs, ("ReferenceTrajectory",), "--trajectory")
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
        print_json([str(path) for path in paths])
    else:
        for path in paths:
            console.print(f"{path}  {path.stat().st_size / 1024:.0f} KiB", highlight=False)


@app.command()
def cosim(
    machine: MachineOption = DEFAULT_MACHINE,
    trajectory: Annotated[
        str, typer.Option(help="staircase, spiral_x, spiral_y, or a CSV, .npz or .mat file with the columns t and x_d.")
    ] = "staircase",
    unit: UnitOption = "m",
    Ts: TsOption = None,
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
    weights: Annotated[
        Path | None, typer.Option(help="A predictor saved with HybridPredictor.save: the FMU built here starts warm.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help=_help("seed"))] = None,
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
    as_json: JsonOption = False,
) -> None:
    """Co-simulate a predictor FMU, or a compensator FMU, with a plant FMU over a trajectory."""
    axis = load_machine(machine)
    for path, option, endings in ((out, "--out", RESULT_SUFFIXES), (figure, "--figure", (".png",))):
        if path is not None:
            if path.suffix.lower() not in endings:
                raise ParameterError(f"{option} must end in {' or '.join(endings)}, got {path.name!r}")
            _make_folder(path, option)
    if compensate is not None and compensate not in COMPENSATIONS:
        raise ParameterError(f"--compensate must be one of {', '.join(COMPENSATIONS)}, got {compensate!r}")
    if predictor is not None and weights is not None:
        raise ParameterError("--weights go into an FMU that is built here; leave out --predictor")
    command = _command(trajectory, axis, unit, Ts)
    given = {"Np": Np, "p": p, "q": q, "lambda": lam, "t_init": t_init}
    values = {name: value for name, value in given.items() if value is not None}
    if predictor is None:  # say what is wrong with them before anything is built
        values = _fitting(axis, compensate, values)
    if seed is not None:
        check("seed", seed)
    title = f"{' and '.join(path.name for path in (predictor, plant) if path is not None) or axis.title}, {trajectory}"
    with tempfile.TemporaryDirectory() as folder, _progress(as_json) as advance:
        ahead, drive = _pair(axis, compensate, predictor, plant, Path(folder), backend, weights)
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
    print_scores(scores.summary(), as_json, f"{axis.title}, {log.name}")


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


def _fitting(axis: Machine, compensate: str | None, values: Mapping[str, Any]) -> dict[str, Any]:
    """Check the FMI values of a look-ahead FMU that will be built; return them with what must change with them."""
    changes = {"lam" if name == "lambda" else name: value for name, value in values.items()}
    if compensate is None:
        axis.new_predictor(**changes)
        return dict(values)
    compensator = axis.new_compensator(**changes)
    windows = {"preview": compensator.preview, "spacing": compensator.spacing} if "Np" in values else {}
    return {**values, **windows}


def _pair(
    axis: Machine,
    compensate: str | None,
    predictor: Path | None,
    plant: Path | None,
    folder: Path,
    backend: str,
    weights: Path | None,
) -> tuple[Path, Path]:
    """Return the look-ahead FMU and the plant FMU of a co-simulation; those that are not given are built."""
    models = fmu_names(axis, backend).values()
    if plant is None and "FeedDrive" not in models:
        raise ParameterError(f"machine {axis.name} has no plant; name a plant FMU with --plant")
    model = "HybridPredictor" if compensate is None else "SepCompensator"
    if predictor is None and model not in models:
        raise ParameterError(
            f"machine {axis.name} has no [drive_limits], which a compensator must keep; add them, or name a "
            "compensator FMU with --predictor"
        )
    return (
        predictor or build_for_host(axis, model, folder, backend, weights=weights),
        plant or build_for_host(axis, "FeedDrive", folder, backend),
    )


def _one_of(jobs: Sequence[tuple[Machine, str, str]], models: Sequence[str], option: str) -> tuple[Machine, str]:
    """Return machine and model of the only FMU of these models that is built, which an option is meant for."""
    found = [job for job in jobs if job[2] in models]
    if len(found) != 1:
        names = ", ".join(name for _, name, _ in found) or "none"
        raise ParameterError(
            f"{option} is for one {' or '.join(models)}, this would build {names}; name one, or its --machine"
        )
    return found[0][0], found[0][2]


def _check_interval(name: str, Ts: float, axis: Machine) -> None:
    """Say that a file is sampled at another interval than the machine, if it is."""
    if abs(Ts - axis.T_s) <= 0.01 * axis.T_s:
        return
    hint = "resample the file or correct T_s"
    for factor, unit in ((1e3, "ms"), (1e6, "µs")):
        if abs(Ts / axis.T_s / factor - 1) < 0.01:
            hint = f"is its time in {unit}? It must be in seconds"
    raise ParameterError(f"{name} is sampled every {Ts:g} s, but machine {axis.name} has T_s = {axis.T_s:g} s; {hint}")


def _make_folder(path: Path, option: str = "--out") -> None:
    """Make the folder of a file that will be written, before the work whose result it takes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise ParameterError(f"{option} must be a file, got the folder {path}")


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


if __name__ == "__main__":
    main()
