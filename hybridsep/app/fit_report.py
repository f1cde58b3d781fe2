"""Report of ``hybridsep fit``: what was found, how good and how sure it is, and how to use it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.signal import welch

from ..base.metrics import coverage
from ..base.signals import Array
from ..evaluate.canvas import HOLD, HYBRID, PHYSICS
from ..evaluate.report import Chart, Line, Report
from ..evaluate.verdict import ALIKE
from ..intake.finding import Finding
from ..logs.log import Log
from ..tune.choice import WORTH
from .fit import Fit, shown_unit

__all__ = ["recommendation", "write_report"]

_NAMES = ("physics model", "hold the last residual", "hybrid")
_COLOURS = (PHYSICS, HOLD, HYBRID)
_BAND = "rgba(27, 108, 168, 0.18)"


def recommendation(fit: Fit) -> str:
    """Return what to do, in words."""
    pb, hold, h = fit.judged.rms()
    peer, value = min(("the physics model alone", pb), ("holding the last residual", hold), key=lambda one: one[1])
    if value == 0.0:
        return "The log's second half has no error to predict: record the axis while it works."
    ratio = h / value
    if ratio < 1.0 - ALIKE:
        return f"Use the hybrid: its error is {ratio:.2f} × that of {peer}, the best without learning."
    if ratio <= 1.0 + ALIKE:
        return f"The hybrid does no harm and no good here: {ratio:.2f} × the error of {peer}."
    return f"Do not use the hybrid on what this log shows: {ratio:.2f} × the error of {peer}; record more motion."


def write_report(path: Path, fit: Fit, logs: Sequence[Log], findings: Mapping[str, Sequence[Finding]]) -> None:
    """Write the report.

    Parameters
    ----------
    path : Path
        The HTML file.
    fit : Fit
    logs : sequence of Log
        As they were used.
    findings : mapping
        Log's name → findings of its intake.
    """
    T_s, Np = fit.machine.T_s, fit.judged.Np
    n = sum(len(log.t) for log in logs)
    scale, unit = shown_unit(fit.judged.rms()[0], logs[0].unit)
    report = Report(
        f"Axis {fit.machine.name}: from its log to its FMU",
        f"{', '.join(log.path.name for log in logs)} · {n} samples, {n * T_s:.4g} s at {1 / T_s:.4g} Hz · look-ahead "
        f"{Np} samples, {1e3 * Np * T_s:.4g} ms",
    )
    report.paragraph(recommendation(fit), "verdict")
    _judgement(report, fit, scale, unit)
    _over_time(report, fit, scale, unit)
    _horizon(report, fit, scale, unit)
    _spectra(report, fit, scale, unit)
    _intake(report, findings)
    _identification(report, fit, scale, unit)
    _settings(report, fit, scale, unit)
    _use(report, fit)
    report.write(path)


def _judgement(report: Report, fit: Fit, scale: float, unit: str) -> None:
    report.heading("Judged on samples that taught nothing")
    errors = fit.judged.errors()
    known = errors[:, ~np.isnan(errors[0])]
    rows = []
    for name, row in zip(_NAMES, known, strict=True):
        ratio = np.sqrt(np.mean(row**2) / np.mean(known[0] ** 2)) if known[0].any() else np.nan
        figures = (np.sqrt(np.mean(row**2)), np.quantile(np.abs(row), 0.95), np.abs(row).max())
        rows.append([name, *(f"{scale * figure:.4g}" for figure in figures), f"{ratio:.3f}"])
    report.table(["prediction by", f"RMS [{unit}]", "95 % below", "largest", "× physics"], rows)
    report.paragraph(
        "The first half of each log taught the physics model and chose the settings; these are the errors of the "
        "second half. Each window was predicted before any of its samples was known, as in the machine.",
        "dim",
    )
    report.bullets(line.rstrip(".") for line in str(fit.judged.verdict()).splitlines())


def _over_time(report: Report, fit: Fit, scale: float, unit: str) -> None:
    judged = fit.judged
    errors, T_s = scale * judged.errors(), fit.machine.T_s
    t = T_s * np.arange(errors.shape[1])
    x_d = np.concatenate([recording.x_d[recording.n_taught :] for recording in judged.recordings])
    lines = [Line("command", t, 1e3 * x_d, "#1d2733")]
    std = scale * judged.joined("x_h_std")
    within = coverage(errors[2] / scale, std / scale, 0.95)
    for name, row, colour in zip(_NAMES, errors, _COLOURS, strict=True):
        if name != _NAMES[1]:
            lines.append(Line(name, t, row, colour, panel=1))
    lines.append(Line("95 % interval of the hybrid", t, -1.96 * std, _BAND, upper=1.96 * std, panel=1))
    chart = Chart(
        "time since the half [s]",
        (f"command [{'mm' if unit.endswith('m') else 'mrad'}]", f"error x − x̂ [{unit}]"),
        lines,
        f"The hybrid states its own standard deviation with each window; {100 * within:.0f} % of the errors are within "
        "its 95 % interval.",
    )
    report.heading("Errors over time")
    report.chart(chart)


def _horizon(report: Report, fit: Fit, scale: float, unit: str) -> None:
    report.heading("Errors over the look-ahead")
    T_s, horizon = fit.machine.T_s, scale * fit.judged.horizon()
    ahead = 1e3 * T_s * np.arange(1, fit.judged.Np + 1)
    lines = [Line(name, ahead, row, colour) for name, row, colour in zip(_NAMES, horizon, _COLOURS, strict=True)]
    report.chart(
        Chart("ahead [ms]", (f"RMS error [{unit}]",), lines, "How the error grows from the window's first sample on.")
    )
    windows = np.array([[one["Np"], one["rms_pb"], one["rms_hold"], one["rms_h"]] for one in fit.windows])
    lengths = 1e3 * T_s * windows[:, 0]
    lines = [Line(name, lengths, scale * windows[:, 1 + i], _COLOURS[i]) for i, name in enumerate(_NAMES)]
    lines += [Line("", lengths, scale * windows[:, 3], HYBRID, points=True)]
    report.chart(
        Chart(
            "look-ahead Np·T_s [ms]",
            (f"RMS error [{unit}]",),
            lines,
            "With other windows. The look-ahead is the controller's; it is not chosen, as a shorter one always looks "
            "better.",
        )
    )


def _spectra(report: Report, fit: Fit, scale: float, unit: str) -> None:
    errors = fit.judged.errors()
    errors = errors[:, ~np.isnan(errors[0])]
    if errors.shape[1] < 64:
        return
    f, power = welch(errors, 1.0 / fit.machine.T_s, nperseg=min(2048, errors.shape[1]))
    amplitude: Array = scale * np.sqrt(power)
    lines = [Line(name, f[1:], row[1:], colour) for name, row, colour in zip(_NAMES, amplitude, _COLOURS, strict=True)]
    report.heading("Spectra of the errors")
    report.chart(Chart("frequency [Hz]", (f"density [{unit}/√Hz]",), lines, x_log=True, y_log=True))


def _intake(report: Report, findings: Mapping[str, Sequence[Finding]]) -> None:
    report.heading("What the checks of the log found")
    if not any(findings.values()):
        report.paragraph("Nothing: time axis, samples, signs, scales, delay and motion are plausible.")
    for name, found in findings.items():
        rows = [
            [finding.name, finding.severity, finding.words + (f". {finding.fix.words}" if finding.fix else "")]
            for finding in found
        ]
        if rows:
            report.table([name, "", "finding, and what puts it right"], rows, words=2)
        for finding in found:
            picture = finding.picture
            colours = ("#1d2733", PHYSICS, HYBRID, HOLD)
            lines = [
                Line(label, x, y, colour)
                for (label, (x, y)), colour in zip(picture.lines.items(), colours, strict=False)
            ]
            report.chart(Chart(picture.x_label, (picture.y_label,), lines, picture.title))


def _identification(report: Report, fit: Fit, scale: float, unit: str) -> None:
    found = fit.identification
    report.heading("Physics model")
    report.paragraph(
        f"{found['structure']}, {'zero' if found['input_hold'] == 'zoh' else 'first'}-order hold, dead time "
        f"{found['dead_time']} samples."
    )
    if found["parameters"]:
        rows = [
            [str(one["name"]), f"{one['value']:.6g}", f"± {one['std']:.2g}", str(one["unit"])]
            for one in found["parameters"]
        ]
        report.table(["parameter", "value", "standard deviation", "unit"], rows)
    if found["alternatives"]:
        rows = [
            [
                other["name"],
                str(other["n_parameters"]),
                f"{scale * other['rms_fitted']:.4g}",
                f"{scale * other['rms_held_out']:.4g}",
                other["objection"] or ("chosen" if other["name"] == found["structure"] else ""),
            ]
            for other in found["alternatives"]
        ]
        report.table(["structure", "parameters", f"fitted [{unit}]", f"held out [{unit}]", ""], rows, words=4)
        report.paragraph("RMS of the simulated position within the half that teaches.", "dim")
    report.bullets(found["findings"])


def _settings(report: Report, fit: Fit, scale: float, unit: str) -> None:
    report.heading("Settings")
    rows = [
        [
            str(one["p"]),
            str(one["q"]),
            "diverged" if one["rms_h"] is None else f"{scale * one['rms_h']:.4g}",
            "chosen" if one["chosen"] else "",
        ]
        for one in fit.choice
    ]
    report.table(["p", "q", f"RMS [{unit}]", ""], rows)
    report.paragraph(
        "Errors of causal replays over the later half of what teaches. The first row is the default, which stays "
        f"unless another is better by {100 * WORTH:g} %.",
        "dim",
    )


def _use(report: Report, fit: Fit) -> None:
    names = [path.name for path in fit.files if path.suffix == ".fmu"]
    T_s = fit.machine.T_s
    report.heading("Use it")
    steps = fit.steps
    report.paragraph(
        f"{' and '.join(names)} start with what the log has taught. Through Python on this machine a step of "
        f"{names[0]} took {1e6 * steps['median']:.3g} µs (median; largest "
        f"{1e6 * steps['largest']:.3g} µs, where a window ends), with a sampling interval of {1e6 * T_s:.4g} µs."
    )
    report.code(
        "from fmpy import simulate_fmu\n\n"
        f'result = simulate_fmu("{names[0]}", step_size={T_s!r}, output_interval={T_s!r}, input=signals,\n'
        '                      output=["x_d", "x_h", "x_h_std", "e_servo"])\n'
        "# signals: a structured array with the columns time, x_d_ahead, x_meas"
    )
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
