"""Section of a report on the use of its FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..evaluate.report import Report

__all__ = ["write_use"]


def write_use(report: Report, fmus: Iterable[str], steps: Mapping[str, float], T_s: float, Np: int) -> None:
    """Write how FMUs are used, and how long a step of the first takes.

    Parameters
    ----------
    report : Report
    fmus : iterable of str
        Names of their files.
    steps : mapping
        As of :func:`~hybridsep.reports.step_times.step_times`.
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

# x_d, x_meas: commanded and measured positions of a log, m or rad, one sample every {T_s!r} s:
# log = hybridsep.read_log("my_axis.csv"); x_d, x_meas = log.x_d, log.x_meas
signals = np.zeros(len(x_d) + {Np}, [("time", float), ("x_d_ahead", float), ("x_meas", float)])
signals["time"] = {T_s!r} * np.arange(len(signals))
signals["x_d_ahead"] = np.pad(x_d, (0, {Np}), mode="edge")  # enters {Np} samples before it is commanded ...
signals["x_meas"] = np.pad(x_meas, ({Np}, 0), mode="edge")  # ... and measured
result = simulate_fmu("{fmu}", stop_time=signals["time"][-1], output_interval={T_s!r},
                      input=signals, output=["x_d", "x_h", "x_h_std", "e_servo"])"""
"""Replay of a log with fmpy."""


def _duration(seconds: float) -> str:
    """Return a duration in ms, or in µs if it is shorter."""
    return f"{1e3 * seconds:.3g} ms" if seconds >= 1e-3 else f"{1e6 * seconds:.3g} µs"
