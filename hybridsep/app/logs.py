"""Logs on the command line: read as a machine's, checked, and what was found is shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import LogError
from ..logs.checks import Finding, checked
from ..logs.log import Log, read_log
from ..logs.remedies import Samples, whole_turns
from ..machines.machine import Machine, check_interval, check_unit
from .console import errors_console
from .options import ReadingOptions

__all__ = ["Reading", "different_logs", "read_checked", "reading_of", "show"]

Reading = Mapping[str, Any]
"""Arguments of :func:`~hybridsep.logs.log.read_log`."""


def reading_of(machine: Machine, options: ReadingOptions) -> Reading:
    """Return how a log of a machine is read: as its machine file says, where an option does not say otherwise."""
    own = machine.log
    names = {**own.columns, **options.columns}
    if options.T_s is not None and options.t is None:
        names.pop("t", None)  # there may be none
    given = options.arguments
    return {**given, "columns": names, "unit": options.unit or own.unit, "axis": options.axis or own.axis}


def read_checked(path: Path, reading: Reading, machine: Machine, *, may_miss: bool) -> tuple[Log, tuple[Finding, ...]]:
    """Read a log of a machine and check it; what was found is shown.

    Parameters
    ----------
    path : Path
    reading : mapping
        How it is read.
    machine : Machine
        Whose log it is.
    may_miss : bool
        Whether measured positions may be missing.

    Raises
    ------
    LogError
        If the log cannot be read, its columns mean something else, or a measurement misses.
    ParameterError
        If it is sampled otherwise than the machine, or in another unit.
    """
    log = read_log(path, **reading)
    check_unit(path.name, log, machine)
    log = replace(log, unit=machine.unit)
    if log.unit == "rad":  # where the file states none
        turned, said = whole_turns(Samples(log.t, log.x_d, log.x_meas, log.T_s, log.starts))
        log = replace(log, x_d=turned.x_d, x_meas=turned.x_meas, remarks=(*log.remarks, *([said] if said else [])))
    check_interval(path.name, log.T_s, machine)
    if not may_miss and np.isnan(log.x_meas).any():
        first = int(np.argmax(np.isnan(log.x_meas)))
        raise LogError(
            f"{path}: measured position {first + 1} is missing; it is replayed with averaging alone (--averaging true)"
        )
    findings = checked(log)
    show(log.remarks, findings)
    return log, findings


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
