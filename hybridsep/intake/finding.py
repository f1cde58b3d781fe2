"""Findings of an intake: what is wrong with a log, the evidence, data for a picture, and a fix."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.messages import FINDINGS
from ..base.signals import Array
from ..logs.log import Log

__all__ = ["ERROR", "HOPELESS", "NAMES", "NOTE", "WARNING", "Finding", "Fix", "Picture", "findings_table"]

ERROR, WARNING, NOTE = "error", "warning", "note"
"""Severities: errors computed from the log are invalid; they are larger than they need be; worth knowing."""

HOPELESS = "too little motion"
"""Finding that no fix helps: the log cannot determine a model."""

NAMES = tuple(FINDINGS)
"""Names of findings in the order in which they are looked for, and fixed."""


@dataclass(frozen=True)
class Fix:
    """Change that puts a log right.

    Attributes
    ----------
    words : str
        What it does, as an imperative.
    change : callable
        Log → log.
    meaning : bool
        Whether positions mean something else afterwards, so that a controller must change its own alike.
    options : tuple of (str, str)
        Options of the command line, one of which puts it right as well, each with what it means.
    """

    words: str
    change: Callable[[Log], Log] = field(repr=False)
    meaning: bool = False
    options: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Picture:
    """Data of a picture that shows a finding.

    Attributes
    ----------
    title : str
    x_label, y_label : str
        With units.
    lines : mapping
        Name → two (n,) arrays, abscissa and ordinate.
    marks : (m,) array
        Abscissae that the finding is about.
    """

    title: str
    x_label: str
    y_label: str
    lines: Mapping[str, tuple[Array, Array]]
    marks: Array = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Finding:
    """What is wrong with a log.

    Attributes
    ----------
    name : str
        One of :data:`NAMES`.
    severity : {"error", "warning", "note"}
    words : str
        What is wrong, by how much, and what it does to the figures.
    evidence : mapping
        Numbers behind the words, by name; SI units.
    picture : Picture
    fix : Fix, optional
        None where only another recording helps.
    applied : bool
        Whether the fix was applied to the log that is used.
    """

    name: str
    severity: str
    words: str
    evidence: Mapping[str, float]
    picture: Picture = field(repr=False)
    fix: Fix | None = None
    applied: bool = False

    def __str__(self) -> str:
        if self.applied and self.fix is not None:
            how, also = ("fixed", "; your controller must do the same") if self.fix.meaning else ("handled", "")
            return f"{how}: {self.name}: {_ended(self.words)} Done: {self.fix.words}{also}."
        return f"{self.severity}: {self.plain}"

    @property
    def plain(self) -> str:
        """What is wrong and what would put it right, without the severity."""
        fix = f" Fix: {self.fix.words}." if self.fix else ""
        return f"{self.name}: {_ended(self.words)}{fix}"


def _ended(words: str) -> str:
    """Return words as a sentence."""
    return words if words.endswith("?") else f"{words}."


def findings_table(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return findings as plain data, for JSON."""
    return [
        {
            "name": finding.name,
            "severity": finding.severity,
            "words": finding.words,
            "evidence": dict(finding.evidence),
            "fix": finding.fix.words if finding.fix else None,
            "applied": finding.applied,
        }
        for finding in findings
    ]
