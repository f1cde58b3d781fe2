"""What the compensator says of a window, and what it keeps of it until it is measured."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from ..base.signals import Array
from ..predict.window import Prediction

__all__ = ["PendingPlan", "SepState"]


class SepState(IntEnum):
    """What a window's command was planned with."""

    OFF = 0
    PHYSICS = 1
    HYBRID = 2


@dataclass(frozen=True)
class PendingPlan:
    """The planned window, waiting to be measured."""

    coefficients: Array
    delta: Array
    x_d: Array
    prediction: Prediction
    state: SepState
