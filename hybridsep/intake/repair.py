"""Logs to learn from: what samples suffer from is repaired, what columns would mean is refused or changed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..base.errors import LogError
from ..logs.log import Log
from .check import apply, check
from .finding import ERROR, HOPELESS, Finding

__all__ = ["MISSING", "applied", "changed_by", "changes", "check_measured", "options_of", "take_in"]

_REPAIRED = ("time order", "gaps", "jitter", "lost rows", "outliers", "stuck samples", "repeated samples")
"""Findings about samples, not about what they mean: their fixes lose nothing that could be learned from."""

MISSING = "missing samples"
"""Finding whose fix interpolates what a replay with trust takes as missing, and an identification leaves out."""


def take_in(logs: Sequence[Log], *, fix: bool) -> tuple[list[Log], Mapping[str, tuple[Finding, ...]]]:
    """Return the logs to learn from and all findings, by the log's name: what samples suffer from is repaired.

    Parameters
    ----------
    logs : sequence of Log
        Read with ``uniform=False``.
    fix : bool
        Whether every fix is applied, also fixes that change what the columns mean. Missing measurements stay missing.

    Raises
    ------
    LogError
        If errors computed from a log would be invalid, with what would put it right.
    """
    used, all_findings = [], {}
    for log in logs:
        check_measured(log)
        _check_motion(log)
        findings = check(log).findings
        repaired = [finding for finding in findings if (fix and finding.name != MISSING) or finding.name in _REPAIRED]
        left = [
            finding
            for finding in findings
            if finding.severity == ERROR and finding.name != HOPELESS and (finding not in repaired or not finding.fix)
        ]
        if left:
            hint = " (--fix does it)" if all(finding.fix for finding in left) else ""
            error = LogError(f"{log.path}: " + "; ".join(finding.plain for finding in left) + hint)
            error.options = options_of(left)
            raise error
        used.append(apply(log, repaired))
        all_findings[log.path.name] = tuple(applied(one) if one in repaired else one for one in findings)
    return used, all_findings


def _check_motion(log: Log) -> None:
    """Raise LogError if the axis is never commanded to move, or never moves."""
    still = [name for name, x in (("commanded", log.x_d), ("measured", log.x_meas)) if np.nanmax(x) == np.nanmin(x)]
    if still:
        raise LogError(
            f"{log.path}: the {' and the '.join(still)} position never change{'s' if len(still) == 1 else ''}: an axis "
            "at rest shows neither its model nor its errors; record it while it moves over the travel that is used, or "
            "name other columns (--x_d NAME, --x NAME)"
        )


def options_of(findings: Iterable[Finding]) -> tuple[tuple[str, str], ...]:
    """Return the options of the command line that put findings right, each with what it means."""
    return tuple(option for finding in findings if finding.fix for option in finding.fix.options)


def check_measured(log: Log) -> None:
    """Raise LogError if no position was measured at all."""
    if np.isnan(log.x_meas).all():
        raise LogError(
            f"{log.path}: the measured position is missing (NaN) in all {len(log.t)} samples; name its column (--x), "
            "or record it"
        )


def applied(finding: Finding) -> Finding:
    """Return a finding as one whose fix, if it has one, was applied."""
    return replace(finding, applied=finding.fix is not None)


def changes(findings: Mapping[str, Iterable[Finding]]) -> list[str]:
    """Return the fixes, by log, after which positions mean something else: the controller's must be changed alike."""
    return [
        f"{name}: {finding.name}: {finding.fix.words}; the controller must do the same"
        for name, found in findings.items()
        for finding in found
        if finding.applied and finding.fix is not None and finding.fix.meaning
    ]


def changed_by(findings: Iterable[Finding]) -> str:
    """Return the names of the fixes after which positions mean something else, for a headline; empty without any."""
    names = [one.name for one in findings if one.applied and one.fix is not None and one.fix.meaning]
    return f", positions changed (--fix: {', '.join(names)})" if names else ""
