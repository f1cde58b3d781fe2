"""Features of φ that follow from the reference alone: which way friction will push.

Friction changes its sign with the velocity. A model that is linear in the command cannot say so, but the reference, the
commanded position before it is modified, is known in advance: ``ψ = tanh(v_d/v_friction)`` of its velocity, and of it
some samples before and after, enter eq. (5) as further features. They are a part of the free response, so the model
stays linear in what a compensator may change.
"""

from __future__ import annotations

import numpy as np

from ..base.signals import Array

__all__ = ["N_REFERENCE", "ReferenceFeatures"]

_SHIFTS = (-40, -30, -20, -15, -10, -5, 0, 5, 10, 15, 20, 30, 40)
"""Samples by which ψ is shifted in each feature: a reversal's effect is spread, and early where the model is late."""

_REACH = _SHIFTS[-1]

_SCALE = 1e-3
"""Factor of the features, m: with a penalty λ that fits the other features, friction up to this is hardly damped."""

N_REFERENCE = len(_SHIFTS)


class ReferenceFeatures:
    """Makes the features of the reference of consecutive windows.

    Parameters
    ----------
    v_friction : float
        Velocity over which friction changes its sign, m/s; 0 for no features.
    T_s : float
        Sampling interval, s.
    """

    def __init__(self, v_friction: float, T_s: float) -> None:
        self.v_friction, self.T_s = v_friction, T_s
        self.n = N_REFERENCE if v_friction > 0 else 0
        self.restart()

    def restart(self) -> None:
        """Begin at rest."""
        self.before = np.zeros(_REACH)
        self.last = np.nan

    def signs(self, reference: Array, start: float) -> Array:
        """Return ψ from 40 samples before a window to 40 after what is known of the reference.

        Parameters
        ----------
        reference : (m,) array, m
            Commanded positions of the window and what follows it; held at its end.
        start : float
            Position of rest, m, which counts as the sample before the first one.
        """
        if not self.n:
            return np.zeros(0)
        last = start if np.isnan(self.last) else self.last
        ahead = np.tanh(np.diff(reference, prepend=last) / (self.v_friction * self.T_s))
        return np.concatenate((self.before, ahead, np.zeros(_REACH)))

    def features(self, signs: Array, n: int) -> Array:
        """Return the features of a window's first ``n`` samples, ``(n, self.n)``, m."""
        if not self.n:
            return np.zeros((n, 0))
        return _SCALE * np.column_stack([signs[_REACH + shift : _REACH + shift + n] for shift in _SHIFTS])

    def advance(self, signs: Array, reference: Array, n: int) -> None:
        """Move on by ``n`` samples of a window."""
        if self.n:
            self.before, self.last = signs[n : n + _REACH].copy(), float(reference[n - 1])
