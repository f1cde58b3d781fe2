"""Command ``hybridsep fleet``."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from .run import FleetRun

__all__ = ["fleet"]


def fleet(
    sources: Annotated[
        list[str],
        typer.Argument(
            help="Folders, patterns or object stores (s3://…) with logs; or report and a folder of results."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the results; of report the HTML file, in the folder if left out.")
    ] = None,
    machines: Annotated[
        Path | None,
        typer.Option(
            help="Folder of machine files, named after the machine or MACHINE_AXIS: logs are replayed, not fitted."
        ),
    ] = None,
    Np: Annotated[
        int | None, typer.Option("--Np", min=1, help="Samples of the controllers' look-ahead; 100 ms if left out.")
    ] = None,
    axis: Annotated[
        list[str] | None, typer.Option(help="Axis that is read of logs with several; all of them if left out.")
    ] = None,
    unit: Annotated[str | None, typer.Option(help="Unit of the positions, where their names do not say it.")] = None,
    T_s: Annotated[
        float | None, typer.Option("--T_s", help="Sampling interval [s], for logs without a time column.")
    ] = None,
    t: Annotated[str | None, typer.Option("--t", help="Name of the time column.")] = None,
    x_d: Annotated[str | None, typer.Option("--x_d", help="Name of the commanded position's column.")] = None,
    x: Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")] = None,
    error: Annotated[
        str | None, typer.Option("--error", help="Name of the error, commanded − measured; -NAME: the other way.")
    ] = None,
    *,
    fmus: Annotated[bool, typer.Option(help="Build the FMUs of what is fitted.")] = True,
    reports: Annotated[bool, typer.Option(help="Write a report of each axis.")] = True,
    workers: Annotated[int, typer.Option(min=0, help="Processes of this machine; as many as cores if left out.")] = 0,
    scheduler: Annotated[
        str, typer.Option(help="Address of a running Dask scheduler instead, such as tls://10.0.0.5:8786.")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")] = False,
) -> None:
    """Fit or replay every axis of many logs.

    hybridsep fleet report RESULTS writes one page about the results.
    """
    from hybridsep.app.console import progress_bar
    from hybridsep.base.errors import ParameterError

    from .engine import cluster
    from .page import write_page
    from .results import Results
    from .run import run_fleet
    from .settings import FleetSettings

    if sources[0] == "report":
        if len(sources) != 2:
            raise ParameterError(f"hybridsep fleet report takes one folder of results, got {len(sources) - 1}")
        folder = Path(sources[1])
        page = out or folder / "report.html"
        write_page(Results(folder).rows(), page, folder)
        typer.echo(f"report: {page}")
        return
    if out is None:
        raise ParameterError("--out must name the folder of the results")
    columns = tuple((role, one) for role, one in (("t", t), ("x_d", x_d), ("x", x), ("error", error)) if one)
    settings = FleetSettings(
        *(Np, unit, T_s, columns, tuple(axis or ())),
        machines=str(machines.absolute()) if machines else "",
        fmus=fmus,
        reports=reports,
    )
    with progress_bar(as_json) as advance:
        found = run_fleet(sources, out, settings, lambda: cluster(workers, scheduler), advance)
    _print_run(found, out, as_json=as_json)


def _print_run(run: "FleetRun", out: Path, *, as_json: bool) -> None:
    """Print how many logs there were, what was new, and what failed."""
    from hybridsep.base.errors import listed

    if as_json:
        result = {"logs": run.n_logs, "unchanged": run.n_unchanged, "rows": run.rows, "results": str(out)}
        typer.echo(json.dumps(result, indent=2))
        return
    done = len(run.rows) - len(run.failed)
    typer.echo(f"{run.n_logs} logs, {run.n_unchanged} unchanged; {done} axes done, {len(run.failed)} failed")
    if run.failed:
        failures = [f"{row['url'].rpartition('/')[2]} {row['axis']}: {row['message']}" for row in run.failed]
        typer.echo(listed(failures, str, "\n"))
    typer.echo(f"results: {out}\nnext: hybridsep fleet report {out}")
