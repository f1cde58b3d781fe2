"""Causes and remedies of the library's errors and of the findings of a log's checks, as the reference page has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["ERRORS", "FINDINGS", "Explanation"]


@dataclass(frozen=True)
class Explanation:
    """Cause and remedy of a message.

    Attributes
    ----------
    cause, remedy : str
        Sentences in Markdown.
    printed : tuple of str
        Words of messages by which a reader finds this entry.
    """

    cause: str
    remedy: str
    printed: tuple[str, ...] = ()


ERRORS: Mapping[str, Explanation] = {
    "HybridSepError": Explanation(
        "Base class of all errors below; `except HybridSepError` catches each of them.",
        "On the command line an error is one line and exit status 2.",
    ),
    "ParameterError": Explanation(
        "A parameter is out of its range, or several do not fit together. The message has the range and the value. It "
        "is a `ValueError` too.",
        "Change the value; ranges are in the reference of [machine files](machine-file.md) and [FMUs](fmu.md).",
        ("lower p or raise Np", "spacing must be ≥ 1 and divide Np"),
    ),
    "SignalError": Explanation(
        "Samples cannot be used: NaN or infinite values, a wrong shape or length.",
        "Give finite arrays of equal length. A missing measured position may be NaN with `trust = true` alone.",
        ("must be finite",),
    ),
    "LogError": Explanation(
        "A recorded log cannot be read, or the errors computed from it would be invalid.",
        "The message names file, line and column. Names of columns are given by `--t`, `--x_d`, `--x`, the unit by "
        "`--unit`, the interval of a log without times by `--T_s`. Where it lists findings of the checks, look them up "
        "below; `--fix` applies their fixes, `--as-is` (of `backtest`, `report` and `tune`) goes on without.",
        (
            "must increase",
            "counts samples: it is an index",
            "must be uniform: an interval of",
            "errors computed from this log would be invalid",
            "the measured position is missing (NaN) in all",
        ),
    ),
    "MachineError": Explanation(
        "A machine file cannot be read, has an unknown entry or one out of its range, or is inconsistent.",
        "Compare with the reference of [machine files](machine-file.md), or let `hybridsep init` write one.",
        ("give either [[physics.mode]] entries or one [physics.spring_mass_damper]",),
    ),
    "ModelError": Explanation(
        "A linear model is unstable, improper, or cannot be written as a sum of modes, eq. (15).",
        "Give a stable, strictly proper single-input single-output system without repeated poles.",
    ),
    "IdentificationError": Explanation(
        "A recording or a frequency response cannot determine a model: too little motion, too few samples or lines, no "
        "resonance, no coherence.",
        "Record more motion, see [how to record a log](../howto/record.md). `hybridsep fit` then goes on with a gain "
        "of 1.",
        ("cannot determine a model, because",),
    ),
    "StateError": Explanation(
        "A saved state or trained weights are damaged, of another version, or were learned with other settings, which "
        "the message names.",
        "Train again (`hybridsep fit`, or `backtest --save`), or use the settings that the message names.",
    ),
    "FmuError": Explanation(
        "An FMU cannot be built, read or loaded, or a call came that FMI does not allow in the present state.",
        "A native FMU takes its libraries from the installation; where they could not be compiled then, `pip install "
        "ziglang`, or build with `--flavour python`. A refused archive is named, with the reason.",
    ),
}
"""By class of exception; in the order of the hierarchy in :mod:`hybridsep.base.errors`."""

FINDINGS: Mapping[str, Explanation] = {
    "time order": Explanation(
        "Times repeat or run backwards: rows written twice, a clock that was set back, or times rounded more coarsely "
        "than the sampling interval.",
        "`--fix` sorts and keeps one row of each time. If times are rounded, remove the column and give `--T_s`.",
    ),
    "whole turns": Explanation(
        "A rotary axis was recorded modulo one turn: it jumps by whole turns.",
        "`--fix` unwraps both positions; your controller must count turns the same way.",
    ),
    "gaps": Explanation(
        "Stretches of time without samples: the recorder lost data, or was stopped.",
        "Gaps of at most 10 samples are bridged with `trust = true`, longer ones separate segments. Record without "
        "interruption.",
    ),
    "jitter": Explanation(
        "Sampling intervals differ; the model assumes equal ones.",
        "`--fix` resamples. Record in the controller's own cycle rather than by a PC's clock.",
    ),
    "lost rows": Explanation(
        "Rows are missing although the times are even: both positions make a step that is a multiple of the "
        "neighbouring ones.",
        "`--fix` inserts the rows as missing. Check the recorder for a buffer overflow.",
    ),
    "missing samples": Explanation(
        "The measured position is empty or `nan` in some rows.",
        "None is needed with `trust = true`, which treats them as missing. Without trust, `--fix` interpolates.",
    ),
    "jumps": Explanation(
        "Both positions jump within one sample, as where two logs were joined, or the command alone jumps.",
        "`--fix` splits the log at the jump. A step in the command alone needs no remedy.",
    ),
    "outliers": Explanation(
        "Single samples are far from their neighbours: glitches of the encoder or of the transmission.",
        "Repaired by `fit` and `--fix`, which interpolate. With `trust = true` reach rejects them online.",
    ),
    "clipped": Explanation(
        "The measured position stops dead at a limit and leaves it at speed, while the command moves on, at both ends "
        "or many times, though the axis had followed closer before: the recorder's range ends there. As a note: it "
        "stands there once or by less, as an axis does that friction or load keeps from its command.",
        "`--fix` treats the samples as missing. Record with a larger range or another scaling. A note needs none.",
    ),
    "stuck samples": Explanation(
        "The measured position stands still and then jumps: the sensor or its transmission froze.",
        "Repaired by `fit` and `--fix`, which cut the stretch out.",
    ),
    "repeated samples": Explanation(
        "Each value occurs several times in a row: the position was sampled more slowly than the log was written.",
        "`--fix` keeps every n-th sample. Record at the rate of the position's own source.",
    ),
    "too little motion": Explanation(
        "The command hardly moves, or moves less than the noise: nothing can be identified or learned.",
        "No fix helps: record the axis at work. `hybridsep fit` goes on with a gain of 1.",
    ),
    "same column": Explanation(
        "The measured position equals the commanded one in every sample: one column was read for both, or the axis was "
        "simulated.",
        "Name the columns with `--x_d` and `--x`.",
    ),
    "columns swapped": Explanation(
        "The column of the commanded position lags behind the measured position's column and is noisier.",
        "Exchange `--x_d` and `--x`, or let `--fix` do it.",
    ),
    "following error": Explanation(
        "The measured position's column holds the following error, which controllers call *lag* or *contouring "
        "deviation*.",
        "`--fix` computes the position from it; recording the actual position is better.",
    ),
    "velocity for position": Explanation(
        "One of the columns holds a velocity.",
        "Name the column of the position. `--fix` integrates, which drifts.",
    ),
    "sign": Explanation(
        "The measured position moves opposite to its command: its static gain is negative.",
        "`--fix` reverses the sign; your controller must do the same.",
    ),
    "scale": Explanation(
        "The measured position moves by a multiple of the command: a wrong unit, resolution or gear ratio.",
        "`--fix` multiplies where the factor is unambiguous; give `--unit`, or correct the scaling. A gain between "
        "0.15 and 1 is only a note: a soft servo has one.",
    ),
    "offset": Explanation(
        "The zeros of the two positions are far apart.",
        "`--fix` subtracts the difference; your controller must do the same.",
    ),
    "unit": Explanation(
        "The positions are not plausible in the unit that was read: the travel or the velocity is too large.",
        "Give `--unit`; `--fix` reads both positions as millimetres.",
    ),
    "start in motion": Explanation(
        "The axis moves when the log begins; the physics model starts from rest.",
        "With `trust = true` the state is estimated from the first window. `--fix` begins at the first rest.",
    ),
    "delay": Explanation(
        "The measured position is late by more than the model explains, or early.",
        "If you know that the encoder is late by whole samples, give `--measurement_delay`; `dead_time` must not count "
        "those samples again.",
    ),
    "sampling rate": Explanation(
        "The log is sampled too slowly for the model's fastest mode, or at another interval than the machine's.",
        "Record at the controller's rate. `--fix` resamples where only the interval differs.",
    ),
}
"""By name of a finding, in the order in which they are looked for, and fixed."""
