"""Number of modes of a frequency response: the Bayesian information criterion, where it is worth more than chance.

Lines whose errors are alike tell less than as many independent ones. A mode may sit on any line: a resonance that is
narrower than the distance of two lines fits one line's error. And friction looks like modes that do not oscillate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .cancelling import slow_parts
from .modal_fit import ModalFit
from .response_fit import Complex, Lines

__all__ = ["best_fit", "doubtful_modes"]

WORTH = 10.0
"""Decrease of the criterion from which more modes are taken, very strong evidence by Kass and Raftery, J. Am. Stat.
Assoc. 90 (1995) 773."""

DEVIATIONS = 3.0
"""Standard deviations by which a damping ratio is above 0, at least."""

FRICTION_WORTH = 0.6
"""Ratio of the weighted errors, with and without them, at which modes that do not oscillate, or slow modes that zeros
all but cancel, are taken beside others: modes that fit friction in a swept sine leave 0.9, a true real pole less than
0.1."""


def best_fit(lines: Lines, fits: Sequence[tuple[ModalFit, Complex]]) -> int:
    """Return the index of the fit to take among fits with growing numbers of modes."""
    n_effective = max(_independent(fit) for fit, _ in fits)  # too few modes leave errors that are alike
    sound = [i for i, (fit, _) in enumerate(fits) if i == 0 or not doubtful_modes(fit, lines)]
    chosen = _by_criterion(lines, fits, sound, n_effective)
    plain = [i for i in sound if i == 0 or not _like_friction(fits[i][0])]
    other = _by_criterion(lines, fits, plain, n_effective)
    return chosen if fits[chosen][0].cost <= FRICTION_WORTH**2 * fits[other][0].cost else other


def _like_friction(fit: ModalFit) -> bool:
    modes = fit.modes()
    return any(mode.zeta >= 1.0 for mode in modes) or bool(slow_parts(modes))


def doubtful_modes(fit: ModalFit, lines: Lines) -> list[int]:
    """Return the modes that oscillate and whose damping ratio is not significantly above 0."""
    scale = fit.cost / max(1, 2 * len(lines.omega) - fit.n_free)  # variance of each real or imaginary part
    log_zeta = fit.parameters[:, 1]
    std = np.sqrt(np.maximum(scale * np.diag(fit.covariance)[1::4], 0.0))  # of log ζ, so relative to ζ
    return [int(i) for i in np.flatnonzero((log_zeta < 0.0) & (DEVIATIONS * std > 1.0))]


def _by_criterion(
    lines: Lines, fits: Sequence[tuple[ModalFit, Complex]], places: Sequence[int], n_effective: float
) -> int:
    chosen = places[0]
    values = {i: lines.criterion(fits[i][0], n_effective) for i in places}
    for i in places[1:]:
        if values[i] < values[chosen] - WORTH:
            chosen = i
    return chosen


def _independent(fit: ModalFit) -> float:
    """Return the number of real values that tell as much as the lines, whose errors may be correlated."""
    r = fit.residual
    n, power = len(r), fit.cost
    total = 1.0
    for lag in range(1, n // 2):
        correlation = float((r[lag:] @ r[:-lag].conj()).real) / power if power > 0.0 else 0.0
        if correlation < 2.0 / np.sqrt(n):
            break
        total += 2.0 * correlation
    return 2.0 * n / total
