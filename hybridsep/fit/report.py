"""Report of ``hybridsep fit``: what was found, how good and how sure it is, and how to use it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..evaluate.canvas import HYBRID
from ..evaluate.chart import Chart, Line
from ..evaluate.report import Report
from ..identify.operation import TOO_LITTLE
from ..identify.shown import deviation_words, shown_estimates
from ..intake.finding import Finding
from ..intake.repair import changes
from ..logs.log import Log
from ..logs.units import Shown
from ..reports.extent import extent
from ..reports.judged import Judged, recommendation
from ..reports.sections import COLOURS, NAMES, write_changes, write_errors, write_findings
from ..reports.use import write_use
from ..tune.choice import WORTH
from .compensation import write_tracking
from .fit import REPEATS, Fit

__all__ = ["fit_report", "judged_by"]


_SETTLING = (
    " The window after a gap is no test window: no model knows the state of the axis there; a controller has no gaps."
)


def judged_by(fit: Fit, shown: Shown) -> Judged:
    """Return the replay that judges a fit as it is reported, in the units of its logs."""
    period = next((one for one in fit.identification["findings"] if one.startswith(REPEATS)), "")
    return Judged(
        *(fit.judged, fit.machine.T_s, shown, "the log's second half"),
        share=1.0 - fit.share,
        period=period,
        unidentified=any(one.startswith(TOO_LITTLE) for one in fit.identification["findings"]),
    )


def fit_report(fit: Fit, logs: Sequence[Log], findings: Mapping[str, Sequence[Finding]]) -> Report:
    """Return the report.

    Parameters
    ----------
    fit : Fit
    logs : sequence of Log
        As they were used.
    findings : mapping
        Log's name → findings of its intake.
    """
    T_s, Np = fit.machine.T_s, fit.judged.Np
    judged = judged_by(fit, logs[0].shown)
    report = Report(
        f"Axis {fit.machine.name}: from its log to its FMU",
        f"{', '.join(log.path.name for log in logs)} · {extent(logs)} · look-ahead "
        f"{Np} samples, {1e3 * Np * T_s:.4g} ms",
    )
    report.paragraph(recommendation(judged), "verdict")
    write_changes(report, changes(findings))
    write_errors(
        report,
        judged,
        "Tested on held-out samples",
        "The first half of each log trained the physics model and chose the settings; these are the errors of the "
        "second half." + (_SETTLING if any(one.judges_from > one.n_train for one in fit.judged.recordings) else ""),
    )
    _write_other_windows(report, fit, judged)
    write_findings(report, findings)
    _write_identification(report, fit, judged)
    _write_settings(report, fit, judged)
    write_tracking(report, fit.tracking, judged.shown)
    fmus = [path.name for path in fit.files if path.suffix == ".fmu"]
    if fmus:
        write_use(report, fmus, fit.steps, T_s, Np)
        report.paragraph(f"{' and '.join(fmus)} start trained with the log.")
    return report


def _write_other_windows(report: Report, fit: Fit, judged: Judged) -> None:
    report.heading("Errors with other look-aheads")
    scale, unit = judged.unit
    windows = np.array(
        [[one[name] for name in ("Np", "rms_pb", "rms_hold", "rms_h")] for one in fit.windows], np.float64
    )
    lengths = 1e3 * judged.T_s * windows[:, 0]
    lines = [Line(name, lengths, scale * windows[:, 1 + i], COLOURS[i]) for i, name in enumerate(NAMES)]
    lines += [Line("", lengths, scale * windows[:, 3], HYBRID, points=True)]
    report.chart(
        Chart(
            "look-ahead Np·T_s [ms]",
            (f"RMS error [{unit}]",),
            lines,
            "The look-ahead is the controller's; it is not chosen, as a shorter one always looks better.",
        )
    )


def _write_identification(report: Report, fit: Fit, judged: Judged) -> None:
    scale, unit = judged.unit
    found = fit.identification
    report.heading("Physics model")
    report.paragraph(
        f"{found['structure']}, {'zero' if found['input_hold'] == 'zoh' else 'first'}-order hold, dead time "
        f"{found['dead_time']} samples."
    )
    if found["parameters"]:
        rows = [
            [name, f"{value:.6g}", deviation_words(std, "± "), unit]
            for name, value, std, unit in shown_estimates(found["parameters"], judged.shown)
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
        report.paragraph("RMS of the simulated position within the training half.", "dim")
    report.bullets(found["findings"])


def _write_settings(report: Report, fit: Fit, judged: Judged) -> None:
    scale, unit = judged.unit
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
        "Errors of causal replays over the later half of the training samples. The first row, the default, stays "
        f"unless another is better by {100 * WORTH:g} %.",
        "dim",
    )
