"""Command ``hybridsep fit``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .options import (
    FigurePagesOption,
    ForceOption,
    JsonOption,
)
from .parameter_options import DRIVE_LIMIT_ENTRIES, KNOWN_ENTRIES, takes_parameters
from .reading_options import ReadingOptions, takes_reading

__all__ = ["fit"]


@takes_reading
@takes_parameters(KNOWN_ENTRIES, DRIVE_LIMIT_ENTRIES, otherwise="none, or the usual one")
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
    name: Annotated[
        str | None, typer.Option(help="Name of the axis; that of the log, and of --axis, if left out.")
    ] = None,
    *,
    reading: ReadingOptions,
    parameters: dict[str, Any],
    fix: Annotated[
        bool, typer.Option("--fix", help="Apply what puts a finding of the checks right, and go on.")
    ] = False,
    figure: FigurePagesOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """From the log of an axis to its model, FMUs and a report."""
    from ..logs.log import read_log
    from .arguments import check_ending, checked_name, machine_name
    from .fit import FitOptions, fit_files
    from .fit import fit as fit_logs
    from .fit_compensation import drive_limits
    from .fit_report import fit_report, judged_by
    from .fit_table import print_fit
    from .judged import recommendation
    from .log_intake import changes, findings_table, show, take_in
    from .overwrite import BY_ENDING, FIT_FILES, Output, check_outputs
    from .progress import progress_bar
    from .tables import console, print_json, print_written

    name = checked_name(name) if name else machine_name(logs[0], reading.axis)
    folder = out or Path(name)
    limits = drive_limits(parameters)
    files = fit_files(folder, name, compensator=bool(limits))
    known = {entry: parameters[entry] for entry in KNOWN_ENTRIES if entry in parameters}
    inputs: dict[str, str | Path | None] = {f"log {path.name}": path for path in logs}
    check_ending(figure, "--figure", (".pdf",))
    outputs = [Output("--out", path, FIT_FILES[path.suffix]) for path in files.values()]
    outputs += [Output("--figure", figure, BY_ENDING[".pdf"])] if figure is not None else []
    check_outputs(outputs, inputs, force=force)
    found = [
        read_log(
            path,
            columns=reading.columns,
            unit=reading.unit,
            T_s=reading.T_s,
            axis=reading.axis,
            uniform=False,
            resample=reading.resample,
        )
        for path in logs
    ]
    for log in found:
        show((f"{log.path.name}: {remark}" for remark in log.remarks), ())
    used, findings = take_in(found, fix=fix)
    with progress_bar(as_json) as advance:
        result = fit_logs(
            used, folder, FitOptions(Np, name, known=known, drive_limits=limits), advance, changes=changes(findings)
        )
        fit_report(result, used, findings).write(files["report"], figure)
    advice = recommendation(judged_by(result, used[0].shown))
    if as_json:
        listed = {log_name: findings_table(one) for log_name, one in findings.items()}
        written = {what: str(path) for what, path in files.items()}
        print_json({**result.summary(), "advice": advice, "findings": listed, "files": written})
        return
    print_fit(result, used, findings)
    console.print(f"\n{advice}", highlight=False)
    console.print("\n".join(f"{what}: {path}" for what, path in files.items()), highlight=False, soft_wrap=True)
    print_written(figure)
