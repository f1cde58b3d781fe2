"""Encoder model: white Gaussian measurement noise, identical in every implementation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..base.settings import check
from ..base.signals import Array, as_samples

__all__ = ["Encoder"]

_MASK: int = 0xFFFF_FFFF_FFFF_FFFF


class Encoder:
    """Position sensor with Gaussian noise from a portable generator.

    SplitMix64 (Steele, Lea and Flood 2014) gives two uniform numbers per sample, the Box-Muller transform (1958) one
    normal number.

    Parameters
    ----------
    noise_std : float
        Standard deviation, m, ≥ 0.
    seed : int
        0 … 2³¹ − 1.
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
