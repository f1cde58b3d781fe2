"""Rival in compensation, on nothing but the columns ``x_d`` and ``x`` of a log: a finite impulse response, inverted.

What the command was ahead of the motion, ``x_d − x``, is fitted by least squares to the velocities around it and to
their signs, which are friction's; the command of a wanted motion then follows. Nothing of the rest of the package is in
it, it knows no limits of the drive, and it learns nothing more.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.signals import Array, Indices

_AHEAD, _PAST, _FAR, _SIGNS = 21, 10, 10, 5
"""Taps from half a look-ahead ago to a whole one ahead; further back, geometrically, to this many look-aheads, as the
integrator of a drive remembers; and taps of the velocity's sign."""

_RIDGE = 1e-6  # penalty of a tap, relative to the mean square of its column: neighbouring taps are nearly alike
_SLOW = 0.02  # velocity over which friction's sign changes, relative to the largest of the log
_SMOOTH = 9  # samples over which measured positions are smoothed before they are differentiated


@dataclass(frozen=True)
class FirInverse:
    """Fitted rival: taps and their weights."""

    taps: Indices  # (m,), samples ahead, of velocities
    signs: Indices  # (s,), samples ahead, of their signs
    slow: float  # velocity over which friction's sign changes, m a sample
    w: Array  # (m + s + 1,), weights of taps, samples, and of signs and 1, m

    @classmethod
    def fitted(cls, recordings: Sequence[tuple[Array, Array]], Np: int) -> "FirInverse | None":
        """Return the rival of look-ahead ``Np`` for commands and positions ``(n,)``, m, NaN if missing, or None."""
        given = [(x_d, _smooth(x), ~np.isnan(x)) for x_d, x in recordings if np.isfinite(x).sum() > _FAR]
        slow = _SLOW * max((float(np.abs(np.diff(x_d)).max()) for x_d, *_ in given), default=0.0)
        if not slow > 0.0:
            return None
        near, signs = (np.linspace(-0.5, 1.0, n) for n in (_AHEAD, _SIGNS))  # in look-aheads
        all_taps = np.concatenate((-np.geomspace(0.5, _FAR, _PAST), near)), np.concatenate(([-4.0, -2.0, -1.0], signs))
        taps, of_signs = (np.unique((Np * one).round()).astype(np.intp) for one in all_taps)
        rival = cls(taps, of_signs, slow, np.empty(0))
        A = np.concatenate([rival._features(x)[known] for _, x, known in given])
        y = np.concatenate([(x_d - x)[known] for x_d, x, known in given])
        gram = A.T @ A
        return replace(rival, w=np.linalg.lstsq(gram + _RIDGE * np.diag(np.diag(gram)), A.T @ y, rcond=None)[0])

    def command(self, x: Array) -> Array:
        """Return the command for a wanted motion, ``(n,)``, m."""
        return np.asarray(x + self._features(x) @ self.w)

    def _features(self, x: Array) -> Array:
        """Return the regressors of a motion, ``(n, m + s + 1)``; it rests before and after."""
        v = np.gradient(x)
        near = [np.clip(np.arange(len(x))[:, None] + ahead, 0, len(x) - 1) for ahead in (self.taps, self.signs)]
        return np.column_stack((v[near[0]], np.tanh(v / self.slow)[near[1]], np.ones(len(x))))


def _smooth(x: Array) -> Array:
    """Return measured positions, what is missing bridged by straight lines, smoothed by a Hann window."""
    known, k = ~np.isnan(x), np.arange(len(x))
    window = np.hanning(_SMOOTH + 2)[1:-1]
    bridged = np.pad(np.interp(k, k[known], x[known]), _SMOOTH // 2, mode="edge")
    return np.convolve(bridged, window / window.sum(), "valid")


class PlayedCommand:
    """A command ``(n,)``, m, that is known beforehand, as a controller in a run, which looks at nothing measured."""

    delay: int = 1

    def __init__(self, x_dm: Array, T_s: float) -> None:
        self.T_s, self._x_dm = T_s, x_dm.tolist()

    def restart(self, start: float) -> None:
        """Begin a run; ``start``, m, is in the command."""
        self._k = -1

    def step(self, x_d_ahead: float, x_meas: float) -> float:
        """Return the command of the next sample, m."""
        self._k += 1
        return float(self._x_dm[min(self._k, len(self._x_dm) - 1)])
