"""Feature vector φ of eq. (5): layout of φ and w, and rows from past samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import as_strided

from ...base.signals import Array

__all__ = ["FeatureLayout", "PastSamples"]


@dataclass(frozen=True)
class FeatureLayout:
    """Slices of φ and w by groups of features.

    ``φ(k) = [1, x_pb(k) … x_pb(k−q), e_pb(k−1) … e_pb(k−p)]``; eq. (5). In C: ``hsep_features.h``.

    Parameters
    ----------
    p, q : int
        Lags of ``e_pb`` and of ``x_pb``.
    """

    p: int
    q: int

    @property
    def bias(self) -> int:
        """The constant."""
        return 0

    @property
    def x_pb(self) -> slice:
        """``x_pb(k) … x_pb(k−q)``."""
        return slice(1, 2 + self.q)

    @property
    def e_pb(self) -> slice:
        """``e_pb(k−1) … e_pb(k−p)``, the autoregressive part."""
        return slice(self.x_pb.stop, self.x_pb.stop + self.p)

    @property
    def n(self) -> int:
        """Number of features."""
        return int(self.e_pb.stop)


class PastSamples:
    """Past samples of ``x_pb`` and ``e_pb`` that φ refers to, followed by those of the current window.

    Parameters
    ----------
    layout : FeatureLayout
    Np : int
        Largest number of samples appended at once.

    Attributes
    ----------
    x_pb : (q,) array, m
        Oldest first; like ``e_pb`` zero before the first sample.
    e_pb : (p,) array, m
        Oldest first.
    """

    def __init__(self, layout: FeatureLayout, Np: int) -> None:
        p, q = layout.p, layout.q
        self.layout, self.Np = layout, Np
        self._x, self._e = np.zeros(q + Np), np.zeros(p + Np)
        self.x_pb, self.e_pb = self._x[:q], self._e[:p]
        step = self._x.itemsize
        self._x_lags = as_strided(self._x[q:], (Np, q + 1), (step, -step))  # x_pb(k) … x_pb(k−q)
        self._e_lags = as_strided(self._e[p - 1 :], (Np, p), (step, -step))  # e_pb(k−1) … e_pb(k−p)
        self._rows = np.empty((Np, layout.n + 1), order="F")

    def restart(self) -> None:
        """Set all past samples to zero, as at rest."""
        self._x[:], self._e[:] = 0.0, 0.0

    def append(self, x_pb: Array, e_pb: Array) -> None:
        """Append ``m ≤ Np`` samples, m, to the past ones."""
        p, q, m = self.layout.p, self.layout.q, len(e_pb)
        self._x[q : q + m], self._e[p : p + m] = x_pb, e_pb

    def rows(self, m: int) -> Array:
        """Return the rows ``[φ(k) | e_pb(k)]`` of the ``m`` appended samples, ``(m, n + 1)``; eq. (5)."""
        layout, p = self.layout, self.layout.p
        rows = self._rows if m == self.Np else np.empty((m, layout.n + 1), order="F")
        rows[:, layout.bias] = 1.0
        rows[:, layout.x_pb] = self._x_lags[:m]
        rows[:, layout.e_pb] = self._e_lags[:m]
        rows[:, -1] = self._e[p : p + m]
        return rows

    def advance(self, m: int) -> None:
        """Shift by the ``m`` appended samples, which become past ones."""
        p, q = self.layout.p, self.layout.q
        self.x_pb[:], self.e_pb[:] = self._x[m : m + q].copy(), self._e[m : m + p].copy()
