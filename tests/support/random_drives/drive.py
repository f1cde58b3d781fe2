"""A random drive of either generator, as a replay sees it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

Choice = TypeVar("Choice")


class Draws:
    """Random numbers that follow from only whole numbers, such as a seed and the index of a drive."""

    def __init__(self, *key: int) -> None:
        self._rng = np.random.default_rng(key)

    def uniform(self, low: float, high: float) -> float:
        """Return a number between ``low`` and ``high``."""
        return float(self._rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """Return a number between ``low`` and ``high``, > 0, whose logarithm is uniform."""
        return math.exp(self.uniform(math.log(low), math.log(high)))

    def chance(self, probability: float) -> bool:
        """Return whether an event of this probability happens."""
        return self.uniform(0.0, 1.0) < probability

    def whole(self, low: int, high: int) -> int:
        """Return a whole number, ``low`` to ``high``."""
        return int(self._rng.integers(low, high + 1))

    def choice(self, options: Sequence[Choice]) -> Choice:
        """Return one of the options."""
        return options[self.whole(0, len(options) - 1)]

    def sign(self) -> float:
        """Return −1 or 1."""
        return self.choice((-1.0, 1.0))

    def normal(self, n: int) -> Array:
        """Return ``n`` independent standard normal numbers."""
        return self._rng.standard_normal(n)


@dataclass(frozen=True)
class Drive:
    """A drive, what it was commanded and what was measured."""

    index: int
    kind: str  # of the command
    # (n,), m: commanded, true and measured positions, at rest at first; ``x(k)`` before ``x_d(k)`` acts
    x_d: Array
    x: Array
    x_meas: Array
    model: ModalModel  # ``G_pb``, which is wrong
    settings: PredictorSettings  # sampling interval and window of the predictor
