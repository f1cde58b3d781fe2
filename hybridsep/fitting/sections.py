"""Sections of the reports of a fit and of a replay: how good, how sure, what was found, and how to use it."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from ..base.metrics import coverage, moves_of
from ..base.signals import Array
from ..evaluate.html_report import HOLD, HYBRID, PHYSICS, Chart, Line, Report
from ..identify.model import IdentifiedModel
from ..identify.validation import FrequencyResponse, ResidualTest, frequency_response, model_response, residual_test
from ..logs.checks import Finding
from ..logs.log import Log
from ..logs.units import stated_unit
from .advice import OF_ITSELF, Judged, advice_on, extent, peers_in_words
from .lags import WORTH, Tried

_NAMES = ("physics model", "hold the last residual", "hybrid")  # names of what a replay predicts by
_COLOURS = (PHYSICS, HOLD, HYBRID)  # their colours
_COMMAND = "#1d2733"


def begun_report(title: str, logs: Sequence[Log], judged: Judged, heading: str, how: str) -> Report:
    """Return a report with what to do, and the sections on errors, their ``heading`` and how they came about."""
    Np = judged.replay.Np
    names, look_ahead = ", ".join(log.path.name for log in logs), 1e3 * Np * judged.T_s
    report = Report(title, f"{names} · {extent(logs)} · look-ahead {Np} samples, {look_ahead:.4g} ms")
    report.paragraph(advice_on(judged), "verdict")
    report.heading(heading)
    report.table(*judged.figures())
    report.paragraph(
        f"{how} Each window was predicted before any of its samples was known, as in the machine. "
        f"{peers_in_words(judged)}",
        "dim",
    )
    report.bullets(line.rstrip(".") for line in str(judged.replay.verdict()).splitlines())
    if said := judged.of_the_controller():
        report.heading(OF_ITSELF)
        report.bullets(said)
    if not np.isnan(judged.replay.errors()[0]).all():  # else nothing judges
        _write_time(report, judged)
        _write_horizon(report, judged)
        _write_spectra(report, judged)
    return report


def write_identification(report: Report, found: IdentifiedModel, judged: Judged) -> None:
    """Write the physics model: its structure, parameters, the structures that were tried, and findings."""
    scale, unit = judged.unit
    report.heading("Physics model")
    report.paragraph(
        f"{found.structure}, {'zero' if found.input_hold == 'zoh' else 'first'}-order hold, dead time "
        f"{found.model.dead_time} samples."
    )
    if found.parameters:
        rows = []
        for one in found.parameters:
            factor, name = judged.shown.error(abs(one.value)) if one.unit in ("m", "rad") else (1.0, one.unit)
            std = f"± {factor * one.std:.2g}" if one.std > 0 else "fixed"
            rows.append([one.name, f"{factor * one.value:.6g}", std, name])
        report.table(["parameter", "value", "standard deviation", "unit"], rows)
    if found.alternatives:
        rows = []
        for other in found.alternatives:
            errors = (f"{scale * rms:.4g}" for rms in (other.rms_fitted, other.rms_held_out))
            verdict = other.objection or ("chosen" if other.name == found.structure else "")
            rows.append([other.name, str(other.n_parameters), *errors, verdict])
        report.table(["structure", "parameters", f"fitted [{unit}]", f"held out [{unit}]", ""], rows, words=4)
        report.paragraph("RMS of the simulated position within the training half.", "dim")
    report.bullets(found.findings)


def write_validation(report: Report, found: IdentifiedModel, judged: Judged) -> None:
    """Write the model's Bode plot over the response of the whole log, and tests of its residual over the test samples.

    A section of which the log has too few samples in a row, or no motion, is left out.
    """
    replay, model, T_s = judged.replay, found.model, judged.T_s
    if (log := frequency_response(replay.modelled(), T_s, model, found.input_hold)) is not None:
        report.heading("Bode plot")
        report.chart(_bode_plot(log, partial(model_response, model, T_s, found.input_hold)))
    if (test := residual_test(replay.modelled(tested=True), replay.Np)) is not None:
        report.heading("Residual of the physics model")
        report.chart(_correlations(test, 1e3 * T_s))


def _bode_plot(log: FrequencyResponse, model: Callable[[Array], NDArray[np.complex128]]) -> Chart:
    f, known = log.f, log.known
    limit = float(f[known].max(initial=0.0))
    drawn = np.union1d(*(space(f[0], min(f[-1], 4.0 * limit or f[-1]), 600) for space in (np.geomspace, np.linspace)))
    curve, ratio = model(drawn), np.where(known, log.G / log.expected, np.nan)
    angle, off = np.unwrap(np.angle(curve)), np.abs(ratio)
    half = np.minimum(log.half, 0.5)  # no more is known
    turned = np.interp(f, drawn, angle) + np.angle(ratio)  # on the model's turn
    edges = off * (1.0 - half), off, off * (1.0 + half)
    panels = (
        (20.0 * np.log10(np.abs(curve)), 20.0 * np.log10(np.abs(log.expected) * edges)),
        (np.degrees(angle), np.degrees((turned - half, turned, turned + half))),
    )
    above = f"above {limit:.3g} Hz" if limit else "at any frequency"
    tested = drawn < limit
    lines = [Line("", f, log.coherence, _COMMAND, panel=2)]
    for panel, (of_model, (low, y, high)) in enumerate(panels):
        names = ("",) * 4 if panel else ("95 % interval", "log", "model", f"model, not tested: no power {above}")
        lines += [
            Line(names[0], f, low, HYBRID, upper=high, panel=panel),
            Line(names[1], f, y, HYBRID, points=True, panel=panel),
            Line(names[2], drawn[tested], of_model[tested], PHYSICS, panel=panel),
            Line(names[3], drawn[~tested], of_model[~tested], HOLD, panel=panel),
        ]
    how = (
        f"Measured over commanded position of the whole log, {log.n_segments} segments of {1.0 / f[0]:.3g} s, drawn "
        f"where the command has power enough to tell it to 25 %. It has none {above} to test the model."
    )
    if limit:
        worst = int(np.nanargmax(np.abs(ratio - 1.0)))
        decibels: Array = 20.0 * np.log10(off)
        how += (
            f" Below, the log differs from the model by {np.nanmedian(np.abs(decibels)):.2g} dB in the median, and "
            f"most at {f[worst]:.3g} Hz, by {decibels[worst]:+.2g} dB and {np.degrees(np.angle(ratio[worst])):+.2g}°."
        )
    return Chart("frequency [Hz]", ("magnitude [dB]", "phase [°]", "coherence γ²"), lines, how, x_log=True)


def _correlations(test: ResidualTest, T_s: float) -> Chart:
    """Return the correlations, ``T_s`` in ms."""
    lag: Array = T_s * np.arange(float(len(test.autocorrelation)))
    band, of_command = np.full(len(lag), test.band), test.command_band
    box = f"(Ljung-Box {test.ljung_box:.3g} over {len(lag) - 1} lags, 99 % of white ones: {test.of_white:.3g})"
    most = int(np.argmax(np.abs(test.with_command) - of_command))
    r, limit = test.with_command[most], of_command[most]
    words = [
        f"The residual may be white {box}: a hybrid has nothing to learn of its past."
        if test.ljung_box <= test.of_white
        else f"The residual is not white {box}: its past tells its future, which is what the hybrid learns.",
        "It may be independent of the command: what is left is noise or disturbance."
        if abs(r) <= limit
        else f"It depends on the command (correlation {r:.2g} at {lag[most]:.3g} ms, where chance has ± {limit:.2g}): "
        "friction, or dynamics that the model lacks.",
        "The second panel is of residual and commanded velocity after a filter that makes the residual white.",
    ]
    lines = [
        Line("99 % of white residuals", lag, -band, HOLD, upper=band),
        Line("with itself", lag, test.autocorrelation, PHYSICS),
        Line("99 % of residuals independent of the command", lag, -of_command, HYBRID, upper=of_command, panel=1),
        Line("with the commanded velocity before it", lag, test.with_command, HYBRID, panel=1),
    ]
    return Chart("lag [ms]", ("correlation",) * 2, lines, " ".join(words))


def write_settings(report: Report, choice: Sequence[Tried], judged: Judged) -> None:
    """Write the settings that were tried."""
    scale, unit = judged.unit
    report.heading("Settings")
    rows = []
    for one in choice:
        rms = f"{scale * one.rms_h:.4g}" if math.isfinite(one.rms_h) else "diverged"
        rows.append([str(one.p), str(one.q), rms, "chosen" if one.chosen else ""])
    report.table(["p", "q", f"RMS [{unit}]", ""], rows)
    report.paragraph(
        "Errors of causal replays over the later half of the training samples. The first row, the default, stays "
        f"unless another is better by {100 * WORTH:g} %.",
        "dim",
    )


def _write_time(report: Report, judged: Judged) -> None:
    (scale, unit), replay = judged.unit, judged.replay
    errors, std = scale * replay.errors(), scale * replay.joined("x_h_std")
    t = judged.T_s * np.arange(errors.shape[1])
    factor, position = judged.shown.position
    lines = [Line("command", t, factor * replay.commands(), _COMMAND)]
    within = coverage(errors[2], std, 0.95)
    lines += [Line(_NAMES[i], t, errors[i], _COLOURS[i], panel=1) for i in (0, 2)]
    half = np.minimum(1.96 * std, 1.2 * np.nanmax(np.abs(errors)))  # at first it may be far wider than any error
    lines.append(Line("95 % interval of the hybrid", t, -half, HYBRID, upper=half, panel=1))
    tested = np.cumsum([max(len(one.x) - one.first_judged(replay.Np), 0) for one in replay.recordings])
    pieces = [piece for line in lines for piece in line.cut(tested[:-1].tolist())]
    how = (
        f"The hybrid states its own standard deviation with each window; {100 * within:.0f} % of the errors are within "
        "its 95 % interval."
    )
    panels = (f"command [{position}]", f"error x − x̂ [{unit}]")
    report.heading("Errors over time")
    report.chart(Chart(f"time in {judged.part} [s]", panels, pieces, how))


def _write_horizon(report: Report, judged: Judged) -> None:
    report.heading("Errors over the look-ahead")
    scale, unit = judged.unit
    horizon = scale * judged.replay.horizon()
    ahead = 1e3 * judged.T_s * np.arange(1, judged.replay.Np + 1)
    lines = [Line(name, ahead, row, colour) for name, row, colour in zip(_NAMES, horizon, _COLOURS, strict=True)]
    report.chart(Chart("ahead [ms]", (f"RMS error [{unit}]",), lines, "How the error grows within the window."))


def _write_spectra(report: Report, judged: Judged) -> None:
    scale, unit = judged.unit
    errors = judged.replay.errors()
    errors = errors[:, ~np.isnan(errors[0])]
    if errors.shape[1] < 64:
        return
    f, power = welch(errors, 1.0 / judged.T_s, nperseg=min(2048, errors.shape[1]))
    amplitude: Array = scale * np.sqrt(power)
    lines = [Line(name, f[1:], row[1:], colour) for name, row, colour in zip(_NAMES, amplitude, _COLOURS, strict=True)]
    report.heading("Spectra of the errors")
    report.chart(Chart("frequency [Hz]", (f"density [{unit}/√Hz]",), lines, x_log=True, y_log=True))


def write_moves(report: Report, judged: Judged, in_position: float) -> None:
    """Write how long the moves of the test samples take to settle within a window, m, and the five worst."""
    pieces = judged.replay.modelled(tested=True)
    moves = [one for x_d, x, _ in pieces for one in moves_of(x_d, x, judged.T_s, in_position)]
    if not moves:
        return
    report.heading("Moves as recorded")
    settled = [1e3 * one.settling for one in moves if math.isfinite(one.settling)]
    times = f"{np.median(settled):.3g} ms in the median, {max(settled):.3g} ms at most" if settled else "none did"
    within = judged.shown.words(in_position)
    report.paragraph(f"Of {len(moves)} moves {len(settled)} settled within {within} before the next: {times}.")
    worst = sorted(moves, key=lambda one: -one.largest)[:5]
    report.table(
        ["begins [s]", "largest servo error", "settles [ms]"],
        [[f"{one.start:.3f}", judged.shown.words(one.largest), f"{1e3 * one.settling:.3g}"] for one in worst],
    )


def write_findings(report: Report, logs: Sequence[Log], findings: Mapping[str, Sequence[Finding]]) -> None:
    """Write how the logs were read, and what their checks noted, by the log's name, above both positions over time."""
    report.heading("What the checks of the log noted")
    remarks = [f"{log.path.name}: {remark}" for log in logs for remark in log.remarks]
    report.bullets(remarks)
    if not any(findings.values()):
        other = " else" if remarks else ""
        report.paragraph(f"Nothing{other}: time axis, samples, signs, scales and motion are plausible.")
    for log in (one for one in logs if findings.get(one.path.name)):
        rows = [[one.name, one.plain.partition(": ")[2]] for one in findings[log.path.name]]
        report.table([log.path.name, "note"], rows, words=1)
        (factor, unit), positions = log.shown.position, {"commanded": log.x_d, "measured": log.x_meas}
        lines = [
            piece
            for (name, x), colour in zip(positions.items(), (_COMMAND, PHYSICS), strict=True)
            for piece in Line(name, log.t - log.t[0], factor * x, colour).cut(log.starts[1:])
        ]
        report.chart(Chart("time [s]", (f"position [{unit}]",), lines, "As recorded."))


