"""What ``hybridsep fit`` prints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from rich import box
from rich.table import Table

from ..intake.finding import Finding
from ..logs.log import Log
from .extent import extent
from .fit import Fit
from .fit_compensation import tracking_lines
from .log_intake import changed_by
from .tables import console, shown_figure

__all__ = ["print_fit"]


def print_fit(fit: Fit, logs: Sequence[Log], findings: Mapping[str, Iterable[Finding]]) -> None:
    """Print what was read and what the intake found, what was identified and how it was judged."""
    unit, shown = logs[0].unit, logs[0].shown  # of all of them
    factor, position = shown.position
    for log in logs:
        travel = float(np.ptp(log.x_d))
        stated = "" if log.unit_stated else f", as the file states no unit of positions: taken as {unit} (--unit)"
        console.print(
            f"{log.path.name}: {extent([log])}, travel {factor * travel:.4g} {position}{stated}"
            f"{changed_by(findings.get(log.path.name, ()))}",
            highlight=False,
        )
    for name, found in findings.items():
        for finding in found:
            console.print(f"{name}: {finding}", highlight=False)
    scale, error = shown.error(fit.judged.rms()[0])
    model, settings = fit.identification, fit.machine.predictor_settings
    table = Table(
        "prediction by", title=f"Error on samples that taught nothing [{error}]", box=box.SIMPLE, pad_edge=False
    )
    table.add_column("RMS", justify="right")
    for one in fit.judged.scored():
        table.add_row(one.name, "diverged" if one.diverged else shown_figure(scale * one.rms))
    console.print(f"{model['structure']}, dead time {model['dead_time']} samples", highlight=False)
    for line in model["findings"]:
        console.print(f"  {line}", highlight=False)
    window = f"{1e3 * settings.Np * settings.T_s:.4g} ms"
    console.print(f"Np = {settings.Np} ({window}), p = {settings.p}, q = {settings.q}", highlight=False)
    console.print(table)
    console.print(str(fit.judged.verdict()), highlight=False)
    for line in tracking_lines(fit.tracking, logs[0].shown) if fit.tracking else ():
        console.print(line, highlight=False)
