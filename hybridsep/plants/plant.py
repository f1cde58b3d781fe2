"""Interface of simulated drives, and their internal integration steps.

The command is held over a step; a drive is initially at rest at ``start``, and its states are relative to it, as in the
predictor. Integration is by the classical Runge-Kutta method, without differentiating ``x_d``; internal steps are at
most 0.1 ms and 1/16 of the linear part's fastest time constant.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..base.clock import check_step_size
from ..base.errors import ParameterError, SignalError
from ..base.signals import POSITION_MAX, Array, as_samples

__all__ = [
    "INTERNAL_STEP",
    "RATE_MAX",
    "STATE_MAX",
    "Drive",
    "Plant",
    "check_command",
    "check_step",
    "internal_steps",
    "simulate",
]

INTERNAL_STEP = 1e-4
"""Longest internal integration step, s: 0.1 ms, a tenth of the usual sampling interval."""

RATE_MAX = 1e5
"""Fastest rate of a drive's linear part, 1/s: a time constant of 10 µs takes 1600 internal steps per millisecond."""

STATE_MAX = 1e100
"""Largest magnitude of a drive's state; beyond it the state counts as overflowed, before its square does."""

_STEPS_MAX = 1_000_000
"""Largest number of internal steps in one step, which bounds its cost."""


class Plant(Protocol):
    """Interface of a simulated drive, all that a run needs; a class of your own with these three is one."""

    def reset(self, start: float = 0.0) -> None:
        """Reset the drive to rest at ``start``, m."""

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""

    @property
    def x(self) -> float:
        """True position, m."""


class Drive(Plant, Protocol):
    """Interface of the library's drives: a plant with a velocity, whose state can be saved."""

    @property
    def v(self) -> float:
        """True velocity, m/s."""

    def state(self) -> list[float]:
        """Return the state as plain numbers."""

    def restore(self, state: list[float]) -> None:
        """Restore a :meth:`state`."""


def simulate(plant: Plant, x_d: ArrayLike, T_s: float, *, start: float | None = None) -> Array:
    """Return the response of a plant to a command under a zero-order hold.

    Parameters
    ----------
    plant : Plant
        Reset first.
    x_d : (n,) array_like, m
        Commanded positions.
    T_s : float
        Sampling interval, s.
    start : float, optional
        Initial position, m; the first command if left out.

    Returns
    -------
    x : (n,) array, m
        True positions ``x(k)``, before ``x_d(k)`` acts.
    """
    commands = as_samples(x_d, "x_d")
    if len(commands) == 0:
        raise SignalError("x_d must have at least one sample, got none")
    plant.reset(float(commands[0]) if start is None else start)
    x = np.empty(len(commands))
    for k, command in enumerate(commands.tolist()):
        x[k] = plant.x
        plant.step(command, T_s)
    return x


def internal_steps(h: float, rate: float) -> int:
    """Return the number of internal steps in a step of ``h``, s; ``rate``, 1/s, is the fastest mode's."""
    return max(1, math.ceil(max(h / INTERNAL_STEP, 16 * h * rate) - 1e-6))


def check_step(h: float, rate: float) -> None:
    """Raise ParameterError if a step of ``h``, s, is too long for a drive with the fastest rate ``rate``, 1/s."""
    check_step_size(h)
    longest = _STEPS_MAX / 16 / rate
    if h > longest:
        raise ParameterError(
            f"the step size must be at most {longest:g} s for a drive as fast as {rate:g} 1/s, got {h!r}; "
            "make several steps"
        )


def check_command(x_d: float) -> None:
    """Raise SignalError if a command, m, is not finite or beyond :data:`POSITION_MAX`."""
    if not abs(x_d) <= POSITION_MAX["m"]:  # NaN too
        raise SignalError(f"x_d must be within ±{POSITION_MAX['m']:g} m, got {x_d:g}")
