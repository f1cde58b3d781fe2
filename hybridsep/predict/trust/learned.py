"""What the trusted model has learned besides its factors, declared once.

Saved states and weights files hold these numbers in this order, and the C core has them in the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...base.signals import PREDICTION_MAX, Array
from .experts import ResidualScale

if TYPE_CHECKING:
    from .model import TrustedModel

__all__ = ["LEARNED", "Range", "learned_numbers", "restore_learned", "unsound"]


class Range(NamedTuple):
    """Least and largest value of a learned number."""

    least: float = 0.0
    most: float = PREDICTION_MAX


LEARNED: dict[str, Range] = {
    "n_rows": Range(),
    "motion": Range(),
    "scale": Range(),
    "scale_of_command": Range(),
    "noise_variances": Range(),
    "correlations": Range(1.0),
    "largest": Range(),
    "weights": Range(0.0, 1.0),
    "gram": Range(-PREDICTION_MAX),
    "cross": Range(-PREDICTION_MAX),
    "evidence": Range(),
    "sensor": Range(-1.0, math.inf),
}
"""Ranges by name: rows of the factors; scales of velocity, m/s, and of the command's steps, m; sizes of the residuals
of the physics model and of the command; of each expert noise, m², and correlation; largest features; the stack; and the
sensor, whose spread of −1 and infinite step are not known."""


def learned_numbers(model: TrustedModel) -> dict[str, Array]:
    """Return what the model has learned, in the order of :data:`LEARNED`."""
    stack, experts = model.stack, model.experts.values()
    return {
        "n_rows": np.array([one.all().n_rows for one in (model.evidence, model.evidence_of_command)]),
        "motion": np.array([model.velocity_scale, model.largest_step]),
        "scale": np.array(model.scale),
        "scale_of_command": np.array(model.scale_of_command),
        "noise_variances": np.array([expert.noise_variance for expert in experts]),
        "correlations": np.array([expert.correlation for expert in experts]),
        "largest": model.largest,
        "weights": stack.weights,
        "gram": stack.gram,
        "cross": stack.cross,
        "evidence": stack.evidence,
        "sensor": model.guard.learned(),
    }


def unsound(model: TrustedModel, learned: Mapping[str, Array]) -> str | None:
    """Return what is wrong with numbers of :func:`learned_numbers`; None if they are sound."""
    for name, (least, most) in LEARNED.items():
        if not ((learned[name] >= least) & (learned[name] <= most)).all():  # NaN too
            return f"{name} must be {least:g} … {most:g}"
    if not model.guard.is_sound(learned["sensor"]):
        return "sensor must be a spread, a step and motions"
    if learned["weights"].sum() > 1.0 + _ROUNDING:
        return "the sum of weights must be at most 1"
    return None


_ROUNDING = 1e-6
"""What rounding may have added."""


def restore_learned(model: TrustedModel, learned: Mapping[str, Array]) -> None:
    """Restore the numbers of :func:`learned_numbers`, which are sound."""
    model.evidence.this.n_rows, model.evidence_of_command.this.n_rows = learned["n_rows"].tolist()
    model.velocity_scale, model.largest_step = learned["motion"].tolist()
    model.scale = ResidualScale(*learned["scale"].tolist())
    model.scale_of_command = ResidualScale(*learned["scale_of_command"].tolist())
    for expert, noise, correlation in zip(
        model.experts.values(), learned["noise_variances"].tolist(), learned["correlations"].tolist(), strict=True
    ):
        expert.noise_variance, expert.correlation = noise, correlation
    model.largest, stack = learned["largest"], model.stack
    stack.weights, stack.gram, stack.cross = learned["weights"], learned["gram"], learned["cross"]
    stack.evidence = learned["evidence"]
    model.guard.restore_learned(learned["sensor"])
