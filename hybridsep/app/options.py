"""Options of the command line's commands; ranges and units come from the table of parameters.

What a command works with is imported when it runs, so that its help, and that of the others, needs none of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..fmi.flavours import FLAVOURS

__all__ = [
    "TRAJECTORIES",
    "AsIsOption",
    "AxisOption",
    "CommandColumnOption",
    "FigurePagesOption",
    "FixOption",
    "FlavourOption",
    "ForceOption",
    "JsonOption",
    "ListChannelsOption",
    "LogArgument",
    "MachineOption",
    "MeasuredColumnOption",
    "ResampleOption",
    "SavedOption",
    "TimeColumnOption",
    "TsOption",
    "UnitOption",
    "WeightsOption",
]


TRAJECTORIES = ("staircase", "spiral_x", "spiral_y")
"""What ``--trajectory`` takes besides a file."""


JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Overwrite an existing file even if it is not of the kind that is written.")
]
MachineOption = Annotated[
    str, typer.Option("--machine", "-m", help="Machine file (.toml), or the name of one that comes with the library.")
]
FlavourOption = Annotated[str, typer.Option(help=f"Flavour of the FMUs: {', '.join(FLAVOURS)}.")]
TsOption = Annotated[
    float | None, typer.Option("--T_s", "--Ts", help="Sampling interval [s], for a file without a time column.")
]
UnitOption = Annotated[
    str | None,
    typer.Option(
        help="Unit of the positions in the file: m, mm, um, nm, in, or of a rotary axis rad, mrad, urad, deg, rev, or "
        "a multiple of one (0.1um), such as an encoder's count; that of the columns' names (x [mm]) or m if left out."
    ),
]
TimeColumnOption = Annotated[str | None, typer.Option("--t", help="Name of the time column.")]
CommandColumnOption = Annotated[
    str | None, typer.Option("--x_d", "--x-d", help="Name of the commanded position's column.")
]
MeasuredColumnOption = Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")]
AxisOption = Annotated[str | None, typer.Option(help="Axis of a file that holds several, such as X1.")]
ResampleOption = Annotated[
    bool,
    typer.Option(
        "--resample", help="Take columns that are sampled at rates of their own at the times of the slower one."
    ),
]
ListChannelsOption = Annotated[
    bool,
    typer.Option("--list-channels", help="Print what the log holds, with units and rates, and do nothing else."),
]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        help="A predictor saved with HybridPredictor.save: the one HybridPredictor or SepCompensator that is built "
        "here starts warm; name it where there are more."
    ),
]
LogArgument = Annotated[
    Path,
    typer.Argument(
        help="Recorded log with the columns t, x_d, x_meas or x, in a format of docs/reference/logs.md: CSV, .mat, …"
    ),
]
FixOption = Annotated[bool, typer.Option("--fix", help="Apply the fixes of what the checks of the log find.")]
AsIsOption = Annotated[bool, typer.Option("--as-is", help="Replay the log with the faults that the checks find in it.")]
SavedOption = Annotated[
    Path | None,
    typer.Option(help="A predictor saved with hybridsep backtest --save, to begin with what it learned."),
]
FigurePagesOption = Annotated[
    Path | None, typer.Option(help="PDF with the report's charts for print, a page each, one column wide.")
]
