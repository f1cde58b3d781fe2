"""Intake of a log on the command line: findings are shown, and fixed or refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import LogError, ParameterError
from ..intake.check import Intake, apply, check
from ..intake.finding import Finding
from ..intake.repair import MISSING, applied, check_measured, options_of
from ..intake.times import BRIDGED_MAX
from ..logs.log import Log, LogReader, open_log
from ..machines.agree import check_interval, check_unit
from ..machines.machine import Machine
from .failures import errors_console
from .options import ReadingOptions

__all__ = ["Reading", "different_logs", "open_checked", "reading_of", "show"]

CHECKED_MAX = 2_000_000
"""Samples that are checked at most; a longer log is replayed in bounded memory all the same."""

Reading = Mapping[str, Any]
"""Arguments of :func:`~hybridsep.logs.log.open_log`."""


def reading_of(machine: Machine, options: ReadingOptions, *, may_miss: bool) -> Reading:
    """Return how a log of a machine is read: as its machine file says, where an option does not say otherwise.

    Parameters
    ----------
    machine : Machine
    options : ReadingOptions
    may_miss : bool
        Whether positions may be missing.
    """
    own = machine.log
    names = {**own.columns, **options.columns}
    if options.T_s is not None and options.t is None:
        names.pop("t", None)  # there may be none
    return {
        "columns": names,
        "unit": options.unit or own.unit,
        "T_s": options.T_s,
        "axis": options.axis or own.axis,
        "may_miss": may_miss,
        "resample": options.resample,
    }


def open_checked(
    path: Path, reading: Reading, machine: Machine, *, fix: bool, as_is: bool, segments: bool = False
) -> tuple[LogReader | Log, Intake]:
    """Open a log and check it.

    Parameters
    ----------
    path : Path
    reading : mapping
        How it is read.
    machine : Machine
        Whose log it is.
    fix : bool
        Whether the fixes of all findings are applied.
    as_is : bool
        Whether it is taken with the faults that it has.
    segments : bool
        Whether a fixed log may have several segments; else the longest is taken.

    Returns
    -------
    log : LogReader or Log
        The log; with ``fix`` the fixed one.
    intake : Intake

    Raises
    ------
    LogError
        If the log cannot be read, or has a fault that makes figures flatter and is neither fixed nor taken as it is.
    ParameterError
        If it is both.
    """
    if fix and as_is:
        raise ParameterError("--fix and --as-is exclude each other")
    reader = open_log(path, **reading, uniform=False)
    checked = reader.read(CHECKED_MAX)
    check_measured(checked)
    check_unit(path.name, checked, machine)
    trust = bool(reading.get("may_miss"))
    intake = check(replace(checked, unit=machine.unit), machine, bridged=BRIDGED_MAX if trust else 0)
    # Times that repeat, because they are rounded coarsely, tell no interval
    if not fix and not any(finding.name == "time order" for finding in intake.errors):
        check_interval(path.name, reader.T_s, machine)
    if intake.errors and not (fix or as_is):
        error = LogError(
            f"{path}: errors computed from this log would be invalid: {'; '.join(f.words for f in intake.errors)}. "
            "Apply the fixes with --fix, correct the log or the options it is read with, or go on with --as-is"
        )
        error.options = options_of(intake.errors)
        raise error
    if fix:
        intake = replace(intake, findings=tuple(applied(finding) for finding in intake.findings))
    show(reader.remarks, intake.findings)
    if fix:
        if reader.n_samples > CHECKED_MAX:
            raise LogError(f"{path}: --fix takes at most {CHECKED_MAX} samples, the log has {reader.n_samples}; cut it")
        if not trust and any(finding.name == "gaps" for finding in intake.findings):
            bridged = f"with trust (--trust true) gaps of at most {BRIDGED_MAX} samples are bridged"
            show([f"every gap cuts, as the model has trust = false; {bridged}"], [])
        fixed = apply(intake.log, (finding for finding in intake.findings if finding.name != MISSING))
        return (fixed if segments else _longest_segment(fixed, path)), intake
    if not (as_is or reader.is_even):  # behind what was checked
        open_log(path, **reading)
    return reader, intake


def different_logs(logs: Sequence[Log]) -> list[Log]:
    """Return the logs, leaving out and reporting each that has the samples of an earlier one."""
    kept: list[Log] = []
    for log in logs:
        same = [
            one
            for one in kept
            if np.array_equal(one.x_d, log.x_d) and np.array_equal(one.x_meas, log.x_meas, equal_nan=True)
        ]
        if same:
            show([f"{log.path} has the samples of {same[0].path}: it counts once"], ())
        else:
            kept.append(log)
    return kept


def show(remarks: Iterable[str], findings: Iterable[Finding]) -> None:
    """Print remarks and findings on standard error."""
    for line in [f"note: {remark}" for remark in remarks] + [str(finding) for finding in findings]:
        errors_console.print(line, soft_wrap=True)


def _longest_segment(log: Log, path: Path) -> Log:
    segments = log.segments()
    if len(segments) == 1:
        return log
    longest = max(segments, key=lambda segment: len(segment.t))
    show(
        [f"{path.name}: of {len(segments)} segments the longest, {len(longest.t)} of {len(log.t)} samples, is read"], []
    )
    return longest
