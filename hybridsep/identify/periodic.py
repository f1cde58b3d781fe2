"""Period of a residual that repeats with the position, as by cogging or a screw's pitch: Lomb-Scargle over position.

Evidence is the share of one half of the motion that a line fitted to the other half predicts, phase included: friction,
misfits of the model and vibrations of one frequency in time leave lines in the spectrum, too, but their phase does not
follow the position.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ..base.signals import Array
from ..model.physics import ModalModel
from .output_error import without

PREDICTED = 0.35
"""Share of the variance in one half that the other predicts, both ways, from which a period is believed: at most 0.18
on recorded axes, 0.03 on simulated ones without a period, 0.5 and more with one of 2 µm beside 5 µm of friction."""

_PERIODS_MIN = 3.0  # periods within the travel, at least; fewer look like stiffness, which is learned without a period
SAMPLES_MIN = 4.0  # samples a period at the fastest motion, at least

_MOVING = 0.02
"""Velocity in multiples of the largest below which the axis counts as at rest, where samples tell of no position."""

_ROWS_MAX, _LINES_MAX = 4000, 6000  # samples and lines of a spectrum at most: its cost is their product
_BLOCK = 64  # lines whose waves are the first one's times a few
_OVERSAMPLED = 5.0  # lines a width of the spectrum's resolution, the reciprocal of the travel
_RESOLVED = 0.02  # part of the resolution to which a period is rounded


def residual_period(pieces: Iterable[tuple[Array, Array]], model: ModalModel, T_s: float, input_hold: str) -> float:
    """Return the period, m, with which a model's residual repeats; 0 without strong evidence of one.

    ``pieces`` are commanded and measured positions, ``(n,)`` each, m, NaN where missing.
    """
    discrete = model.discretise(T_s, input_hold)
    found = []
    for x_d, x in pieces:
        x_pb = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0] + x_d[0]
        v = np.gradient(x_pb) if len(x_pb) > 1 else np.zeros(1)
        found.append(np.stack((x_pb, v, np.gradient(v) if len(v) > 1 else v, x - x_pb)))
    s, v, a, e = np.concatenate(found, axis=1)
    fastest = float(np.abs(v).max(initial=0.0))
    used = np.flatnonzero((np.abs(v) > _MOVING * fastest) & ~np.isnan(e))
    used = used[:: max(1, len(used) // _ROWS_MAX)]
    if len(used) < 100 or not np.ptp(e[used]):
        return 0.0
    s, v, a, e = s[used], v[used], a[used], e[used]
    travel = float(np.ptp(s))
    lowest, highest = _PERIODS_MIN / travel, 1.0 / (SAMPLES_MIN * fastest)
    if highest <= lowest:
        return 0.0
    # What else a residual follows, scaled: offset, stiffness, friction, wrong lag and inertia
    x = (s - s.mean()) / travel
    moving = [np.sign(v), v / np.abs(v).max(), a / max(float(np.abs(a).max()), 1e-300)]
    known = np.column_stack((np.ones(len(s)), x, x**2, *moving))
    rest = without(known, e)
    n_lines, width = int(min(_LINES_MAX, _OVERSAMPLED * travel * (highest - lowest) + 2)), 1.0 / (_OVERSAMPLED * travel)
    peak = lowest + width * float(np.argmax(_spectrum(s, rest, lowest, width, n_lines)))
    best = minimize_scalar(
        lambda line: float(np.sum(without(np.column_stack((known, _waves(s, line))), e) ** 2)),
        bounds=(max(lowest, peak - 3.0 * width), peak + 3.0 * width),
        method="bounded",
        options={"xatol": 1e-4 * width},
    ).x
    if best <= lowest * (1.0 + 1e-3) or _predicted(s, known, e, best) < PREDICTED:
        return 0.0
    period, within = 1.0 / best, _RESOLVED / (best**2 * travel)
    rounded = (float(f"{period:.{digits}e}") for digits in range(17))  # to as few digits as the resolution has
    return next((one for one in rounded if abs(one - period) <= within), period)


def _spectrum(s: Array, e: Array, lowest: float, width: float, n: int) -> Array:
    """Return what a wave of each of ``n`` lines, ``width`` apart, explains of a residual, ``(n,)``, m²."""
    first, further = (np.arange(0, n, _BLOCK), np.arange(_BLOCK))
    begins, within = (np.exp(2j * np.pi * np.outer(k, s)) for k in (lowest + width * first, width * further))
    e_wave = ((begins * e) @ within.T).ravel()[:n]  # Σ e cos + i Σ e sin
    square = (begins**2 @ (within**2).T).ravel()[:n]  # Σ (cos² − sin²) + i Σ 2 cos sin
    # The least squares' normal equations of cosine and sine
    total, c, d = float(len(s)), e_wave.real, e_wave.imag
    numerator = c**2 * (total - square.real) + d**2 * (total + square.real) - 2.0 * c * d * square.imag
    return np.asarray(2.0 * numerator / np.maximum(total**2 - np.abs(square) ** 2, 1e-9 * total**2))  # not 0 on a grid


def _predicted(s: Array, known: Array, e: Array, line: float) -> float:
    """Return the share of one half's variance that a line fitted to the other explains; the lesser of both ways."""
    waves = _waves(s, line)
    first: NDArray[np.bool_] = np.arange(len(s)) < len(s) // 2
    shares = []
    for fitted in (first, ~first):
        both = np.column_stack((known, waves))[fitted]
        weights = np.linalg.lstsq(both, e[fitted], rcond=None)[0][-2:]
        target, told = (without(known[~fitted], part[~fitted]) for part in (e, waves @ weights))
        power = float(target @ target)
        shares.append(1.0 - float(np.sum((target - told) ** 2)) / power if power > 0.0 else 0.0)
    return min(shares)


def _waves(s: Array, line: float) -> Array:
    angle = 2.0 * np.pi * line * s
    return np.column_stack((np.sin(angle), np.cos(angle)))
