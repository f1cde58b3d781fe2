"""Sections of a report that follow from a replay: judgement, errors, spectra, the log's findings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.signal import welch

from ..base.metrics import coverage, rms_ratio
from ..base.signals import Array
from ..evaluate.canvas import HOLD, HYBRID, PHYSICS
from ..evaluate.chart import Chart, Line
from ..evaluate.report import Report
from ..intake.finding import Finding
from .judged import Judged, peers_in_words

__all__ = [
    "COLOURS",
    "NAMES",
    "write_changes",
    "write_errors",
    "write_findings",
]

NAMES = ("physics model", "hold the last residual", "hybrid")
"""Names of :data:`~hybridsep.tune.recordings.PREDICTIONS`."""

COLOURS = (PHYSICS, HOLD, HYBRID)
"""Their colours."""

_COMMAND = "#1d2733"


def write_changes(report: Report, changes: Sequence[str]) -> None:
    """Write what was done to the log's positions that a controller must do as well."""
    if changes:
        report.paragraph("These figures, and the FMUs, are of positions that were changed before:")
        report.bullets(changes)


def write_errors(report: Report, judged: Judged, title: str, how: str) -> None:
    """Write the sections on the errors: figures and verdict, over time, over the look-ahead, spectra.

    Parameters
    ----------
    report : Report
    judged : Judged
    title, how : str
        Heading of the figures, and how they came about.
    """
    _write_figures(report, judged, title, how)
    if np.isnan(judged.replay.errors()[0]).all():  # nothing judges
        return
    _write_time(report, judged)
    _write_windows(report, judged)
    _write_horizon(report, judged)
    _write_spectra(report, judged)


def _write_figures(report: Report, judged: Judged, title: str, how: str) -> None:
    report.heading(title)
    scale, unit = judged.unit
    scored = judged.replay.scored()
    rows = []
    for one in scored:
        size = np.abs(one.errors[~np.isnan(one.errors)])
        if one.diverged or not size.size:
            rows.append([one.name, "diverged" if one.diverged else "–", "", "", ""])
            continue
        figures = (one.rms, np.quantile(size, 0.95), size.max())
        ratio = rms_ratio(one.rms, scored[0].rms)
        rows.append([one.name, *(f"{scale * figure:.4g}" for figure in figures), f"{ratio:.3f}"])
    report.table(["prediction by", f"RMS [{unit}]", "95 % below", "largest", "× physics"], rows)
    report.paragraph(
        f"{how} Each window was predicted before any of its samples was known, as in the machine. "
        f"{peers_in_words(judged)}",
        "dim",
    )
    report.bullets(line.rstrip(".") for line in str(judged.replay.verdict()).splitlines())


def _write_time(report: Report, judged: Judged) -> None:
    scale, unit = judged.unit
    replay = judged.replay
    errors, std = scale * replay.errors(), scale * replay.joined("x_h_std")
    t = judged.T_s * np.arange(errors.shape[1])
    factor, position = judged.shown.position
    lines = [Line("command", t, factor * replay.commands(), _COMMAND)]
    within = coverage(errors[2], std, 0.95)
    for name, row, colour in zip(NAMES, errors, COLOURS, strict=True):
        if name != NAMES[1]:
            lines.append(Line(name, t, row, colour, panel=1))
    half = np.minimum(1.96 * std, 1.2 * np.nanmax(np.abs(errors)))  # at first it may be far wider than any error
    lines.append(Line("95 % interval of the hybrid", t, -half, HYBRID, upper=half, panel=1))
    chart = Chart(
        f"time in {judged.part} [s]",
        (f"command [{position}]", f"error x − x̂ [{unit}]"),
        lines,
        f"The hybrid states its own standard deviation with each window; {100 * within:.0f} % of the errors are within "
        "its 95 % interval.",
    )
    report.heading("Errors over time")
    report.chart(chart)


def _write_windows(report: Report, judged: Judged) -> None:
    scale, unit = judged.unit
    begins, errors = judged.replay.window_errors()
    if len(begins) < 2:
        return
    t = np.repeat(judged.T_s * np.append(begins, len(judged.replay.commands())), 2)[1:-1]
    lines = [
        Line(name, t, scale * np.repeat(row, 2), colour)
        for name, row, colour in zip(NAMES, errors, COLOURS, strict=True)
    ]
    worse = int((errors[2] > errors[0]).sum())
    report.chart(
        Chart(
            f"time in {judged.part} [s]",
            (f"RMS of each window [{unit}]",),
            lines,
            f"Window by window: the hybrid is worse than the physics model in {worse} of {len(begins)}.",
        )
    )


def _write_horizon(report: Report, judged: Judged) -> None:
    report.heading("Errors over the look-ahead")
    scale, unit = judged.unit
    horizon = scale * judged.replay.horizon()
    ahead = 1e3 * judged.T_s * np.arange(1, judged.replay.Np + 1)
    lines = [Line(name, ahead, row, colour) for name, row, colour in zip(NAMES, horizon, COLOURS, strict=True)]
    report.chart(
        Chart("ahead [ms]", (f"RMS error [{unit}]",), lines, "How the error grows from the window's first sample on.")
    )


def _write_spectra(report: Report, judged: Judged) -> None:
    scale, unit = judged.unit
    errors = judged.replay.errors()
    errors = errors[:, ~np.isnan(errors[0])]
    if errors.shape[1] < 64:
        return
    f, power = welch(errors, 1.0 / judged.T_s, nperseg=min(2048, errors.shape[1]))
    amplitude: Array = scale * np.sqrt(power)
    lines = [Line(name, f[1:], row[1:], colour) for name, row, colour in zip(NAMES, amplitude, COLOURS, strict=True)]
    report.heading("Spectra of the errors")
    report.chart(Chart("frequency [Hz]", (f"density [{unit}/√Hz]",), lines, x_log=True, y_log=True))


def write_findings(report: Report, findings: Mapping[str, Iterable[Finding]]) -> None:
    """Write what the intake of the logs, by name, found, with its pictures."""
    report.heading("What the checks of the log found")
    listed = {name: list(found) for name, found in findings.items()}
    if not any(listed.values()):
        report.paragraph("Nothing: time axis, samples, signs, scales, delay and motion are plausible.")
    for name, found in listed.items():
        rows = [
            [
                finding.name,
                str(finding).partition(":")[0],
                finding.words + (f". {finding.fix.words}" if finding.fix else ""),
            ]
            for finding in found
        ]
        if rows:
            report.table([name, "", "finding, and what puts it right"], rows, words=2)
        for finding in found:
            picture = finding.picture
            lines = [
                Line(label, x, y, colour)
                for (label, (x, y)), colour in zip(
                    picture.lines.items(), (_COMMAND, PHYSICS, HYBRID, HOLD), strict=False
                )
            ]
            report.chart(Chart(picture.x_label, (picture.y_label,), lines, picture.title))
