"""Features of the expert without a physics model: eq. (4) with ``G_pb = 1``.

The residual is that of the command itself, ``e_0(k) = x(k) − x_d(k − d)`` with the dead time ``d``; its features are a
constant and the increments ``x_d(k−d−j) − x_d(k−d−j−1)``, ``j = 0 … p``, beside ``p`` lags of it.
"""

from __future__ import annotations

import numpy as np

from ...base.signals import Array

__all__ = ["CommandFeatures"]


class CommandFeatures:
    """Features of the command, over consecutive windows.

    Parameters
    ----------
    dead_time : int
        Of the physics model, in samples.
    p : int
        Lags.
    last_lag : float
        Prior variance of the weight of the last increment, relative to that of the first.

    Attributes
    ----------
    n : int
        Number of features, ``p + 2``.
    n_before : int
        Commands before a window that its features need.
    shares : (n,) array
        Effect that a feature may have, relative to the largest: an old increment explains less than a recent one.
    """

    def __init__(self, dead_time: int, p: int, last_lag: float) -> None:
        self.dead_time, self.p = dead_time, p
        self.n, self.n_before = p + 2, dead_time + p + 1
        self.shares = np.concatenate(([1.0], np.sqrt(last_lag ** (np.arange(p + 1) / p))))

    def late(self, before: Array, x_d: Array) -> Array:
        """Return the commands ``d`` samples ago over a window, ``(n,)``, m.

        Parameters
        ----------
        before : (n_before,) array, m
            Commands before it, oldest first.
        x_d : (n,) array, m
        """
        return np.concatenate((before, x_d))[self.p + 1 : self.p + 1 + len(x_d)]

    def rows(self, before: Array, x_d: Array) -> Array:
        """Return the features of a window, ``(n, self.n)``: 1, and the increments; parameters as for :meth:`late`."""
        increments = np.diff(np.concatenate((before, x_d))[: self.p + 1 + len(x_d)])
        lagged = np.lib.stride_tricks.sliding_window_view(increments, self.p + 1)[:, ::-1]
        return np.column_stack((np.ones(len(x_d)), lagged))

    def largest(self, step: float) -> Array:
        """Return the largest magnitudes of the features, ``(self.n,)``, for the largest increment ``step``, m."""
        return np.concatenate(([1.0], np.full(self.p + 1, step)))
