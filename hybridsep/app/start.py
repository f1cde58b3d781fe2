"""Commands to begin with: the demonstration, an example log, and a machine file to edit."""

from pathlib import Path
from typing import Annotated, Any

import typer

from . import options


def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, figures, results and summary.json.")] = Path("demo"),
    full: Annotated[
        bool,
        typer.Option("--full", help="Ten noise seeds on the staircase, and the spiral's axes too; about a minute."),
    ] = False,
    force: options.ForceOption = False,
) -> None:
    """Co-simulate the paper's staircase, draw and score it.

    Its FMUs are built first; index.html in the folder shows what came out.
    """
    from ..demo.cases import demo as run_demo
    from ..demo.cases import demo_files
    from .console import check_outputs, console, progress_bar
    from .logs import show

    check_outputs((("--out", path, ()) for path in demo_files(out, full=full)), {}, force=force)
    show([f"this takes about {'a minute' if full else '10 seconds'} of processor time"], ())
    with progress_bar(False) as advance:
        summary = run_demo(out, full=full, progress=advance)
    print_figures(summary)
    rest = "" if full else f"; ten noise seeds and the spiral: hybridsep demo --full --out {out}"
    console.print(f"\nPictures, tables, FMUs: {out / 'index.html'}{rest}", soft_wrap=True)


def print_figures(summary: dict[str, dict[str, Any]]) -> None:
    """Print the tracking errors of the demo's compensated runs, then its prediction errors, within 80 columns."""
    from ..demo.cases import compensation_table, prediction_table
    from .console import console, print_rows

    for found in (compensation_table(summary), prediction_table(summary)):
        head, narrow = ("case", *found.columns), {"collapse_padding": True, "show_edge": False}
        print_rows(f"\n{found.title}", head, found.rows, whole_names=True, caption=found.note, **narrow)
    for name, case in summary.items():
        console.print(f"{name}: {case['verdict']}")


def example_log(
    out: Annotated[Path, typer.Option(help="File for the log, .csv or .csv.gz.")] = Path("example_axis.csv"),
    force: options.ForceOption = False,
) -> None:
    """Write the example log that comes with the library.

    20 s of a simulated axis at 1 kHz, in mm.
    """
    from ..logs.formats import write_example
    from .console import check_outputs

    check_outputs([("--out", out, (".csv", ".gz"))], {}, force=force)
    write_example(out)
    typer.echo(out)


def init(
    out: Annotated[Path, typer.Argument(help="Machine file to write.")] = Path("my_axis.toml"),
    force: options.ForceOption = False,
) -> None:
    """Write a machine file with comments, to edit.

    Of a lag of 6 ms; hybridsep fit finds what an axis is from its log.
    """
    from ..base.files import write_whole
    from ..identify.model import machine_of
    from ..identify.structure import lag_mode
    from ..machines.machine import machine_name, machine_text
    from ..model.physics import ModalModel
    from .console import check_outputs

    check_outputs([("OUT", out, (".toml",))], {}, force=force)
    lag = 0.006  # time constant, s
    machine = machine_of(
        *(ModalModel([lag_mode(lag)]), "zoh", 1e-3, machine_name(out), f"{out.stem}, by hybridsep init"),
        predictor={"Np": 100, "p": 50, "q": 3, "averaging": True},
    )
    comments = [
        f"Physics model: a lag, tau = {lag:g}. hybridsep fit finds it from a log of the axis.",
        f"Next: hybridsep backtest LOG --machine {out}",
    ]
    more = Path(__file__).with_name("more_sections.toml")  # which a machine file may have besides
    write_whole(out, machine_text(machine, comments, annotated=True) + more.read_text(encoding="utf-8"))
    typer.echo(f"{out} written: a lag, tau = {lag:g}; edit it")
