"""Scores of the three predictors against the measured position."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..base.metrics import RunningErrors, reduction_percent, rms_ratio
from .verdict import Verdict

__all__ = ["Score", "Scores"]


@dataclass(frozen=True)
class Score:
    """Prediction errors against the measured position; NaN where there are no samples.

    Attributes
    ----------
    n_samples : int
        Samples they were taken over.
    rms_pb, rms_hold, rms_h : float
        RMS of physics model, hold baseline and hybrid, m.
    max_pb, max_hold, max_h : float
        Largest absolute error of each, m.
    """

    n_samples: int
    rms_pb: float
    rms_hold: float
    rms_h: float
    max_pb: float
    max_hold: float
    max_h: float

    @property
    def ratio_to_hold(self) -> float:
        """RMS of the hybrid relative to the hold baseline's."""
        return rms_ratio(self.rms_h, self.rms_hold)

    @property
    def reduction_percent(self) -> float:
        """By how much the hybrid's RMS is below the physics model's, percent of the latter."""
        return reduction_percent(self.rms_h, self.rms_pb)

    def rms_without(self, n: int, rms: Sequence[float]) -> list[float]:
        """Return the RMS of physics model, hold and hybrid without ``n`` of the samples, which have ``rms``, m."""
        left = self.n_samples - n
        pairs = zip((self.rms_pb, self.rms_hold, self.rms_h), rms, strict=True)
        return [
            math.sqrt(max(self.n_samples * own**2 - n * other**2, 0.0) / left) if left > 0 else math.nan
            for own, other in pairs
        ]

    @classmethod
    def of(cls, errors: RunningErrors) -> Score:
        """Return the score of the errors of physics model, hold baseline and hybrid."""
        return cls(errors.n, *errors.rms, *errors.peaks)


@dataclass(frozen=True)
class Scores:
    """Scores of a replay.

    Attributes
    ----------
    overall, after_warm_up : Score
        Over all samples, and over the samples after the warm-up.
    n_batches : int
        Windows replayed, the last one may be incomplete.
    verdict : Verdict
        Judgement of the hybrid over all samples, in words.
    """

    overall: Score
    after_warm_up: Score
    n_batches: int
    verdict: Verdict

    def summary(self) -> dict[str, float | int]:
        """Return all scores by name: ``rms_pb_um``, ``max_h_um``, ``reduction_percent``, ``ratio_to_hold``, ….

        Errors are in micrometres against the measured position; the names with ``_after_warm_up`` leave the warm-up
        out and are NaN if nothing is left.
        """
        result: dict[str, float | int] = {"n_batches": self.n_batches}
        for score, suffix in ((self.overall, ""), (self.after_warm_up, "_after_warm_up")):
            for quantity in ("rms", "max"):
                for name in ("pb", "hold", "h"):
                    result[f"{quantity}_{name}_um{suffix}"] = 1e6 * float(getattr(score, f"{quantity}_{name}"))
            result[f"reduction_percent{suffix}"] = score.reduction_percent
            result[f"ratio_to_hold{suffix}"] = score.ratio_to_hold
            result[f"n_samples{suffix}"] = score.n_samples
        return result
