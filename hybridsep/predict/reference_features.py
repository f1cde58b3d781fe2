"""Features of the reference, for friction that changes its sign with the commanded velocity.

A model that is linear in the command cannot describe that change, but the reference, the unmodified commanded position,
is known in advance: ``ψ = tanh(v_d/v_friction)`` of its velocity, shifted by some samples to either side, extends φ of
eq. (5). These features belong to the free response, so the model stays affine in the modified command.
"""

from __future__ import annotations

import numpy as np

from ..base.signals import Array

__all__ = ["N_REFERENCE", "ReferenceFeatures", "n_reference"]

_SHIFTS = (-40, -30, -20, -15, -10, -5, 0, 5, 10, 15, 20, 30, 40)
"""Shifts of ψ, samples: the drive spreads the effect of a reversal, and ψ leads where a model has too much delay."""

_REACH = _SHIFTS[-1]

_SCALE = 1e-3
"""Scale of the features, m: friction errors up to this size are hardly damped by a λ that suits the other features."""

N_REFERENCE = len(_SHIFTS)


def n_reference(v_friction: float) -> int:
    """Return the number of features with a velocity scale, m/s: none with 0."""
    return N_REFERENCE if v_friction > 0 else 0


class ReferenceFeatures:
    """Features of the reference over consecutive windows.

    Parameters
    ----------
    v_friction : float
        Velocity scale of the change of sign, m/s; 0 for no features.
    T_s : float
        Sampling interval, s.
    """

    def __init__(self, v_friction: float, T_s: float) -> None:
        self.v_friction, self.T_s = v_friction, T_s
        self.n = n_reference(v_friction)
        self.restart()

    def restart(self) -> None:
        """Reset to rest."""
        self.before = np.zeros(_REACH)
        self.last = np.nan

    def signs(self, reference: Array, start: float) -> Array:
        """Return ψ from 40 samples before a window to 40 after the known reference.

        Parameters
        ----------
        reference : (m,) array, m
            Commanded positions of the window and beyond; its last value is held.
        start : float
            Initial position, m, taken for the sample before the first one.
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
        """Advance by ``n`` samples of a window."""
        if self.n:
            self.before, self.last = signs[n : n + _REACH].copy(), float(reference[n - 1])
