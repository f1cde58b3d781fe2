"""Slow parts of a model that its zeros all but cancel: friction looks like them, and few drives have them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..model.physics import Mode

__all__ = ["slow_parts"]

APART = 2.5
"""Least ratio of frequencies between slow parts and the others: a 14 Hz part of an axis of 35 Hz is one of its own."""

CANCELLED = 0.25
"""Static gain of the slow parts, relative to the others', below which zeros all but cancel their poles: with 0.25 zero
and pole are a quarter apart."""


def slow_parts(modes: Sequence[Mode]) -> list[float]:
    """Return the frequencies, Hz, of the slow parts that are nearly cancelled, by each other or by zeros.

    The parts are the partial fractions of eq. (15): the modes, an over-damped mode as its two real poles.

    Parameters
    ----------
    modes : sequence of Mode
    """
    parts = sorted(part for mode in modes for part in _parts(mode))
    frequencies = [f for f, _, _ in parts]
    for i in range(len(parts) - 1, 0, -1):
        if frequencies[i] > APART * frequencies[i - 1] and _size(parts[:i]) < CANCELLED * _size(parts[i:]):
            return frequencies[:i]
    return []


def _size(parts: Sequence[tuple[float, float, float]]) -> float:
    """Return the static gain of parts, or what the largest resonance among them adds to it."""
    return max(abs(sum(gain for _, gain, _ in parts)), max(resonance for _, _, resonance in parts))


def _parts(mode: Mode) -> Iterator[tuple[float, float, float]]:
    """Yield frequency, Hz, static gain and ``|β|/ω``, 0 without oscillation, of the parts of a mode."""
    omega, zeta, alpha, beta = mode.omega, mode.zeta, mode.alpha, mode.beta
    root = omega * np.sqrt(max(zeta**2 - 1.0, 0.0))
    if zeta < 1.0 or root < 1e-6 * omega:  # of two poles in one place, a lag's zero cancels one
        yield mode.f_n, alpha / omega**2, abs(beta) / omega if zeta < 1.0 else 0.0
        return
    # (α + β s)/((s + a)(s + b)) = Σ r/(s + p), at p = a: r = (α − β a)/(b − a)
    slow = omega / (zeta + np.sqrt(zeta**2 - 1.0))
    for pole, other in ((slow, slow + 2 * root), (slow + 2 * root, slow)):
        yield pole / (2 * np.pi), (alpha - beta * pole) / (other - pole) / pole, 0.0
