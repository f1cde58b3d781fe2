"""Supervision of the hybrid model: stability test, and excess prediction error with exponential forgetting."""

from __future__ import annotations

import numpy as np

from ..base.signals import Array

__all__ = ["PlanMonitor", "has_stable_poles"]

_FORGET = 0.9
"""Forgetting factor per window: a memory of about ten windows."""

_NOISE_SHARE = 0.5
"""Tolerance on the excess, as a share of the noise variance: at rest noise alone decides which model seems better."""

_WORST = 2.0
"""Bound on one window's mean square error, relative to that of physics model and noise: one window that diverges must
not outweigh all that follow it."""


def has_stable_poles(w_e: Array) -> bool:
    """Return whether all roots of ``z^p − w_e,1 z^(p−1) − … − w_e,p`` are inside the unit circle.

    Schur-Cohn stability test by step-down recursion (E. I. Jury, *Theory and Application of the z-Transform Method*,
    Wiley 1964; the inverse of the Levinson recursion): ``p²/2`` multiplications and no eigenvalues. Each step takes the
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


class PlanMonitor:
    """Excess prediction error of the hybrid model over the physics model, with exponential forgetting.

    The hybrid model is trusted while its mean square prediction error exceeds the physics model's by at most half the
    noise variance, which is estimated from the regression's residuals.
    """

    def __init__(self) -> None:
        self.excess = 0.0

    def observe(self, e_pb: Array, e_h: Array, noise_variance: float) -> None:
        """Update the excess with a measured window.

        Parameters
        ----------
        e_pb : (Np,) array, m
            Measured residuals of the physics model.
        e_h : (Np,) array, m
            Their predictions by the hybrid model.
        noise_variance : float
            Variance of the measurement noise, m².
        """
        physics = float(np.mean(e_pb**2))
        with np.errstate(over="ignore", invalid="ignore"):
            hybrid = float(np.mean((e_pb - e_h) ** 2))
        if not hybrid <= _WORST * (physics + noise_variance):  # NaN too
            hybrid = _WORST * (physics + noise_variance)
        worse = hybrid - physics - _NOISE_SHARE * noise_variance
        self.excess = _FORGET * self.excess + (1 - _FORGET) * worse

    def restart(self) -> None:
        """Trust the hybrid model again in a new run; what it has gained over the physics model is kept."""
        self.excess = min(self.excess, 0.0)

    @property
    def hybrid(self) -> bool:
        """Whether the hybrid model is trusted."""
        return self.excess <= 0.0
