"""Intake of the logs of ``hybridsep fit``: what is repaired by itself, and what needs the user's word."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..base.errors import LogError
from ..intake.check import apply, check
from ..intake.finding import ERROR, Finding
from ..logs.log import Log

__all__ = ["take_in"]

_REPAIRED = ("time order", "gaps", "jitter", "outliers", "stuck samples", "repeated samples")
"""Findings about samples, not about what they mean: their fixes lose nothing that could be learned from."""

_HOPELESS = "too little motion"
"""Finding that no fix helps; the physics model is then a gain of 1."""


def take_in(logs: Sequence[Log], *, fix: bool) -> tuple[list[Log], Mapping[str, tuple[Finding, ...]]]:
    """Return the logs to use and all findings, by the log's name.

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
            hint = " (hybridsep fit --fix does it)" if all(finding.fix for finding in left) else ""
            raise LogError(f"{log.path}: " + "; ".join(str(finding) for finding in left) + hint)
        used.append(apply(log, applied))
        all_findings[log.path.name] = findings
    return used, all_findings
