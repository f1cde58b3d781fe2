"""Commands to begin with: the demonstration, an example log, and a machine file to edit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.errors import ParameterError
from ..fmi.flavours import FLAVOURS, FMI_VERSIONS
from .options import FmiOption, ForceOption, JsonOption

if TYPE_CHECKING:
    from ..demo.page import Table as CaseTable
    from ..model.physics import ModalModel

__all__ = ["demo", "example_log", "init", "print_figures"]

_LAG = 0.006
"""Time constant of the axis in a machine file that says nothing of it, s."""

_MORE = """
# Instead of [[physics.mode]]: moving mass, damping, stiffness.
# [physics.spring_mass_damper]
# m = 40.0                      # kg
# c = 3000.0                    # N.s/m
# k = 1e6                       # N/m

# What the drive allows: with it a compensator can be built.
# [drive_limits]
# velocity = 0.5                # m/s
# acceleration = 10.0           # m/s2
# jerk = 1000.0                 # m/s3
# change_max = 1e-3             # m, about twice the servo error

# How the logs of the axis are read, where their columns do not say it.
# [log]
# unit = "mm"
# t = "time"
# x_d = "command"
# x = "position"
"""
"""Sections that a machine file may have besides."""


def demo(
    out: Annotated[Path, typer.Option(help="Folder for FMUs, figures, results and summary.json.")] = Path("demo"),
    full: Annotated[
        bool,
        typer.Option("--full", help="Ten noise seeds on the staircase, and the spiral's axes too; about a minute."),
    ] = False,
    emps: Annotated[Path | None, typer.Option(help="A DATA_EMPS.mat: replay this recorded axis too.")] = None,
    flavour: Annotated[
        str | None,
        typer.Option(help=f"Flavour of the FMUs: {', '.join(FLAVOURS)}; native where their libraries are there."),
    ] = None,
    fmi: FmiOption = FMI_VERSIONS[0],
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Co-simulate the paper's staircase, draw and score it.

    Its FMUs are built first; index.html in the folder shows what came out.
    """
    from ..demo.cases import demo as run_demo
    from ..demo.cases import demo_files, processor_time, read_recorded
    from ..fmi.archive import default_flavour
    from .console import check_outputs, console, print_json, progress_bar
    from .logs import show

    flavour = flavour or default_flavour()
    files = demo_files(out, flavour, full=full, emps=emps is not None, fmi=fmi)
    check_outputs((("--out", path, ()) for path in files), {"recording": emps}, force=force)
    if emps is not None:
        read_recorded(emps)  # a refusal comes before any announcement
    if not as_json:
        show([f"this takes {processor_time(flavour, full)} of processor time"], ())
    with progress_bar(as_json) as advance:
        summary = run_demo(out, full=full, emps=emps, flavour=flavour, fmi=fmi, progress=advance)
    if as_json:
        print_json(summary)
        return
    print_figures(summary)
    rest = "" if full else f"; ten noise seeds and the spiral: hybridsep demo --full --out {out}"
    console.print(f"\nPictures, tables, FMUs: {out / 'index.html'}{rest}", soft_wrap=True)


