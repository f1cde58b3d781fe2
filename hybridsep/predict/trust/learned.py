"""Learned numbers of the trusted model besides its factors, and their ranges.

Saved states and weights files hold these numbers in this order. The C core has them in the same; its ranges are
generated from these.
"""

from __future__ import annotations

from typing import NamedTuple

from ...base.signals import PREDICTION_MAX

__all__ = ["LEARNED", "Range"]


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
}
"""Ranges by name: rows of the factors; scales of velocity, m/s, of the command's steps and of the physics model's, m;
sizes of the residuals of the physics model and of the command; of each expert noise, m², and correlation; largest
features; and the stack."""
