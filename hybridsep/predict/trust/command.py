"""Features of the expert without a physics model: eq. (4) with ``G_pb = 1``.

It predicts the residual of the command, ``e_0(k) = x(k) − x_d(k − d)`` with the dead time ``d``; its features are
a constant and the increments ``x_d(k−d−j) − x_d(k−d−j−1)``, ``j = 0 … p``, beside ``p`` lags of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.signals import Array
from ..regression import lags
from .constants import CONSTANTS

__all__ = ["CommandFeatures"]


@dataclass(frozen=True)
class CommandFeatures:
    """Features of the command, over consecutive windows.

    Attributes
    ----------
    dead_time : int
        Of the physics model, in samples.
    """

    dead_time: int

    @property
    def p(self) -> int:
        """Lags."""
        return CONSTANTS.lags_of_command

    @property
    def n_before(self) -> int:
        """Commands before a window that its features need."""
        return self.dead_time + self.p + 1

    @property
    def shares(self) -> Array:
        """Effects that features may have, ``(p + 2,)``, relative to the largest: an old increment explains less."""
        return np.concatenate(([1.0], np.sqrt(CONSTANTS.last_lag ** (np.arange(self.p + 1) / self.p))))

    def rows(self, before: Array, x_d: Array) -> Array:
        """Return the features of a window, ``(n, p + 2)``: 1, and the increments.

        Parameters
        ----------
        before : (n_before,) array, m
            Commands before it, oldest first.
        x_d : (n,) array, m
        """
        increments = np.diff(np.concatenate((before, x_d))[: self.p + 1 + len(x_d)])
        return np.column_stack((np.ones(len(x_d)), lags(increments, self.p + 1)))

    def late(self, before: Array, x_d: Array) -> Array:
        """Return the commands ``d`` samples ago over a window, ``(n,)``, m; parameters as for :meth:`rows`."""
        return np.concatenate((before, x_d))[self.p + 1 : self.p + 1 + len(x_d)]

    def largest(self, step: float) -> Array:
        """Return the largest magnitudes of the features, ``(p + 2,)``, for the largest increment ``step``, m."""
        return np.concatenate(([1.0], np.full(self.p + 1, step)))
