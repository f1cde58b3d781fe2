"""Delay of a model as a whole: the sum of lag and dead time, where a recording determines neither alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.signals import Array
from .output_error import Fit
from .segments import Segment
from .uncertainty import Estimate, full_covariance

__all__ = ["delay_finding", "total_delay"]

APART = 0.5
"""Deviation of the whole delay, relative to the dead time's, below which lag and dead time cannot be told apart."""

_STEP = 1e-5
"""Relative step of the differences of the delta method."""


def total_delay(fit: Fit, segments: Sequence[Segment], T_s: float) -> tuple[Estimate, float]:
    """Return the delay behind a constant velocity, ``−G'(0)/G(0)``, and the dead time's deviation, both in s.

    Parameters
    ----------
    fit : Fit
        Fitted to the segments.
    segments : sequence of Segment
    T_s : float, s
    """
    covariance = full_covariance(fit, segments, T_s)[:-1, :-1]  # the offset delays nothing
    n_theta = len(fit.theta)
    point = np.concatenate((fit.theta, fit.linear, [fit.delay.halves / 2]))

    def delay(parameters: Array) -> float:
        modes = fit.structure.modes(parameters[:n_theta], parameters[n_theta:-1], T_s)
        gain = sum(mode.alpha / mode.omega**2 for mode in modes)
        # G(s) = Σ (α + β s)/(ω² + 2ζω s + …) = Σ α/ω² − s Σ (2ζα/ω³ − β/ω²) + …
        lag = sum(2 * mode.zeta * mode.alpha / mode.omega**3 - mode.beta / mode.omega**2 for mode in modes)
        return float(lag / gain + parameters[-1] * T_s)

    steps = _STEP * np.diag(np.maximum(np.abs(point), 1.0))
    slope = np.array([(delay(point + step) - delay(point - step)) / (2 * step.sum()) for step in steps])
    variance = float(slope @ covariance @ slope)
    found = Estimate("delay", delay(point), float(np.sqrt(max(variance, 0.0))), "s")
    return found, float(T_s * np.sqrt(max(covariance[-1, -1], 0.0)))


def delay_finding(fit: Fit, segments: Sequence[Segment], T_s: float) -> list[str]:
    """Return the finding that lag and dead time cannot be told apart, if they cannot."""
    if fit.structure.order == 0:
        return []
    delay, std = total_delay(fit, segments, T_s)
    if std < T_s or delay.std > APART * std:
        return []
    return [
        f"lag and dead time cannot be told apart (dead time ± {std / T_s:.2g} samples, the others' deviations are "
        f"those with it as chosen); together they delay by {1e3 * delay.value:.4g} ± {1e3 * delay.std:.2g} ms"
    ]
