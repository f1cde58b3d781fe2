"""Causes and remedies of the library's errors and of the findings of a log's checks, as the reference page has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Explanation:
    """Cause and remedy of a message."""

    # sentences in Markdown
    cause: str
    remedy: str
    printed: tuple[str, ...] = ()  # words of messages by which a reader finds this entry


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
        "Give finite arrays of equal length. A missing measured position may be NaN with `averaging = true` only.",
        ("must be finite",),
    ),
    "LogError": Explanation(
        "A recorded log cannot be read, or the errors computed from it would be invalid.",
        "The message names file, line and column. Names of columns are given by `--t`, `--x_d`, `--x`, the unit by "
        "`--unit`, the interval of a log without times by `--T_s`. Where it has a finding of the checks, look it up "
        "below; lines to paste follow it.",
        (
            "counts samples: it is an index",
            "is rounded too coarsely",
            "the measured position is missing (NaN) in all",
        ),
    ),
    "MachineError": Explanation(
        "A machine file cannot be read, has an unknown entry or one out of its range, or is inconsistent.",
        "Compare with the reference of [machine files](machine-file.md), or let `hybridsep init` write one.",
        ("give [[physics.mode]] entries, [physics.spring_mass_damper] or [physics.cascade]",),
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
        "ziglang`. A refused archive is named, with the reason.",
    ),
}
"""By class of exception; in the order of the hierarchy in :mod:`hybridsep.base.errors`."""

FINDINGS: Mapping[str, Explanation] = {
    "no motion": Explanation(
        "The commanded or the measured position never changes.",
        "Record the axis while it works, or name other columns (`--x_d`, `--x`).",
    ),
    "too short": Explanation("Fewer than 100 samples are measured.", "Record half a minute of work."),
    "same column": Explanation(
        "The measured position equals the commanded one in every sample: one column was read for both, or the axis was "
        "simulated.",
        "Name the column of the measured position with `--x`.",
    ),
    "wraps": Explanation(
        "A position jumps by 2¹⁶ of its smallest steps, and goes on after the jump as before it: a counter wraps.",
        "Unwrap it before, as by `numpy.unwrap(x, period=...)` with the message's period, or record it with more bits.",
    ),
    "unit": Explanation(
        "Positions that no axis has in metres: too large a travel or acceleration; refused where no unit is stated.",
        "Give `--unit`, or another one.",
    ),
    "columns swapped": Explanation(
        "The commanded position follows the measured one as a drive follows its command, and not the other way round.",
        "Exchange `--x_d` and `--x`, as the line says. Where the measured column is the noisier one, it may have been "
        "recorded too early instead: `--delay`, negative.",
    ),
    "sign": Explanation(
        "The measured position moves opposite to its command; or what `--error` tells runs ahead of it.",
        "Correct it where it is recorded; your controller must do the same. Of an error give the message's option.",
    ),
    "following error": Explanation(
        "The measured position's column holds the following error, which controllers call *lag* or *contouring "
        "deviation*.",
        "Name the column of the actual position with `--x`, or this one with `--error`.",
    ),
    "velocity": Explanation("One of the columns holds a velocity.", "Name the column of the position."),
    "scale": Explanation(
        "The measured position moves by a multiple of the command: the columns are in different units, or the axis "
        "hardly moves.",
        "State the unit of each column in its name, such as `x [mm]`, or name another column with `--x`.",
    ),
    "hardly follows": Explanation(
        "No drive explains the measured position by the command.",
        "Name the column of this axis with `--x`.",
    ),
    "missing samples": Explanation(
        "The measured position is empty or `nan` in some rows.",
        "None is needed with `averaging = true`: they are left out. Without averaging such a log is refused.",
    ),
    "moved at rest": Explanation(
        "The axis moves while its command has rested for 0.3 s, further than its error ever was in motion, and than "
        "its noise at rest: something else moves it, as where a tool or a reel is changed.",
        "None is needed: these samples count as missing, as a compensator would learn them as the command's.",
    ),
    "rate": Explanation(
        "Sampling intervals differ; the rows are taken as if they were even.",
        "Record in the controller's own cycle rather than by a PC's clock, or take it at even times: `--resample`.",
    ),
    "slow samples": Explanation(
        "The samples are more than 0.1 s apart; a drive's controller samples faster.",
        "If milliseconds were read as seconds, state the unit in the column's name, as in `t [ms]`, or give `--T_s`.",
    ),
    "outliers": Explanation(
        "Single samples leave the signal: glitches of the encoder or of the transmission, a sensor that was not ready "
        "yet, a number that is cut off at the file's end.",
        "A run rejects what is out of reach (`averaging = true`); a fit identifies and judges with every sample: leave "
        "wrong measured positions blank in the file.",
    ),
    "begins anew": Explanation(
        "The measured position leaps from one end of its range to the other between two samples, as the position of a "
        "modulo axis in mm does, or a counter of few bits. Whole turns and counters of 16 bits are recognised.",
        "Unwrap both positions before, by the length after which they begin anew, as your controller must do too.",
    ),
    "repeated samples": Explanation(
        "The position was sampled more slowly than the log was written, and unevenly.",
        "Record at the rate of the position's own source.",
    ),
    "stuck samples": Explanation(
        "The measured position stands still while its command goes on: the axis sticks, or the sensor was held.",
        "Look at the positions in the report. An axis that sticks needs none.",
    ),
    "clipped": Explanation(
        "The measured position stands still at one end of its range while its command goes on: the recorder's range "
        "may end there, or friction or load stops the axis.",
        "Look at the positions in the report. Record with a larger range where it was the recorder.",
    ),
    "late": Explanation(
        "The measured position lags its command by more than 0.1 s in all: drive, dead time and recorder. It is "
        "refused where it is above 1 s, nothing states the unit of the times, and read in s no axis is as slow.",
        "None, if the axis is as slow. Times in ms: `--T_s`, or `t [ms]` in the file. Where the recorder is known to "
        "be late by whole samples, give `--delay`; where "
        "the controller gets the measurement as late, `--measurement_delay`.",
    ),
    "offset": Explanation(
        "The two positions differ by more than the error varies: they count from different zeros, or the axis stands "
        "beside its command, as under gravity in a position loop without an integrator. The columns do not tell which.",
        "A prediction needs none: the offset is learned. A compensator moves the axis by it. That is right where the "
        "axis stands beside its command. Where only the zeros differ, take the offset away from the measured column, "
        "and from what the compensator measures, before it moves the axis. Where the offset is ten times what the "
        "error varies by, the limits that `fit` estimates leave it out, and the compensator trips at once.",
    ),
    "start in motion": Explanation(
        "The axis moves when the log begins; the physics model starts from rest.",
        "None is needed: the state is estimated from the first window, which is not judged.",
    ),
}
"""By name of a finding: those for which a log is refused, then those that are noted."""