def print_figures(summary: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the tracking errors of the demo's compensated runs, then its prediction errors."""
    from ..demo.page import compensation_table, prediction_table
    from .console import console

    _print_table(compensation_table(summary))
    _print_table(prediction_table(summary))
    if "spiral_x" in summary:
        console.print(
            "The stage has the paper's Table 1 and a simulated disturbance, scaled to the printed physics figures: "
            "these agree by construction, the hybrid's do not."
        )
    for name, case in summary.items():
        n, worse = case["n_batches"], case["batches_hybrid_worse"]
        text = f"{name}: of {n} windows the hybrid is worse than physics in {len(worse)}"
        times = ", ".join(f"{batch['t_s']:g}" for batch in worse)
        console.print(
            f"{text}{f' (from {times} s on)' if worse else ''}, worse than hold in {case['n_batches_worse_than_hold']}"
        )
        console.print(case["verdict"])


def _print_table(content: CaseTable) -> None:
    """Print a table of the demo's cases; it fits 80 columns."""
    from rich import box
    from rich.table import Table

    from .console import console

    table = Table(
        "case",
        title=f"\n{content.title}",
        caption=content.note,
        box=box.SIMPLE,
        pad_edge=False,
        collapse_padding=True,
        show_edge=False,
    )
    table.columns[0].no_wrap = True
    for column in content.columns:
        table.add_column(column, justify="right", no_wrap=True)
    for row in content.rows:
        table.add_row(*row)
    console.print(table)


def example_log(
    out: Annotated[Path, typer.Option(help="File for the log, .csv or .csv.gz.")] = Path("example_axis.csv"),
    force: ForceOption = False,
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
    tau: Annotated[
        float | None,
        typer.Option(help="A lag: its time constant [s], servo error over velocity without the dead time."),
    ] = None,
    f_n: Annotated[
        float | None, typer.Option("--f_n", help="A second-order axis: natural frequency of the position loop [Hz].")
    ] = None,
    zeta: Annotated[float | None, typer.Option(help="Its damping ratio (1 is critical).")] = None,
    from_tf: Annotated[
        tuple[str, str] | None,
        typer.Option(metavar="NUM DEN", help="A transfer function: coefficients in s, highest power first, in quotes."),
    ] = None,
    force: ForceOption = False,
) -> None:
    """Write a machine file with comments, to edit.

    Of a lag of 6 ms where no option says what the axis is; hybridsep fit and identify find it from a log.
    """
    from ..base.files import written_text
    from ..identify.model import machine_of
    from ..machines.machine import machine_name
    from ..machines.text import machine_text
    from .console import check_outputs

    check_outputs([("OUT", out, (".toml",))], {}, force=force)
    model, said = _model(tau, f_n, zeta, from_tf)
    machine = machine_of(
        *(model, "zoh", 1e-3, machine_name(out), f"{out.stem}, by hybridsep init"),
        predictor={"Np": 100, "p": 50, "q": 3, "averaging": True},
    )
    comments = [
        f"Physics model: {said}. hybridsep identify finds it from a log of the axis.",
        f"Next: hybridsep backtest LOG --machine {out}",
    ]
    with written_text(out) as file:
        file.write(machine_text(machine, comments, annotated=True) + _MORE)
    typer.echo(f"{out} written: {said}; edit it")


def _model(
    tau: float | None, f_n: float | None, zeta: float | None, from_tf: tuple[str, str] | None
) -> tuple[ModalModel, str]:
    """Return the model that the options say, and what it is in words."""
    from ..identify.structure import lag_mode
    from ..model.physics import ModalModel, Mode

    if sum(one is not None for one in (tau, from_tf, zeta if f_n is None else f_n)) > 1:
        raise ParameterError("--tau, --f_n with --zeta, and --from-tf exclude each other")
    if (f_n is None) != (zeta is None):
        raise ParameterError("--f_n and --zeta must come together")
    if from_tf is not None:
        import control

        model = ModalModel.from_control(control.tf(*map(_coefficients, from_tf)))
        return model, f"transfer function, num = {from_tf[0]}, den = {from_tf[1]}"
    if f_n is not None and zeta is not None:
        return ModalModel([Mode(f_n, zeta, (2 * math.pi * f_n) ** 2)]), f"second order, f_n = {f_n:g}, zeta = {zeta:g}"
    tau = _LAG if tau is None else tau
    if not tau > 0:
        raise ParameterError(f"tau must be above 0 s, got {tau:g}")
    return ModalModel([lag_mode(tau)]), f"lag, tau = {tau:g}"


def _coefficients(text: str) -> list[float]:
    parts = text.replace(",", " ").replace("[", " ").replace("]", " ").split()
    if not parts:
        raise ParameterError(f"a polynomial needs coefficients, highest power first, got {text!r}")
    try:
        return [float(part) for part in parts]
    except ValueError:
        raise ParameterError(f"a polynomial's coefficients must be numbers, got {text!r}") from None
