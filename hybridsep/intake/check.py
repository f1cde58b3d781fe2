"""Intake of a log: every check, each on what the fixes of the findings before it leave."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..logs.log import Log
from .axis import check_delay, check_offset, check_same, check_swapped, check_velocity
from .clipped import check_clipped, filled_by_command
from .finding import ERROR, HOPELESS, NAMES, Finding
from .following import check_following_error
from .gain import check_scale, check_sign
from .jumps import check_jumps
from .lost_rows import check_lost_rows
from .motion import check_motion, check_rate, check_start, check_unit
from .samples import check_missing, check_outliers, check_repeated, check_stuck
from .times import BRIDGED_MAX, check_gaps, check_jitter, check_order
from .turns import check_turns

if TYPE_CHECKING:
    from ..machines.machine import Machine

__all__ = ["Intake", "apply", "check"]

_Check = Callable[[Log], Iterator[Finding]]

_SAMPLES: tuple[_Check, ...] = (check_stuck, check_repeated)
_AXIS: tuple[_Check, ...] = (
    check_same,
    check_swapped,
    check_following_error,
    check_velocity,
    check_sign,
    check_scale,
    check_offset,
    check_unit,
)


_FEW = 50
"""Samples below which single ones are not judged."""


@dataclass(frozen=True)
class Intake:
    """Result of the checks of a log.

    Attributes
    ----------
    log : Log
        As it was checked.
    findings : tuple of Finding
        In the order of :data:`~hybridsep.intake.finding.NAMES`.
    """

    log: Log
    findings: tuple[Finding, ...]

    @property
    def usable(self) -> bool:
        """Whether a model can be learned once the fixes are applied."""
        beyond = [finding for finding in self.findings if finding.severity == ERROR and finding.fix is None]
        return not beyond and all(finding.name != HOPELESS for finding in self.findings)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings with which errors computed from the log are invalid."""
        return tuple(finding for finding in self.findings if finding.severity == ERROR)

    def fixed(self) -> Log:
        """Return the log with every fix applied."""
        return apply(self.log, self.findings)


@np.errstate(all="ignore")  # a log may hold any finite number
def check(log: Log, machine: Machine | None = None, *, bridged: int = BRIDGED_MAX) -> Intake:
    """Check a log.

    Times first, then single samples, then the motion, then the columns against each other, each on the log that the
    fixes before leave, so that one fault is not found under several names.

    Parameters
    ----------
    log : Log
        Read with ``uniform=False``, so that gaps and jitter reach the checks.
    machine : Machine, optional
        Its model makes the check of the delay exact, and says which sampling rate is needed.
    bridged : int
        Samples missing in a gap up to which its fix fills it in, the measured position NaN, as a predictor with trust
        and an identification take it. Longer gaps separate segments; 0 for all of them, as without trust.

    Returns
    -------
    Intake
    """
    findings: list[Finding] = []

    def look(checks: Iterable[_Check]) -> None:
        nonlocal log
        for one in checks:
            found = list(one(log))
            findings.extend(found)
            log = apply(log, found)

    given = log
    look((check_order, check_turns))
    findings.extend(check_missing(log))
    look((lambda log: check_gaps(log, bridged), check_jitter))
    log = filled_by_command(log)  # what is missing, and in gaps, is no fault to find again
    if len(log.t) >= _FEW and np.isfinite(log.x_meas).any():
        look((lambda log: check_lost_rows(log, bridged),))
        log = filled_by_command(log)
        look((check_jumps, check_outliers, lambda log: check_clipped(log, bridged)))
        log = filled_by_command(log)
        look(_SAMPLES)
    hopeless = list(check_motion(log))
    findings.extend(hopeless)
    if not hopeless:
        look(_AXIS)
        look((check_start,))
        look((lambda log: check_delay(log, machine),))
    if machine is not None:
        findings.extend(check_rate(log, machine))
    return Intake(given, tuple(sorted(findings, key=lambda finding: NAMES.index(finding.name))))


def apply(log: Log, findings: Iterable[Finding]) -> Log:
    """Return the log with the fixes of the findings applied, in their order; findings without a fix change nothing.

    Parameters
    ----------
    log : Log
        The log that was checked.
    findings : iterable of Finding
        All of an :class:`Intake`, or some.
    """
    for finding in findings:
        if finding.fix is not None:
            log = finding.fix.change(log)
    return log
