"""Compensation in ``hybridsep fit``: the drive's limits, and the tracking error to be expected without and with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.errors import ParameterError, SignalError
from ..base.metrics import known_rms, peak_derivatives
from ..base.settings import DRIVE_LIMIT_ENTRIES, Limits
from ..compensate.expected import Expected, expected_errors, limits_that_bind
from ..logs.units import DisplayUnits
from ..machines.machine import Machine
from .replay import Recording

__all__ = [
    "COMPENSATE",
    "LIMITS_WORDS",
    "MARGINS",
    "PHYSICS_ALONE",
    "Tracking",
    "binding_words",
    "drive_limits",
    "estimated_limits",
    "expected_tracking",
]

COMPENSATE = "physics"
"""Model that a new compensator starts with."""

PHYSICS_ALONE = (
    "The physics model alone may leave more error than no compensation does: on 4 of 30 sound loops it left more than "
    "1.2 times as much, 4.1 times at worst. Compare both with compensate = off before one moves a machine."
)
"""What is said of :data:`COMPENSATE`."""

MARGINS = np.array([1.25, 2.0, 5.0])
"""Limits of velocity, acceleration and jerk relative to a log's largest, as in the machine files that come with the
library."""

FOLLOWING_ERROR = 1.3
"""``following_error_max`` relative to the largest servo error without compensation: on 300 sound loops of two masses no
error below that was above it (``python -m benchmarks.faults``)."""

LIMITS_WORDS = (
    f"estimates, {', '.join(f'{one:g}' for one in MARGINS.tolist())} times the largest velocity, acceleration and jerk "
    "of the log; replace them by your drive's, and take out estimated = true, before a compensator moves it"
)
"""What the limits of :func:`estimated_limits` are."""

_SAID = 0.001
"""Share of the samples from which on a limit that binds is said: fewer cost nothing that could be seen."""

_HOW = (
    "An estimate: the compensator plans in closed loop on the identified model, to which the residual of the log is "
    "added as it was recorded; that the residual changes with the command is left out."
)


def drive_limits(given: Mapping[str, float]) -> dict[str, float]:
    """Return the entries of ``[drive_limits]`` of options by their names; empty without any.

    :func:`~hybridsep.fitting.fit.fit` takes ``change_max`` and ``following_error_max`` from the log where they are not
    among them.

    Raises
    ------
    ParameterError
        If some of the three limits are missing.
    """
    found = {entry: given[one.name] for entry, one in DRIVE_LIMIT_ENTRIES.items() if one.name in given}
    names = [parameter.name for parameter in Limits.parameters().values()]
    if found and (missing := [name for name in names if name not in given]):
        verb = "is" if len(missing) == 1 else "are"
        raise ParameterError(
            f"a compensator needs the drive's limits {', '.join(names)}; {', '.join(missing)} {verb} missing"
        )
    return found


def estimated_limits(recordings: Sequence[Recording], T_s: float) -> dict[str, Any]:
    """Return entries of ``[drive_limits]`` from the motion of the commands, marked as estimates; empty without motion.

    They are :data:`MARGINS` times the largest velocity, acceleration and jerk; the command may change by twice the
    largest servo error, and the compensator trips above :data:`FOLLOWING_ERROR` times it.
    """
    long = [one for one in recordings if len(one.x_d) > 3]
    peaks = np.array([peak_derivatives(one.x_d, T_s) for one in long]).reshape(-1, 3).max(axis=0, initial=0.0)
    error = max((float(np.nanmax(np.abs(one.x_d - one.x), initial=0.0)) for one in long), default=0.0)
    bounds = (*(MARGINS * peaks).tolist(), 2.0 * error, FOLLOWING_ERROR * error)
    values = dict(zip(DRIVE_LIMIT_ENTRIES, bounds, strict=True))
    found: dict[str, Any] = {}
    for name, value in values.items():
        declared = DRIVE_LIMIT_ENTRIES[name]
        if not value >= (declared.minimum or declared.nonzero):
            return {}
        found[name] = min(float(f"{value:.4g}"), float(declared.maximum or value))
    return {**found, "estimated": True}


@dataclass(frozen=True)
class Tracking:
    """Tracking errors to be expected: RMS of commanded minus measured position over the test samples, m.

    Attributes
    ----------
    none, physics, hybrid : float
        As measured, and estimates with each model; NaN without a test sample, or where a plan diverges.
    limits : mapping
        Model → shares of :func:`~hybridsep.compensate.expected.limits_that_bind`.
    change_max, following_error_max : float
        Largest change of the command, and following error above which the compensator trips, m.
    """

    none: float
    physics: float
    hybrid: float
    limits: Mapping[str, Mapping[str, float]]
    change_max: float | None
    following_error_max: float

    def lines(self, shown: DisplayUnits) -> list[str]:
        """Return the errors in words, what binds them and, last, how they came about."""

        def figure(value: float | None) -> str:
            return "not known" if value is None or math.isnan(value) else shown.words(value, ".4g")

        return [
            f"Tracking error (commanded minus measured, RMS): {figure(self.none)} as recorded; with the compensator "
            f"about {figure(self.hybrid)} by the hybrid (compensate = hybrid), and about {figure(self.physics)} by the "
            f"physics model (compensate = {COMPENSATE}), with which the FMU starts.",
            PHYSICS_ALONE,
            f"change_max is {figure(self.change_max)}. {binding_words(self.limits.get('hybrid', {}))}",
            f"Where the measured following error is above following_error_max = {figure(self.following_error_max)} for "
            "three samples in a row, the compensator trips: its change of the command fades until reset.",
            _HOW,
        ]


def expected_tracking(
    machine: Machine, recordings: Sequence[Recording], progress: Callable[[float], object]
) -> Tracking:
    """Return the tracking errors to be expected with and without a machine's compensator, and which limits bind."""
    settings, Np = machine.compensator_predictor, machine.compensator_predictor.Np
    pairs = [(one.x_d, one.x) for one in recordings]
    firsts = [one.first_judged(Np) for one in recordings if len(one.x) > settings.n_late]
    found = dict.fromkeys(("none", "physics", "hybrid"), math.nan)
    bound: dict[str, dict[str, float]] = {}
    for i, model in enumerate(("physics", "hybrid")):
        compensator = replace(machine.compensator_settings, compensate=model)
        try:
            expected = list(expected_errors(machine.model, settings, compensator, pairs))
        except SignalError:
            continue
        parts = [Expected(*(signal[first:] for signal in one)) for one, first in zip(expected, firsts, strict=True)]
        judged = Expected(*map(np.concatenate, zip(*parts, strict=True)))
        for name, errors in (("none", judged.without), (model, judged.compensated)):
            found[name] = known_rms(errors)
        if len(judged.x_d):
            bound[model] = limits_that_bind(judged.x_d, judged.x_dm, settings.T_s, compensator)
        progress((i + 1) / 2)
    allowed = machine.compensator_settings
    return Tracking(
        **found, limits=bound, change_max=allowed.change_max, following_error_max=allowed.following_error_max
    )


def binding_words(shares: Mapping[str, float]) -> str:
    """Return which limits bind a compensated command, and in which share of its samples, in words."""
    each = ", ".join(f"{name} in {100 * share:.2g} %" for name, share in shares.items() if share >= _SAID)
    if not each:
        return "No limit binds the compensated command."
    return f"Limits bind the compensated command: {each} of the samples; within larger ones less error would be left."
