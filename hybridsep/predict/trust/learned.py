"""What the trusted model has learned besides the factor, as the numbers of a weights file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...base.signals import Array
from .candidates import ResidualScale

if TYPE_CHECKING:
    from .model import TrustedModel

__all__ = ["is_sound", "learned_numbers", "restore_learned"]

_LEAST = {"gram": -np.inf, "cross": -np.inf, "correlations": 1.0}
"""Least value of numbers that may be negative, or must be larger than 0."""


def learned_numbers(model: TrustedModel) -> dict[str, Array]:
    """Return what the model has learned, in the order of the file."""
    blend, candidates = model.blend, model.candidates
    return {
        "n_rows": np.array([model.n_rows]),
        "velocity_scale": np.array([model.velocity_scale]),
        "scale": np.array(model.scale),
        "noise_variances": np.array([candidate.noise_variance for candidate in candidates]),
        "correlations": np.array([candidate.correlation for candidate in candidates]),
        "weights": blend.weights,
        "largest": model.largest,
        "gram": blend.gram,
        "cross": blend.cross,
        "sensor": model.guard.learned(),
    }


def is_sound(model: TrustedModel, learned: Mapping[str, Array]) -> bool:
    """Return whether the numbers of :func:`learned_numbers` are finite and in range."""
    return model.guard.is_sound(learned["sensor"]) and all(
        bool(np.isfinite(learned[name]).all() and (learned[name] >= _LEAST.get(name, 0.0)).all())
        for name in learned_numbers(model)
        if name != "sensor"
    )


def restore_learned(model: TrustedModel, learned: Mapping[str, Array]) -> None:
    """Restore the numbers of :func:`learned_numbers`, which are sound."""
    (model.n_rows,), (model.velocity_scale,) = learned["n_rows"].tolist(), learned["velocity_scale"].tolist()
    model.scale = ResidualScale(*learned["scale"].tolist())
    variances, correlations = learned["noise_variances"].tolist(), learned["correlations"].tolist()
    for candidate, variance, correlation in zip(model.candidates, variances, correlations, strict=True):
        candidate.noise_variance, candidate.correlation = variance, correlation
    model.largest, blend = learned["largest"], model.blend
    blend.weights, blend.gram, blend.cross = learned["weights"], learned["gram"], learned["cross"]
    model.guard.restore_learned(learned["sensor"])
