"""Intake of a log on the command line: findings are shown, and put right or refused."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..base.errors import LogError, ParameterError
from ..intake.check import Intake, apply, check
from ..intake.finding import ERROR, Finding
from ..logs.log import Log, LogReader, open_log
from ..machines.machine import Machine
from .arguments import check_interval, check_unit
from .failures import errors_console
from .reading_options import ReadingOptions

__all__ = ["Reading", "findings_table", "open_checked", "reading_of", "show", "take_in"]

_REPAIRED = ("time order", "gaps", "jitter", "outliers", "stuck samples", "repeated samples")
"""Findings about samples, not about what they mean: their fixes lose nothing that could be learned from."""

_HOPELESS = "too little motion"
"""Finding that no fix helps; the physics model is then a gain of 1."""

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
    check_unit(path.name, checked, machine)
    intake = check(replace(checked, unit=machine.unit), machine)
    # Times that repeat, as those do that are rounded coarsely, tell no interval
    if not fix and not any(finding.name == "time order" for finding in intake.errors):
        check_interval(path.name, reader.T_s, machine)
    if intake.errors and not (fix or as_is):
        raise LogError(
            f"{path}: figures from this log would mean nothing: {'; '.join(f.words for f in intake.errors)}. Apply the "
            "fixes with --fix, correct the log or the options it is read with, or go on with --as-is"
        )
    show(reader.remarks, intake.findings)
    if fix:
        if reader.n_samples > CHECKED_MAX:
            raise LogError(f"{path}: --fix takes at most {CHECKED_MAX} samples, the log has {reader.n_samples}; cut it")
        fixed = intake.fixed()
        return (fixed if segments else _longest_segment(fixed, path)), intake
    return (reader if as_is else open_log(path, **reading)), intake


def take_in(logs: Sequence[Log], *, fix: bool) -> tuple[list[Log], Mapping[str, tuple[Finding, ...]]]:
    """Return the logs to learn from and all findings, by the log's name: what samples suffer from is repaired.

    Parameters
    ----------
    logs : sequence of Log
        Read with ``uniform=False``.
    fix : bool
        Whether every fix is applied, also those that change what the columns mean.

    Raises
    ------
    LogError
        If the figures from a log would mean nothing, with what would put it right.
    """
    used, all_findings = [], {}
    for log in logs:
        findings = check(log).findings
        applied = [finding for finding in findings if fix or finding.name in _REPAIRED]
        left = [
            finding
            for finding in findings
            if finding.severity == ERROR and finding.name != _HOPELESS and (finding not in applied or not finding.fix)
        ]
        if left:
            hint = " (--fix does it)" if all(finding.fix for finding in left) else ""
            raise LogError(f"{log.path}: " + "; ".join(str(finding) for finding in left) + hint)
        used.append(apply(log, applied))
        all_findings[log.path.name] = findings
    return used, all_findings


def findings_table(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return findings as plain data, for JSON."""
    return [
        {
            "name": finding.name,
            "severity": finding.severity,
            "words": finding.words,
            "evidence": dict(finding.evidence),
            "fix": finding.fix.words if finding.fix else None,
        }
        for finding in findings
    ]


def show(remarks: Iterable[str], findings: Iterable[Finding]) -> None:
    """Print remarks and findings on standard error."""
    for line in [f"note: {remark}" for remark in remarks] + [str(finding) for finding in findings]:
        errors_console.print(line, highlight=False, soft_wrap=True)


def _longest_segment(log: Log, path: Path) -> Log:
    segments = log.segments()
    if len(segments) == 1:
        return log
    longest = max(segments, key=lambda segment: len(segment.t))
    show(
        [f"{path.name}: of {len(segments)} segments the longest, {len(longest.t)} of {len(log.t)} samples, is read"], []
    )
    return longest
