"""Command ``hybridsep demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..fmi.flavours import FLAVOURS, FMI_VERSIONS
from .options import FmiOption, ForceOption, JsonOption

__all__ = ["demo"]


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
    from ..demo.cases import read_recorded
    from ..demo.demo import demo as run_demo
    from ..demo.demo import demo_files, processor_time
    from ..fmi.archive import default_flavour
    from .log_intake import show
    from .outputs import check_outputs
    from .progress import progress_bar
    from .tables import console, print_compensation, print_json, print_predictions

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
    print_compensation(summary)
    print_predictions(summary)
    rest = "" if full else f"; ten noise seeds and the spiral: hybridsep demo --full --out {out}"
    console.print(f"\nPictures, tables, FMUs: {out / 'index.html'}{rest}", soft_wrap=True)
