"""Errors over the distance since a reversal, and over the velocity: backlash and friction of an axis, in its own units.

Both are of the residual of the physics model, so that the delay and the dynamics of the axis are not in them. The
distance is the physics model's own: it reverses when the axis is due to, not when the command does. After a reversal
the residual is compared with what it was at the same distance before it, which is the same position: what depends on
the position alone, as stiffness and pitch do, is not in the difference. What grows with the velocity, as a lag that the
physics model has wrong because friction looks like one, is taken off by a regression over reversals at different
velocities.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import linregress

from ..base.signals import Array, Indices

_REVERSALS_MIN = 4
"""Fewest reversals that a curve is made from: the median of fewer is no better than one of them."""

_STROKE = 0.02
"""Least motion between two reversals, relative to the whole travel: less is overshoot, or rounding."""

_PLACES = 201
"""Distances of a curve."""

_SHARE, _WITHIN = 0.63, 0.1
"""Share of the reversal error at which its distance is told, and how close to it, relative, a curve has settled."""

_DRAWN = 3.0
"""Distance that is drawn, relative to that at which the curve has settled."""

_ALIKE = 0.01
"""Spread of the velocities of reversals, relative to them, up to which a lag and friction are not told apart."""

_SURE = 5.0
"""Reversal error relative to its standard deviation from which on it is told. On recorded servos that reverse at one
velocity only it is up to 3.7 times it, with errors as large as the motion; on the example axis 22 times, 2 % off."""

_STEADY = 0.05
"""Change of velocity, relative to it, from one half of some samples to the other, below which it is steady."""

_VELOCITIES = 20
"""Bins of a friction table, even, from the fastest steady motion one way to that the other way."""


@dataclass(frozen=True)
class ReversalCurve:
    """Changes of residuals by a reversal, medians over all reversals; positive where the axis stays behind."""

    n: int  # reversals
    distance: Array  # (m,), m: since the reversal, from 0
    changes: Array  # (rows, m), m: of each residual, the measured one first
    errors: Array  # (rows,), m: reversal errors: what the changes come to
    deviation: float  # m: standard deviation of the measured one
    slope: float  # part of the measured residual that grows with the velocity, samples; taken off

    @property
    def settling(self) -> float:
        """Distance, m, over which 63 % of the measured reversal error come about."""
        return float(self.distance[np.argmax(self.changes[0] >= _SHARE * self.errors[0])])


def reversal_curve(pieces: Iterable[tuple[ArrayLike, ArrayLike]]) -> ReversalCurve | None:
    """Return the change of residuals by a reversal over the distance since it, where one is found.

    None of fewer than four reversals, of reversals at one velocity only, and of a reversal error that may be chance.

    Parameters
    ----------
    pieces : iterable of a (n,) and a (rows, n) array, m
        Of each stretch without a gap, two samples or more: the physics model's position ``x_pb``, and residuals, the
        measured one first, NaN where it is missing.
    """
    given = [(np.asarray(x, dtype=np.float64), np.vstack((residuals, np.gradient(x)))) for x, residuals in pieces]
    least = _STROKE * max((float(np.ptp(x)) for x, _ in given), default=0.0)
    turned = []
    for x, rows in given:
        ends = [0, *_reversals(x, least), len(x)]
        for begin, turn, end in zip(ends, ends[1:-1], ends[2:], strict=False):
            order = np.arange(begin, turn + 1)[::-1], np.arange(turn, end)
            sides = [_stroke(x[side] - x[turn], rows[:, side]) for side in order]
            if all(way.size for way, _ in sides):
                turned.append((1.0 if x[turn] < x[begin] else -1.0, sides))
    # As far as three of four go; the far half of the motion before may still be settling from the reversal before it
    reach = [min(0.5 * before[-1], after[-1]) for _, ((before, _), (after, _)) in turned]
    longest = float(np.quantile(reach, 0.25)) if reach else 0.0
    turned = [one for one, far in zip(turned, reach, strict=True) if far >= longest]
    if len(turned) < _REVERSALS_MIN:
        return None
    distance = np.linspace(0.0, longest, _PLACES)
    found = _changes(turned, distance)
    late = np.median(found[:, :, _PLACES // 2 :], axis=2)
    if np.var(late[:, -1]) <= _ALIKE**2 * np.mean(late[:, -1] ** 2):
        return None
    line = linregress(late[:, -1], late[:, 0])
    if not line.intercept > _SURE * line.intercept_stderr:
        return None
    slope = float(line.slope)

    def curves(found: Array) -> Array:
        return np.asarray(np.median(found[:, :-1] - slope * found[:, -1:], axis=0))

    errors = np.mean(late[:, :-1] - slope * late[:, -1:], axis=0)
    off = np.flatnonzero(np.abs(curves(found)[0] - errors[0]) > _WITHIN * errors[0])
    settled = distance[min(off[-1] + 1, _PLACES - 1)] if off.size else longest
    distance = np.linspace(0.0, min(longest, _DRAWN * settled), _PLACES)
    changes = curves(_changes(turned, distance))
    return ReversalCurve(len(turned), distance, changes, errors, float(line.intercept_stderr), slope)


_Stroke = tuple[Array, Array]
"""Distances, ascending, ``(n,)``, and rows at them, ``(rows, n)``."""


def _stroke(way: Array, rows: Array) -> _Stroke:
    """Return the stroke of a motion that begins at a reversal, or of one to it backwards, where it is known."""
    known = ~np.isnan(rows[0])
    return np.maximum.accumulate(np.abs(way[known])), rows[:, known]


def _changes(turned: Sequence[tuple[float, Sequence[_Stroke]]], distance: Array) -> Array:
    """Return what rows were before reversals minus what they are after them, ``(reversals, rows, m)``."""
    found = []
    for sign, sides in turned:
        before, after = (np.array([np.interp(distance, way, row) for row in rows]) for way, rows in sides)
        found.append(sign * (before - after))
    return np.array(found)


def _reversals(x: Array, least: float) -> Indices:
    """Return the last samples of motions of ``least`` or more before as much against them, ascending."""
    turns, extreme, direction = [], 0, 0
    for i, position in enumerate(x.tolist()):
        way = position - x[extreme]
        if direction * way >= 0.0 and (direction or not way):
            extreme = i
        elif abs(way) >= least:
            if direction:
                turns.append(extreme)
            extreme, direction = i, 1 if way > 0.0 else -1
    return np.array(turns, dtype=np.intp)


def friction_table(pieces: Iterable[tuple[ArrayLike, ArrayLike]], slope: float, n_steady: int) -> tuple[Array, Array]:
    """Return velocities, and the median residuals where the axis is due to move at them steadily.

    Parameters
    ----------
    pieces : iterable of a (n,) and a (rows, n) array, m
        As of :func:`reversal_curve`.
    slope : float
        Part that grows with the velocity, samples, which is taken off.
    n_steady : int
        Samples over which a velocity is steady.

    Returns
    -------
    velocities : (m,) array, m in a sample
        Median of each bin that has ``n_steady`` samples or more, ascending.
    residuals : (rows, m) array, m
    """
    half = max(n_steady // 2, 1)
    found = []
    for x, residuals in pieces:
        steps = np.asarray(x)[half:] - np.asarray(x)[:-half]
        before, after = steps[:-half], steps[half:]
        steady = (np.abs(after - before) <= _STEADY * np.abs(after)) & ~np.isnan(np.asarray(residuals)[0, 2 * half :])
        v = after / half
        found.append(np.vstack((v, np.asarray(residuals)[:, 2 * half :] - slope * v))[:, steady & (v != 0.0)])
    rows = np.concatenate(found, axis=1)
    fastest = np.abs(rows[0]).max(initial=0.0) or 1.0
    place = np.minimum((rows[0] / fastest + 1.0) / 2.0 * _VELOCITIES, _VELOCITIES - 1).astype(np.intp)
    kept = [inside for i in range(_VELOCITIES) if (inside := place == i).sum() >= n_steady]
    medians = np.array([np.median(rows[:, inside], axis=1) for inside in kept]).reshape(-1, len(rows)).T
    return medians[0], medians[1:]
