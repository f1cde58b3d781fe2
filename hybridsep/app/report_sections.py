"""Sections of a report that follow from a replay: judgement, errors, spectra, the log's findings, use of the FMU."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import welch

from ..base.metrics import coverage
from ..base.signals import Array
from ..evaluate.canvas import HOLD, HYBRID, PHYSICS
from ..evaluate.chart import Chart, Line
from ..evaluate.report import Report
from ..evaluate.verdict import ALIKE, WINDOWS_ENOUGH, WINDOWS_MIN, counted
from ..intake.finding import Finding
from ..tune.halves import Replay
from .tables import shown_unit

__all__ = [
    "COLOURS",
    "NAMES",
    "Judged",
    "recommendation",
    "write_changes",
    "write_errors",
    "write_findings",
    "write_use",
]

NAMES = ("physics model", "hold the last residual", "hybrid")
"""Names of :data:`~hybridsep.tune.halves.PREDICTIONS`."""

COLOURS = (PHYSICS, HOLD, HYBRID)
"""Their colours."""

_COMMAND = "#1d2733"


@dataclass(frozen=True)
class Judged:
    """Replay as it is reported.

    Attributes
    ----------
    replay : Replay
    T_s : float
        Sampling interval, s.
    si : {"m", "rad"}
        Unit of the positions.
    part : str
        What judges, such as "the log's second half".
    share : float
        Share of a log's samples that judges.
    """

    replay: Replay
    T_s: float
    si: str
    part: str
    share: float = 1.0

    @cached_property
    def unit(self) -> tuple[float, str]:
        """Factor and name of the unit in which errors are shown."""
        return shown_unit(self.replay.rms()[0], self.si)


def _enough(judged: Judged) -> str:
    """Return how long a recording would do, in words: its windows that judge, and one that began before."""
    seconds = (WINDOWS_ENOUGH + 1) * judged.replay.Np * judged.T_s / judged.share
    return f"record at least {math.ceil(round(10 * seconds, 6)) / 10:g} s"


def recommendation(judged: Judged) -> str:
    """Return what to do, in words; with caution where few windows judge."""
    n = judged.replay.verdict().n_windows
    if n < WINDOWS_MIN:
        return (
            f"Nothing could be judged: {judged.part} has {counted(n)} of {judged.replay.Np} samples; {_enough(judged)}."
        )
    pb, hold, h = judged.replay.rms()
    peer, value = min(("the physics model alone", pb), ("holding the last residual", hold), key=lambda one: one[1])
    if value == 0.0:
        return f"There is no error to predict in {judged.part}: record the axis while it works."
    ratio = h / value
    if n < WINDOWS_ENOUGH:
        how = "better than" if ratio < 1.0 - ALIKE else "worse than" if ratio > 1.0 + ALIKE else "as good as"
        return (
            f"So far the hybrid is {how} {peer}, {ratio:.2f} × its error, but judged by {counted(n)} only: "
            f"{_enough(judged)}."
        )
    by = f"judged by {counted(n)}"
    if ratio < 1.0 - ALIKE:
        return f"Use the hybrid: its error is {ratio:.2f} × that of {peer}, the best without learning, {by}."
    if ratio <= 1.0 + ALIKE:
        return f"The hybrid does no harm and no good here: {ratio:.2f} × the error of {peer}, {by}."
    return f"Do not use the hybrid on what this log shows: {ratio:.2f} × the error of {peer}, {by}; record more motion."


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
    _write_time(report, judged)
    _write_windows(report, judged)
    _write_horizon(report, judged)
    _write_spectra(report, judged)


def _write_figures(report: Report, judged: Judged, title: str, how: str) -> None:
    report.heading(title)
    scale, unit = judged.unit
    errors = judged.replay.errors()
    known = errors[:, ~np.isnan(errors[0])]
    rows = []
    for name, row in zip(NAMES, known, strict=True):
        ratio = np.sqrt(np.mean(row**2) / np.mean(known[0] ** 2)) if known[0].any() else np.nan
        figures = (np.sqrt(np.mean(row**2)), np.quantile(np.abs(row), 0.95), np.abs(row).max())
        rows.append([name, *(f"{scale * figure:.4g}" for figure in figures), f"{ratio:.3f}"])
    report.table(["prediction by", f"RMS [{unit}]", "95 % below", "largest", "× physics"], rows)
    report.paragraph(
        f"{how} Each window was predicted before any of its samples was known, as in the machine.",
        "dim",
    )
    report.bullets(line.rstrip(".") for line in str(judged.replay.verdict()).splitlines())


def _write_time(report: Report, judged: Judged) -> None:
    scale, unit = judged.unit
    replay = judged.replay
    errors, std = scale * replay.errors(), scale * replay.joined("x_h_std")
    t = judged.T_s * np.arange(errors.shape[1])
    x_d = np.concatenate([recording.x_d[recording.judges_from :] for recording in replay.recordings])
    lines = [Line("command", t, 1e3 * x_d, _COMMAND)]
    within = coverage(errors[2], std, 0.95)
    for name, row, colour in zip(NAMES, errors, COLOURS, strict=True):
        if name != NAMES[1]:
            lines.append(Line(name, t, row, colour, panel=1))
    half = np.minimum(1.96 * std, 1.2 * np.nanmax(np.abs(errors)))  # at first it may be far wider than any error
    lines.append(Line("95 % interval of the hybrid", t, -half, HYBRID, upper=half, panel=1))
    chart = Chart(
        f"time in {judged.part} [s]",
        (f"command [m{judged.si}]", f"error x − x̂ [{unit}]"),
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
    t = np.repeat(judged.T_s * np.append(begins, begins[-1] + judged.replay.Np), 2)[1:-1]
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


def write_use(report: Report, fmus: Iterable[str], steps: Mapping[str, float], T_s: float, Np: int) -> None:
    """Write how FMUs are used, and how long a step of the first takes.

    Parameters
    ----------
    report : Report
    fmus : iterable of str
        Names of their files.
    steps : mapping
        As of :func:`~hybridsep.app.step_times.step_times`.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples of the look-ahead.
    """
    names = list(fmus)
    report.heading("Use it")
    late = "" if max(steps["median"], steps["p99_9"]) <= T_s else _LATE
    report.paragraph(
        f"Through Python on this machine a step of {names[0]} took {_duration(steps['median'])} (median; 99.9 % at "
        f"most {_duration(steps['p99_9'])}; the largest {_duration(steps['largest'])}, interruptions by the operating "
        f"system included), with a sampling interval of {_duration(T_s)}. Steps that end a window take longest.{late}"
    )
    report.code(_REPLAY.format(fmu=names[0], T_s=T_s, Np=Np))
    report.bullets(
        [
            "OMSimulator: add the FMU to a system, connect x_d to the drive and its measured position to x_meas, fixed "
            f"step size {T_s:g} s",
            "OpenModelica: File > Import FMU; in an OMSimulator model as above",
            f"Dymola: File > Open > Import FMU, co-simulation, communication step {T_s:g} s",
            f"Simulink: FMU Import block (FMI 2.0, co-simulation), sample time {T_s:g} s",
            "x_d_ahead is the trajectory, as many samples early as the look-ahead is long; wire x_d to the drive: the "
            "FMU is the look-ahead buffer",
        ]
    )


_LATE = (
    " They take longer than the sampling interval: a real-time task of this interval would overrun on such a machine."
)
"""What is added where steps do not fit into the sampling interval."""

_REPLAY = """\
import numpy as np
from fmpy import simulate_fmu

# x_d, x_meas: commanded and measured positions of a log, one sample every {T_s!r} s
signals = np.zeros(len(x_d) + {Np}, [("time", float), ("x_d_ahead", float), ("x_meas", float)])
signals["time"] = {T_s!r} * np.arange(len(signals))
signals["x_d_ahead"] = np.pad(x_d, (0, {Np}), mode="edge")  # enters {Np} samples before it is commanded ...
signals["x_meas"] = np.pad(x_meas, ({Np}, 0), mode="edge")  # ... and measured
result = simulate_fmu("{fmu}", stop_time=signals["time"][-1], step_size={T_s!r},
                      output_interval={T_s!r}, input=signals, output=["x_d", "x_h", "x_h_std", "e_servo"])"""
"""Replay of a log with fmpy."""


def _duration(seconds: float) -> str:
    """Return a duration in ms, or in µs if it is shorter."""
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} µs"
