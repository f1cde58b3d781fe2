"""Contour error of two axes: how far the point that both reach together is from the path that was commanded.

Planar positions are complex numbers, X + iY, as in :mod:`hybridsep.plants.path`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.metrics import largest, rms
from ..base.signals import Array
from ..plants.path import PlanarPath, Points
from .run import Run

_REACH = 0.1  # s to either side in which the nearest part of the path is looked for: more than any drive lags behind
_FINER = 16  # parts into which a sample of the path near a point is cut: at 10 m/s² and 1 ms chords are within 5 nm


@dataclass(frozen=True)
class Contour:
    """Motion of two axes along a path."""

    path: PlanarPath  # where the axes should be
    reached: Points  # (n,) complex, m: where they are at the same samples
    nearest: Points  # (n,) complex, m: points of the commanded path nearest to those reached, within :data:`_REACH`
    error: Array  # (n,), m: distances between the two, positive on the left of the path
    T_s: float  # sampling interval, s

    @classmethod
    def of(cls, path: PlanarPath, reached: Points, T_s: float) -> "Contour":
        """Return the contour errors of points ``(n,)``, n ≥ 2, at ``T_s``, s; between samples the path is a spline."""
        from scipy.interpolate import CubicSpline

        n, reach = len(path.points), round(_REACH / T_s)
        finer = CubicSpline(np.arange(n), path.points)(np.arange((n - 1) * _FINER + 1) / _FINER)
        near, *_ = _nearest(reached, path.points, np.arange(n), -reach, reach + 1)
        _, nearest, error = _nearest(reached, finer, near * _FINER, -_FINER, 2 * _FINER)
        return cls(path, reached, nearest, error, T_s)

    def figures(self) -> dict[str, float]:
        """Return RMS, 99.9 % quantile and largest magnitude of the error, µm, without rapid moves."""
        error = 1e6 * np.abs(self.error[self.path.cutting])
        return {
            "contour_rms_um": rms(error),
            "contour_p999_um": float(np.quantile(error, 0.999)),
            "contour_max_um": largest(error),
        }


def contours_of(x: Mapping[str, Run], y: Mapping[str, Run], path: PlanarPath | None = None) -> dict[str, Contour]:
    """Return the contour errors of runs of X and Y with the same key; their commands are the path if left out."""
    return {
        key: Contour.of(path or PlanarPath.of(one.x_d + 1j * y[key].x_d), one.x + 1j * y[key].x, one.T_s)
        for key, one in x.items()
    }


def _nearest(
    points: Points, path: Points, around: NDArray[np.int64], first: int, end: int
) -> tuple[NDArray[np.int64], Points, Array]:
    """Return the segment of a polyline nearest to each point, the point on it, and the distance, positive on the left.

    Segments are ``around + first … around + end − 1``; ``(n,)`` each.
    """
    along = np.diff(path, append=path[-1:])
    lengths = np.maximum(np.abs(along) ** 2, 1e-300)
    segments, nearest, distance = around, path[around], np.full(len(points), np.inf)
    for shift in range(first, end):
        at = np.clip(around + shift, 0, len(path) - 1)
        # in the segment's direction the real part is along it, the imaginary one is to its left
        local = (points - path[at]) * along[at].conj()
        foot = path[at] + np.clip(local.real / lengths[at], 0.0, 1.0) * along[at]
        found = np.where(local.imag < 0.0, -1.0, 1.0) * np.abs(points - foot)
        closer = np.abs(found) < np.abs(distance)
        segments, nearest = np.where(closer, at, segments), np.where(closer, foot, nearest)
        distance = np.where(closer, found, distance)
    return segments, nearest, distance
