"""Options of the command line's commands; ranges and units come from the table of parameters.

What a command works with is imported when it runs, so that its help, and that of the others, needs none of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..base.settings import PARAMETERS
from ..fmi.flavours import FLAVOURS

__all__ = [
    "COMPENSATIONS",
    "TRAJECTORIES",
    "FlavourOption",
    "ForceOption",
    "InitOption",
    "JsonOption",
    "LamOption",
    "MachineOption",
    "NpOption",
    "POption",
    "QOption",
    "TsOption",
    "UnitOption",
    "WeightsOption",
    "parameter_help",
]


COMPENSATIONS = ("none", "physics", "hybrid")
"""What ``--compensate`` takes: the best model to use, in the order of :class:`~hybridsep.compensate.plan.SepState`."""

TRAJECTORIES = ("staircase", "spiral_x", "spiral_y")
"""What ``--trajectory`` takes besides a file."""


def parameter_help(name: str) -> str:
    """Return the help of an option that changes a parameter of the machine."""
    return PARAMETERS[name].help + "; the machine's own if left out"


JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Overwrite an existing file even if it is not of the kind that is written.")
]
MachineOption = Annotated[
    str, typer.Option("--machine", "-m", help="Machine file (.toml), or the name of one that comes with the library.")
]
FlavourOption = Annotated[str, typer.Option(help=f"Flavour of the FMUs: {', '.join(FLAVOURS)}.")]
TsOption = Annotated[
    float | None, typer.Option("--Ts", help="Sampling interval [s], for a file without a time column.")
]
UnitOption = Annotated[str, typer.Option(help="Unit of the positions in the file: m, mm or um.")]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        help="A predictor saved with HybridPredictor.save: the one HybridPredictor or SepCompensator that is built "
        "here starts warm; name it where there are more."
    ),
]
NpOption = Annotated[int | None, typer.Option("--Np", help=parameter_help("Np"))]
POption = Annotated[int | None, typer.Option("--p", help=parameter_help("p"))]
QOption = Annotated[int | None, typer.Option("--q", help=parameter_help("q"))]
LamOption = Annotated[float | None, typer.Option("--lam", help=parameter_help("lambda"))]
InitOption = Annotated[float | None, typer.Option("--t-init", help=parameter_help("t_init"))]
