"""Interface of simulated drives, and their internal integration steps.

The command is held over a step; a drive is initially at rest at ``start``, and its states are relative to it, as in the
predictor. Integration is by the classical Runge-Kutta method, without differentiating ``x_d``; internal steps are at
most 0.1 ms and 1/16 of the linear part's fastest time constant.
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..base.clock import check_step_size
from ..base.errors import ParameterError, check_has
from ..base.parameters import finite
from ..base.settings import check
from ..base.signals import Array, as_samples

INTERNAL_STEP = 1e-4  # longest internal integration step, s: 0.1 ms, a tenth of the usual sampling interval

RATE_MAX = 1e5  # fastest rate of a drive's linear part, 1/s: a time constant of 10 µs takes 1600 internal steps a ms
STATE_MAX = 1e100  # largest magnitude of a drive's state; beyond, it counts as overflowed, before its square does

_STEPS_MAX = 1_000_000  # largest number of internal steps in one step, which bounds its cost


class Plant(Protocol):
    """Interface of a simulated drive, all that a run needs; a class of your own with these three is one."""

    def reset(self, start: float = 0.0) -> None:
        """Reset the drive to rest at ``start``, m."""

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""

    @property
    def x(self) -> float:
        """True position, m."""


def simulate(plant: Plant, x_d: ArrayLike, T_s: float, *, start: float | None = None) -> Array:
    """Return the response of a plant, which is reset first, to a command under a zero-order hold.

    ``x_d``, (n,), m: commanded positions; ``T_s``: sampling interval, s; ``start``: initial position, m, the first
    command if left out. Returns (n,), m: true positions ``x(k)``, before ``x_d(k)`` acts.
    """
    check_has("plant", plant, "reset", "step")
    commands = as_samples(x_d, "x_d", T_s=check("T_s", T_s))
    plant.reset(float(commands[0]) if start is None else finite(start, "start"))
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


_MASK: int = 0xFFFF_FFFF_FFFF_FFFF


class Encoder:
    """Position sensor with Gaussian noise from a portable generator.

    SplitMix64 (Steele, Lea and Flood 2014) gives two uniform numbers per sample, the Box-Muller transform (1958) one
    normal number. ``noise_std``: standard deviation, m, ≥ 0; ``seed``: 0 … 2³¹ − 1.
    """

    def __init__(self, noise_std: float = 0.0, seed: int = 0) -> None:
        self.noise_std: float = check("noise_std", noise_std)
        self.seed: int = check("seed", seed)
        self.n_draws = 0

    def measure(self, x: float) -> float:
        """Return one measurement of the position ``x``, m."""
        first = 2 * self.n_draws
        self.n_draws += 1
        # Uniform in (0, 1] and [0, 1), 53 bits each
        u1 = ((_split_mix_64(self.seed, first) >> 11) + 1) * 2.0**-53
        u2 = (_split_mix_64(self.seed, first + 1) >> 11) * 2.0**-53
        return x + self.noise_std * math.sqrt(-2 * math.log(u1)) * math.cos(2 * math.pi * u2)

    def measure_all(self, x: ArrayLike) -> Array:
        """Return measurements of the positions ``x``, ``(n,)``, m."""
        return np.array([self.measure(position) for position in as_samples(x, "x").tolist()])


def _split_mix_64(seed: int, index: int) -> int:
    """Return the ``index``-th number of the SplitMix64 sequence of ``seed``, 64 bits."""
    z = (seed + (index + 1) * 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)
