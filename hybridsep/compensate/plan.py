"""Plan of a window, and the model that it is based on."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from ..base.signals import Array
from ..predict.window import Prediction

__all__ = ["PendingPlan", "SepState"]


class SepState(IntEnum):
    """Model that the commands of a window are planned with."""

    OFF = 0
    PHYSICS = 1
    HYBRID = 2


@dataclass(frozen=True)
class PendingPlan:
    """Planned window pending measurement.

    Attributes
    ----------
    coefficients : (3 + n_free,) array, m
        Coefficients of the splines, the decided ones first.
    delta, x_d : (Np,) arrays, m
        Change of the command, and commanded position.
    prediction : Prediction
        Under the modified command.
    state : SepState
        Model of the plan.
    ends_hybrid : bool
        Whether the residual model may plan no further window of the run.
    """

    coefficients: Array
    delta: Array
    x_d: Array
    prediction: Prediction
    state: SepState
    ends_hybrid: bool
