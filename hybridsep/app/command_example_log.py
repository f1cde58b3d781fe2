"""``hybridsep example-log``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import ForceOption

__all__ = ["example_log"]


def example_log(
    out: Annotated[Path, typer.Option(help="File for the log, .csv or .csv.gz.")] = Path("example_axis.csv"),
    force: ForceOption = False,
) -> None:
    """Write the example log that comes with the library.

    20 s of a simulated axis at 1 kHz, in mm.
    """
    from ..logs.formats import write_example
    from .outputs import check_outputs

    check_outputs([("--out", out, (".csv", ".gz"))], {}, force=force)
    write_example(out)
    typer.echo(out)
