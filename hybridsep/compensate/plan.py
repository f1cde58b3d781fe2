"""What the compensator says of a window, and what it keeps of it until it is measured."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from ..base.signals import Array
from ..predict.window import Prediction

__all__ = ["PendingPlan", "SepPlan", "SepState"]


class SepState(IntEnum):
    """What a window's command was planned with."""

    OFF = 0
    PHYSICS = 1
    HYBRID = 2


@dataclass(frozen=True)
class SepPlan:
    """What is sent to the drive over the next window, and what it will do.

    Attributes
    ----------
    x_dm : (Np,) array, m
        Modified command.
    x_pb, x_h : (Np,) arrays, m
        Physics-based prediction under it, and that of the model which planned it.
    state : SepState
    """

    x_dm: Array
    x_pb: Array
    x_h: Array
    state: SepState


@dataclass(frozen=True)
class PendingPlan:
    """The planned window, waiting to be measured."""

    coefficients: Array
    delta: Array
    x_d: Array
    prediction: Prediction
    state: SepState
