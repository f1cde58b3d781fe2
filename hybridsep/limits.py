"""What a drive may be asked for: velocity, acceleration and jerk."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .errors import ParameterError

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """What a move may demand.

    Parameters
    ----------
    velocity, acceleration, jerk : float
        Limits in m/s, m/s² and m/s³, all > 0.

    Raises
    ------
    ParameterError
        If a limit is not finite and > 0.
    """

    velocity: float
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration", "jerk"):
            limit = getattr(self, name)
            if not (math.isfinite(limit) and limit > 0):
                raise ParameterError(f"the {name} limit must be finite and > 0, got {limit!r}")
