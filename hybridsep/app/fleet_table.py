"""What a run of a fleet prints."""

from __future__ import annotations

from pathlib import Path

from ..base.errors import listed
from .fleet_run import FleetRun
from .tables import console, print_json

__all__ = ["print_run"]


def print_run(run: FleetRun, out: Path, *, as_json: bool) -> None:
    """Print how many logs there were, what was new, and what failed."""
    if as_json:
        print_json({"logs": run.n_logs, "unchanged": run.n_unchanged, "rows": run.rows, "results": str(out)})
        return
    done = len(run.rows) - len(run.failed)
    console.print(
        f"{run.n_logs} logs, {run.n_unchanged} unchanged; {done} axes done, {len(run.failed)} failed", highlight=False
    )
    if run.failed:
        failures = [f"{row['url'].rpartition('/')[2]} {row['axis']}: {row['message']}" for row in run.failed]
        console.print(listed(failures, str, "\n"), highlight=False, soft_wrap=True)
    console.print(f"results: {out}\nnext: hybridsep fleet report {out}", highlight=False, soft_wrap=True)
