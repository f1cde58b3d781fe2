"""Warning before a compensator moves a drive whose limits are estimates."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from .failures import errors_console

if TYPE_CHECKING:
    from ..machines.machine import Machine

__all__ = ["warn_of_estimates"]


def warn_of_estimates(machines: Iterable[Machine]) -> None:
    """Say on standard error whose limits of the drive are estimated from a log's motion."""
    from ..fitting.compensation import LIMITS_WORDS

    for machine in machines:
        if machine.drive_limits is not None and machine.drive_limits.estimated:
            errors_console.print(f"warning: [drive_limits] of {machine.name}: {LIMITS_WORDS}", soft_wrap=True)
