"""A random drive of either generator, as a replay sees it."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

__all__ = ["Drive"]


@dataclass(frozen=True)
class Drive:
    """A drive, what it was commanded and what was measured.

    Attributes
    ----------
    index : int
    kind : str
        Of the command.
    x_d, x, x_meas : (n,) array, m
        Commanded, true and measured positions, at rest at first; ``x(k)`` before ``x_d(k)`` acts.
    model : ModalModel
        ``G_pb``, which is wrong.
    settings : PredictorSettings
        Sampling interval and window of the predictor.
    text : str
        Description.
    """

    index: int
    kind: str
    x_d: Array
    x: Array
    x_meas: Array
    model: ModalModel
    settings: PredictorSettings
    text: str
