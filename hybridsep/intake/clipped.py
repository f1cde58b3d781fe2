"""Check of the measured position for a limit at which it is clipped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array, Indices
from ..intake import fixes
from ..logs.log import Log
from .finding import ERROR, Finding, Fix, Picture
from .relation import line_at_best_lag, noise_std, shifted
from .samples import resolution

__all__ = ["check_clipped", "filled_by_command"]

_RUN = 5
"""Samples at a limit in a row: fewer are a turning point."""

_KNOWN = 50
"""Samples elsewhere below which nothing is known of the axis."""

_SHARE = 0.01
"""Share of the samples at limits below which nothing is lost."""

_BEYOND, _LEFT = 6.0, 3.0
"""Distance of the command's line beyond the limit in the noise, and in what the line leaves elsewhere (RMS)."""

_ENDS = 0.5
"""Distance of that line from the limit where a run begins and ends, in the one in the middle, at most: a clipped
position meets its limit where it would pass it; an axis that sticks or has play stops at its turning point."""

_FAST, _AROUND = 0.25, 30
"""Speed with which the position meets and leaves its limit, in its largest within that many samples: the same told
without a line through the motion. The command must move meanwhile."""

_AT_REST = 0.05
"""Distance beyond the limit, in the travel, of a stretch at the log's beginning or end: half of its play may keep an
axis at rest from its command."""

_RUNS = 0.6
"""Share of the samples at a limit that must be in such runs."""


def check_clipped(log: Log, bridged: int = 1) -> Iterator[Finding]:
    """Find a measured position that stays at one limit while its command, and so the axis, goes beyond it.

    Parameters
    ----------
    log : Log
        Without missing measurements.
    bridged : int
        0 if the fix must not leave measurements missing; it cuts them out then.
    """
    found = _clipped(log)
    if not found:
        return
    begins, ends = (np.sort(np.concatenate([one[i] for one in found])) for i in (1, 2))
    n = int((ends - begins).sum())
    if n < _SHARE * len(log.t):
        return
    where = np.concatenate([np.arange(begin, end) for begin, end in zip(begins, ends, strict=True)])
    factor, unit = log.shown.position
    words = (
        f"the measured position is clipped at {' and '.join(f'{factor * limit:.6g}' for limit, *_ in found)} {unit} in "
        f"{n} of {len(log.t)} samples ({100 * n / len(log.t):.2g} %), where the command goes beyond: a limit of the "
        f"sensor, of its signal or of the recorder; the first is sample {begins[0] + 1}, t = {log.t[begins[0]]:.6g} s"
    )
    evidence = {"n": float(n), "share": n / len(log.t), "n_stretches": float(len(begins))}
    if bridged:
        fix = Fix("treat the clipped samples as missing", partial(fixes.missing_at, where=where))
    else:
        fix = Fix(
            "cut out the clipped samples and treat the rest as separate segments",
            partial(fixes.cut_out, begins=begins, ends=ends),
        )
    t = log.t - log.t[0]
    lines = {"commanded": (t, factor * log.x_d), "measured": (t, factor * log.x_meas)}
    picture = Picture("Measured position at its limits", "time [s]", f"position [{unit}]", lines, t[where])
    yield Finding("clipped", ERROR, words, evidence, picture, fix)


def filled_by_command(log: Log) -> Log:
    """Interpolate missing measurements in what they differ by from the command's line; linearly where few are known.

    A straight line across what was clipped would look as clipped.
    """
    known = np.isfinite(log.x_meas)
    straight = fixes.without_missing(log)
    if known.all() or known.sum() < _KNOWN:
        return straight
    expected = _expected(log.x_d, straight.x_meas, known)
    difference = np.where(known, log.x_meas - expected, np.nan)
    return replace(log, x_meas=fixes.without_missing(replace(log, x_meas=difference)).x_meas + expected)


def _clipped(log: Log) -> list[tuple[float, Indices, Indices]]:
    """Return the limits at which the position is clipped, and where the stretches at each begin and end."""
    x, noise = log.x_meas, max(noise_std(log.x_meas), 1e-12 * float(np.ptp(log.x_meas)))
    sides = {side: (limit, *_stretches(side * (limit - x) <= _near(x, limit, noise))) for side, limit in _limits(x)}
    held = np.zeros(len(x), dtype=np.bool_)
    for _, begins, ends in sides.values():
        for begin, end in zip(begins, ends, strict=True):
            held[max(begin - 1, 0) : end + 1] = True
    if not held.any() or (~held).sum() < _KNOWN:
        return []
    expected = _expected(log.x_d, x, ~held)
    left = float(np.sqrt(np.mean((x - expected)[~held] ** 2)))
    least = max(_BEYOND * noise, _LEFT * left, 4 * resolution(x))
    found = []
    for side, (limit, begins, ends) in sides.items():
        beyond = side * (expected - limit)
        clipped = np.array(
            [
                _passes(beyond, begin, end, least) or _is_cut_off(side * x, log.x_d, begin, end)
                for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)
            ],
            dtype=np.bool_,
        )
        if clipped.any() and (ends - begins)[clipped].sum() > _RUNS * (ends - begins).sum():
            found.append((limit, begins[clipped], ends[clipped]))
    return found


def _limits(x: Array) -> tuple[tuple[float, float], ...]:
    """Return the sides, 1 and -1, and the largest and the smallest value."""
    return (1.0, float(x.max())), (-1.0, float(x.min()))


def _passes(beyond: Array, begin: int, end: int, least: float) -> bool:
    """Return whether the command's line meets the limit where a run begins, passes it, and meets it where it ends."""
    peak = float(beyond[begin:end].max())
    whole = begin == 0 and end == len(beyond)
    least = max(least, _AT_REST * float(np.ptp(beyond))) if begin == 0 or end == len(beyond) else least
    meets = (begin == 0 or beyond[begin] < _ENDS * peak) and (end == len(beyond) or beyond[end - 1] < _ENDS * peak)
    return peak > least and meets and not whole


def _is_cut_off(x: Array, x_d: Array, begin: int, end: int) -> bool:
    """Return whether a position, whose upper limit it is, meets and leaves it at speed while its command moves."""
    if begin < _AROUND or end > len(x) - _AROUND or np.ptp(x[begin:end]) > 0.0:
        return False
    before, after = np.diff(x[begin - _AROUND : begin]), np.diff(x[end : end + _AROUND])
    steps = np.abs(np.diff(x_d[begin - _AROUND : end + _AROUND]))
    moving = steps[_AROUND:-_AROUND] > _FAST * _FAST * float(steps.max())
    meets = float(before[-2:].mean()) > _FAST * float(np.abs(before).max())
    leaves = -float(after[:2].mean()) > _FAST * float(np.abs(after).max())
    return meets and leaves and float(moving.mean()) > _RUNS


def _near(x: Array, limit: float, noise: float) -> float:
    """Return the distance from a limit within which values are at it: none if several are it, else the noise's."""
    return 1e-9 * float(np.ptp(x)) if np.count_nonzero(x == limit) >= _RUN else _BEYOND * noise


def _expected(x_d: Array, x: Array, known: NDArray[np.bool_]) -> Array:
    """Return the command's line with the gain, the offset and the lag of what is known."""
    fit = line_at_best_lag(x_d, x, known)
    return np.asarray(fit.gain * shifted(x_d, fit.lag) + fit.offset)


def _stretches(mask: NDArray[np.bool_]) -> tuple[Indices, Indices]:
    """Return where runs of at least :data:`_RUN` samples begin and end."""
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - begins >= _RUN
    return begins[long], ends[long]
