"""What a drive may be asked for: velocity, acceleration and jerk."""

from __future__ import annotations

from dataclasses import dataclass

from .parameters import check

__all__ = ["Limits"]


@dataclass(frozen=True)
class Limits:
    """What a move may demand.

    Parameters
    ----------
    velocity, acceleration, jerk : float
        Limits in m/s, m/s² and m/s³, in the ranges of the parameters ``v_max``, ``a_max`` and ``j_max``.

    Raises
    ------
    ParameterError
        If a limit is out of its range.
    """

    velocity: float
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        for name, parameter in (("velocity", "v_max"), ("acceleration", "a_max"), ("jerk", "j_max")):
            object.__setattr__(self, name, check(parameter, getattr(self, name), label=f"the {name} limit"))
