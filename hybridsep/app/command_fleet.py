"""Command ``hybridsep fleet``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import (
    KNOWN_ENTRIES,
    CommandColumnOption,
    JsonOption,
    MeasuredColumnOption,
    ResampleOption,
    SchedulerOption,
    TimeColumnOption,
    TsOption,
    UnitOption,
    WorkersOption,
    takes_parameters,
)

if TYPE_CHECKING:
    from ..fleet.run import FleetRun

__all__ = ["fleet"]

_REPORT = "report"


@takes_parameters(KNOWN_ENTRIES, otherwise="none, or the usual one")
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
        int | None,
        typer.Option("--Np", "--np", min=1, help="Samples of the controllers' look-ahead; 100 ms if left out."),
    ] = None,
    axis: Annotated[
        list[str] | None, typer.Option(help="Axis that is read of logs with several; all of them if left out.")
    ] = None,
    unit: UnitOption = None,
    T_s: TsOption = None,
    t: TimeColumnOption = None,
    x_d: CommandColumnOption = None,
    x: MeasuredColumnOption = None,
    resample: ResampleOption = False,
    *,
    parameters: dict[str, Any],
    fix: Annotated[
        bool, typer.Option("--fix", help="Apply what puts a finding of the checks right, and go on.")
    ] = False,
    fmus: Annotated[bool, typer.Option(help="Build the FMUs of what is fitted.")] = True,
    reports: Annotated[bool, typer.Option(help="Write a report of each axis.")] = True,
    workers: WorkersOption = 0,
    scheduler: SchedulerOption = "",
    jobs: Annotated[int, typer.Option(min=0, help="Processes without Dask; as many as cores if left out.")] = 0,
    as_json: JsonOption = False,
) -> None:
    """Fit or replay every axis of many logs.

    hybridsep fleet report RESULTS writes one page about the results.
    """
    from contextlib import nullcontext

    from ..base.errors import ParameterError
    from ..fleet.page import write_page
    from ..fleet.results import Results
    from ..fleet.run import run_fleet
    from ..fleet.settings import FleetSettings
    from ..parallel.engine import check_engine, cluster, joblib_engine
    from .progress import progress_bar
    from .tables import console

    if sources[0] == _REPORT:
        if len(sources) != 2:
            raise ParameterError(f"hybridsep fleet report takes one folder of results, got {len(sources) - 1}")
        folder = Path(sources[1])
        page = out or folder / "report.html"
        write_page(Results(folder).rows(), page, folder)
        console.print(f"report: {page}", soft_wrap=True)
        return
    if out is None:
        raise ParameterError("--out must name the folder of the results")
    check_engine(workers, scheduler)
    named = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x)) if column}
    settings = FleetSettings(
        *(Np, unit, T_s, tuple(named.items()), tuple(axis or ()), resample, fix),
        known=tuple((entry, parameters[entry]) for entry in KNOWN_ENTRIES if entry in parameters),
        machines=str(machines.absolute()) if machines else "",
        fmus=fmus,
        reports=reports,
    )

    def engine() -> Any:
        return cluster(workers, scheduler) if workers or scheduler else nullcontext(joblib_engine(jobs))

    with progress_bar(as_json) as advance:
        found = run_fleet(sources, out, settings, engine, advance)
    _print_run(found, out, as_json=as_json)


def _print_run(run: FleetRun, out: Path, *, as_json: bool) -> None:
    """Print how many logs there were, what was new, and what failed."""
    from ..base.errors import listed
    from .tables import console, print_json

    if as_json:
        print_json({"logs": run.n_logs, "unchanged": run.n_unchanged, "rows": run.rows, "results": str(out)})
        return
    done = len(run.rows) - len(run.failed)
    console.print(f"{run.n_logs} logs, {run.n_unchanged} unchanged; {done} axes done, {len(run.failed)} failed")
    if run.failed:
        failures = [f"{row['url'].rpartition('/')[2]} {row['axis']}: {row['message']}" for row in run.failed]
        console.print(listed(failures, str, "\n"), soft_wrap=True)
    console.print(f"results: {out}\nnext: hybridsep fleet report {out}", soft_wrap=True)
