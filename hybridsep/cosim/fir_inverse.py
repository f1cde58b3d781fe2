"""Rival in compensation, on nothing but the columns ``x_d`` and ``x`` of a log: a finite impulse response, inverted.

What the command was ahead of the motion, ``x_d − x``, is fitted by least squares to the motion from tap to tap around
it and to the signs of its velocity, which are friction's; the command of a wanted motion then follows. Nothing of the
rest of the package is in it, it knows no limits of the drive, and it learns nothing more.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.signals import Array, Indices

_TAPS, _FAR, _SIGNS = 40, 3.0, 5
"""Taps, from this many look-aheads ago, as a drive's integrator remembers, to one ahead, quadratically; of signs."""

_RIDGE = 1e-6  # penalty of a tap, relative to the mean square of its column: neighbouring taps are nearly alike
_SLOW = 0.02  # velocity over which friction's sign changes, relative to the largest of the log


@dataclass(frozen=True)
class FirInverse:
    """Fitted rival: taps and their weights."""

    taps: Indices  # (m + 1,), samples ahead, of positions
    signs: Indices  # (s,), samples ahead, of their signs
    slow: float  # velocity over which friction's sign changes, m a sample
    w: Array  # (m + s + 1,), weights of motions, and of signs and 1, m

    @classmethod
    def fitted(cls, recordings: Sequence[tuple[Array, Array]], Np: int) -> "FirInverse | None":
        """Return the rival of look-ahead ``Np`` for commands and positions ``(n,)``, m, NaN if missing, or None."""
        known = [(x_d, x, np.flatnonzero(~np.isnan(x))) for x_d, x in recordings if np.isfinite(x).sum() > _TAPS]
        given = [(x_d, np.interp(np.arange(len(x)), k, x[k]), k) for x_d, x, k in known]  # what is missing is bridged
        slow = _SLOW * max((float(np.abs(np.diff(x_d)).max()) for x_d, *_ in given), default=0.0)
        if not slow > 0.0:
            return None
        roots = np.linspace(-math.sqrt(_FAR), 1.0, _TAPS)
        ahead = roots * np.abs(roots), np.append([-4.0, -2.0, -1.0], np.linspace(-0.5, 1.0, _SIGNS))  # in look-aheads
        taps, of_signs = (np.unique((Np * one).round()).astype(np.intp) for one in ahead)
        rival = cls(taps, of_signs, slow, np.empty(0))
        A = np.concatenate([rival._features(x)[k] for _, x, k in given])
        y = np.concatenate([(x_d - x)[k] for x_d, x, k in given])
        gram = A.T @ A
        return replace(rival, w=np.linalg.lstsq(gram + _RIDGE * np.diag(np.diag(gram)), A.T @ y, rcond=None)[0])

    def command(self, x: Array) -> Array:
        """Return the command for a wanted motion, ``(n,)``, m."""
        return np.asarray(x + self._features(x) @ self.w)

    def _features(self, x: Array) -> Array:
        """Return the regressors of a motion, ``(n, m + s + 1)``; it rests before and after."""
        near = [np.clip(np.arange(len(x))[:, None] + ahead, 0, len(x) - 1) for ahead in (self.taps, self.signs)]
        return np.column_stack((np.diff(x[near[0]]), np.tanh(np.gradient(x) / self.slow)[near[1]], np.ones(len(x))))


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
