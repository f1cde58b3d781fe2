"""Interface of a planning: how the plan of a window is chosen and published with a residual model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from ..base.settings import CompensatorSettings
from ..base.signals import Array
from ..predict.predictor import HybridPredictor
from ..predict.residual_window import FeatureScales
from ..predict.window import Prediction
from .constraints import Bounds, DriveBounds, solve
from .interior import EXACT, Tolerance
from .plan import SepState
from .splines import N_DECIDED, SplineBasis

__all__ = ["ChosenPlan", "Planning", "Preview", "PublishedPosition"]


@dataclass(frozen=True)
class Preview:
    """Commands to plan, and what the plan goes on from.

    Attributes
    ----------
    command : (preview,) array, m
        Commanded positions.
    x_d_before, delta_before : (3,) array, m
        Last commanded positions before, and last changes of them.
    rest : (3 + n_free,) array, m
        Coefficients of the remainder of the last plan, the decided ones first.
    """

    command: Array
    x_d_before: Array
    delta_before: Array
    rest: Array


class ChosenPlan(NamedTuple):
    """Plan of a window.

    Attributes
    ----------
    state : SepState
        Model that planned it.
    coefficients : (3 + n_free,) array, m
    scales : FeatureScales, optional
        Of the residual model's features.
    ends_hybrid : bool
        Whether the residual model may plan no further window of the run.
    """

    state: SepState
    coefficients: Array
    scales: FeatureScales | None
    ends_hybrid: bool = False


class PublishedPosition(NamedTuple):
    """``x_h``, ``x_h_std``, ``(Np,)``, m; leading samples: in the warm-up (``x_h = x_pb``); following the last plan."""

    x_h: Array
    x_h_std: Array
    n_warm_up: int
    n_followed: int


class Planning(ABC):
    """Plans with a residual model.

    Parameters
    ----------
    basis : SplineBasis
    bounds : DriveBounds
    settings : CompensatorSettings
        Of the window: ``preview`` and ``spacing`` are given.
    Np : int

    Attributes
    ----------
    PINNED : int
        Leading samples of a window in which a plan follows the last one.
    ALWAYS : bool
        Whether every plan follows the last one there; else only plans that the drive's limits bound.
    """

    PINNED: ClassVar[int]
    ALWAYS: ClassVar[bool]

    def __init__(self, basis: SplineBasis, bounds: DriveBounds, settings: CompensatorSettings, Np: int) -> None:
        assert settings.preview is not None
        assert settings.spacing is not None
        self.basis, self.bounds, self.settings = basis, bounds, settings
        self.preview, self.spacing = settings.preview, settings.spacing
        self.Np = Np
        self.n_pinned = min(self.PINNED, Np // 2) // self.spacing

    def adopt(self, bounds: DriveBounds, settings: CompensatorSettings) -> None:
        """Plan within other bounds from the next window on; ``preview`` and ``spacing`` are the same."""
        self.bounds, self.settings = bounds, settings

    @abstractmethod
    def choose(self, predictor: HybridPredictor, preview: Preview, most: SepState) -> ChosenPlan:
        """Return the best available plan on a model up to ``most``."""

    @abstractmethod
    def published(self, prediction: Prediction, state: SepState, most: SepState) -> PublishedPosition:
        """Return what is published of a prediction, the plan being of a model ``state``.

        Raises
        ------
        SignalError
            If it diverges.
        """

    def affine_plan(
        self, g: Array, free: Array, preview: Preview, bounds: Bounds, tolerance: Tolerance = EXACT
    ) -> Array | None:
        """Return the coefficients of the best plan on a model ``g``, ``free`` of eq. (3); None if there is none."""
        rest = preview.rest
        if not (np.isfinite(g).all() and np.isfinite(free).all()):
            return None
        cost = self.basis.cost(
            g, free, preview.command, rest[:N_DECIDED], preview.delta_before, self.settings.jerk_weight
        )
        found = solve(cost, bounds, rest[N_DECIDED:], self.n_pinned, always=self.ALWAYS, tolerance=tolerance)
        return None if found is None else np.concatenate((rest[:N_DECIDED], found.x))

    def limits(self, preview: Preview, *, may_turn: bool = False) -> Bounds:
        """Return the drive's limits on the coefficients of a plan."""
        return self.bounds.bounds(
            preview.command, preview.x_d_before, preview.delta_before, preview.rest, may_turn=may_turn
        )
