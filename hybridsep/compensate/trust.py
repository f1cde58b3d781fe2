"""When the hybrid model may move the machine."""

from __future__ import annotations

import numpy as np

from ..base.signals import Array

__all__ = ["Trust", "has_stable_poles"]

_FORGET = 0.9
"""Share of the past windows' errors that is kept with each window."""

_NOISE_SHARE = 0.5
"""Share of the noise variance by which the hybrid may seem worse: at rest both models predict the same noise."""

_WORST = 2.0
"""How much worse than the physics model one window may count: a bad start must not be remembered for ever."""


def has_stable_poles(w_e: Array) -> bool:
    """Return whether all roots of ``z^p − w_e,1 z^(p−1) − … − w_e,p`` are inside the unit circle.

    The Schur-Cohn test by step-down recursion (E. I. Jury, *Theory and Application of the z-Transform Method*, Wiley
    1964; the inverse of the Levinson recursion): ``p²/2`` multiplications and no eigenvalues. Each step takes the
    polynomial to one of a degree less; all roots are inside if and only if every reflection coefficient is below 1 in
    magnitude.

    Parameters
    ----------
    w_e : (p,) array
        Weights of the past residuals.
    """
    a = -np.asarray(w_e, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        for m in range(len(a) - 1, -1, -1):
            reflection = float(a[m])
            if not abs(reflection) < 1.0:  # NaN too
                return False
            # a_i ← (a_i − κ a_(m−i)) / (1 − κ²)
            a = (a[:m] - reflection * a[:m][::-1]) / ((1.0 - reflection) * (1.0 + reflection))
    return True


class Trust:
    """Compares what the two models predicted with what was measured, with exponential forgetting.

    The hybrid model is trusted while the mean square of its errors exceeds that of the physics model by no more than
    half the noise variance, which the regression's own residuals show. Without that floor the noise of a drive at
    rest would decide.
    """

    def __init__(self) -> None:
        self.excess = 0.0

    def observe(self, e_pb: Array, e_h: Array, noise_variance: float) -> None:
        """Take in a measured window.

        Parameters
        ----------
        e_pb : (Np,) array, m
            Measured residuals of the physics model.
        e_h : (Np,) array, m
            What the hybrid model predicted of them.
        noise_variance : float
            Variance of what no model explains, m².
        """
        physics = float(np.mean(e_pb**2))
        with np.errstate(over="ignore", invalid="ignore"):
            hybrid = float(np.mean((e_pb - e_h) ** 2))
        if not hybrid <= _WORST * (physics + noise_variance):  # NaN too
            hybrid = _WORST * (physics + noise_variance)
        worse = hybrid - physics - _NOISE_SHARE * noise_variance
        self.excess = _FORGET * self.excess + (1 - _FORGET) * worse

    def restart(self) -> None:
        """Give the hybrid model the benefit of the doubt again."""
        self.excess = min(self.excess, 0.0)

    @property
    def hybrid(self) -> bool:
        """Whether the hybrid model is trusted."""
        return self.excess <= 0.0