def write_use(report: Report, fmu: str, T_s: float, Np: int, log: Log) -> None:
    """Write how the FMU of a predictor in a file of that name is used.

    ``T_s`` is the sampling interval, s, ``Np`` the samples of the look-ahead, ``log`` the one that it replays.
    """
    report.heading("Use it")
    reading = f'log = hybridsep.read_log("{log.path.name}", columns={dict(log.columns)}'
    unit = "" if stated_unit(next(iter(log.columns.values())))[1] else log.file_unit
    reading += "".join(f", {name}={value!r}" for name, value in (("unit", unit), ("T_s", log.T_recorded)) if value)
    of_file = f"import hybridsep\n\n{reading})\nx_d, x_meas = log.x_d, log.x_meas"
    in_memory = f"# x_d, x_meas: the arrays of the fit in {log.unit}, one sample every {T_s!r} s"
    report.code(_REPLAY.format(fmu=fmu, T_s=T_s, Np=Np, log=of_file if log.path.suffix else in_memory))
    report.paragraph(
        f"In a simulation tool: co-simulation with a step of {T_s:g} s. x_d_ahead is the trajectory, as many samples "
        "early as the look-ahead is long; wire x_d to the drive, and its measured position to x_meas: the FMU is the "
        "look-ahead buffer."
    )


_REPLAY = """\
import numpy as np
from fmpy import simulate_fmu

{log}
signals = np.zeros(len(x_d) + {Np}, [("time", float), ("x_d_ahead", float), ("x_meas", float)])
signals["time"] = {T_s!r} * np.arange(len(signals))
signals["x_d_ahead"] = np.pad(x_d, (0, {Np}), mode="edge")  # enters {Np} samples before it is commanded ...
signals["x_meas"] = np.pad(x_meas, ({Np}, 0), mode="edge")  # ... and measured
result = simulate_fmu("{fmu}", stop_time=signals["time"][-1], output_interval={T_s!r},
                      input=signals, output=["x_d", "x_h", "x_h_std", "e_servo"])"""
"""Replay of a log with fmpy."""
