"""Command ``hybridsep fit``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .failures import loading
from .options import (
    AxisOption,
    CommandColumnOption,
    ForceOption,
    JsonOption,
    MeasuredColumnOption,
    TimeColumnOption,
    TsOption,
    UnitOption,
)

__all__ = ["fit"]


def fit(
    logs: Annotated[list[Path], typer.Argument(help="Recorded logs of one axis: commanded and measured positions.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for machine file, FMUs and report; named after the log if left out.")
    ] = None,
    Np: Annotated[
        int | None,
        typer.Option(
            "--Np", "--np", min=1, help="Samples of the controller's look-ahead; those of 100 ms if left out."
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the axis; that of the log if left out.")] = None,
    unit: UnitOption = None,
    T_s: TsOption = None,
    t: TimeColumnOption = None,
    x_d: CommandColumnOption = None,
    x: MeasuredColumnOption = None,
    axis: AxisOption = None,
    fix: Annotated[
        bool, typer.Option("--fix", help="Apply what puts a finding of the checks right, and go on.")
    ] = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """From the log of an axis to its model, settings, FMUs and a report."""
    with loading():
        from ..logs.log import read_log
        from .fit import FitOptions, checked_name, fit_files, machine_name
        from .fit import fit as fit_logs
        from .fit_intake import take_in
        from .fit_report import recommendation, write_report
        from .fit_table import print_fit
        from .overwrite import FIT_FILES, Output, check_outputs
        from .progress import progress_bar
        from .tables import console, print_json

    columns = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x)) if column}
    name = checked_name(name) if name else machine_name(logs[0])
    folder = out or Path(name)
    files = fit_files(folder, name)
    inputs: dict[str, str | Path | None] = {f"log {path.name}": path for path in logs}
    check_outputs([Output("--out", path, FIT_FILES[path.suffix]) for path in files.values()], inputs, force=force)
    found = [read_log(path, columns=columns, unit=unit, T_s=T_s, axis=axis, uniform=False) for path in logs]
    used, findings = take_in(found, fix=fix)
    with progress_bar(as_json) as advance:
        result = fit_logs(used, folder, FitOptions(Np, name), advance)
        write_report(files["report"], result, used, findings)
    if as_json:
        print_json({**result.summary(), "files": {what: str(path) for what, path in files.items()}})
        return
    print_fit(result, findings, used[0].unit)
    console.print(f"\n{recommendation(result)}", highlight=False)
    console.print("\n".join(f"{what}: {path}" for what, path in files.items()), highlight=False, soft_wrap=True)
