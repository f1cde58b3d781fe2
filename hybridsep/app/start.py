"""Commands to begin with: the demonstration, an example log, and a machine file to edit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from .options import ForceOption

__all__ = ["demo", "example_log", "init", "print_figures"]

_LAG = 0.006
"""Time constant of the axis in a machine file to edit, s."""

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
# following_error_max = 6.5e-4  # m, about 1.3 times the largest: above it the compensator trips

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
    force: ForceOption = False,
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


def print_figures(summary: Mapping[str, Mapping[str, Any]]) -> None:
    """Print the tracking errors of the demo's compensated runs, then its prediction errors, within 80 columns."""
    from rich import box
    from rich.table import Table

    from ..demo.page import compensation_table, prediction_table
    from .console import console

    for found in (compensation_table(summary), prediction_table(summary)):
        narrow: dict[str, Any] = {"pad_edge": False, "collapse_padding": True, "show_edge": False}
        table = Table("case", title=f"\n{found.title}", caption=found.note, box=box.SIMPLE, **narrow)
        table.columns[0].no_wrap = True
        for column in found.columns:
            table.add_column(column, justify="right", no_wrap=True)
        for row in found.rows:
            table.add_row(*row)
        console.print(table)
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
    force: ForceOption = False,
) -> None:
    """Write a machine file with comments, to edit.

    Of a lag of 6 ms; hybridsep fit finds what an axis is from its log.
    """
    from ..base.files import written_text
    from ..identify.model import machine_of
    from ..identify.structure import lag_mode
    from ..machines.machine import machine_name
    from ..machines.text import machine_text
    from ..model.physics import ModalModel
    from .console import check_outputs

    check_outputs([("OUT", out, (".toml",))], {}, force=force)
    machine = machine_of(
        *(ModalModel([lag_mode(_LAG)]), "zoh", 1e-3, machine_name(out), f"{out.stem}, by hybridsep init"),
        predictor={"Np": 100, "p": 50, "q": 3, "averaging": True},
    )
    comments = [
        f"Physics model: a lag, tau = {_LAG:g}. hybridsep fit finds it from a log of the axis.",
        f"Next: hybridsep backtest LOG --machine {out}",
    ]
    with written_text(out) as file:
        file.write(machine_text(machine, comments, annotated=True) + _MORE)
    typer.echo(f"{out} written: a lag, tau = {_LAG:g}; edit it")
