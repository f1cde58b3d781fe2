"""Checks of a stream's first seconds: what its columns mean, as far as motion has shown it."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Thread

import numpy as np

from hybridsep.logs.checks import Finding, check
from hybridsep.logs.log import Log

from .sample import Sample

_SECONDS, _SAMPLES = 3.0, (500, 5000)
"""Time from the first motion on that is checked, and its least and most samples: the checks need a few moves."""


class FirstSeconds:
    """First samples of a stream, checked once the axis has moved for long enough, beside the run, or at its end.

    ``unit``: {"m", "rad"}: of the machine; ``T_s``: sampling interval, s; ``Np``: samples by which commands that are
    ahead come before the positions; ``stated``: whether the unit of the positions was stated; ``say``: called with
    the findings once, from a thread of its own.
    """

    def __init__(
        self, unit: str, T_s: float, Np: int, *, stated: bool, say: Callable[[Sequence[Finding]], object]
    ) -> None:
        self._unit, self._T_s, self._Np, self._stated, self._say = unit, T_s, Np, stated, say
        self._n = min(max(math.ceil(_SECONDS / T_s), _SAMPLES[0]), _SAMPLES[1])
        self._samples: list[Sample] | None = []
        self._moved = 0
        self._thread: Thread | None = None

    def take(self, sample: Sample) -> None:
        """Take in a sample, in its order."""
        if self._samples is None:
            return
        first = self._samples[0] if self._samples else sample
        self._samples.append(sample)
        self._moved += self._moved > 0 or sample.x_d != first.x_d
        if self._moved >= self._n:
            self._check(self._samples)
        elif not self._moved and len(self._samples) >= 2 * self._n:
            self._samples = self._samples[self._n :]

    def finish(self) -> None:
        """Check what there is at the stream's end, and wait for what is found."""
        if self._samples and len(self._samples) >= _SAMPLES[0]:
            self._check(self._samples)
        self._samples = None
        if self._thread is not None:
            self._thread.join()

    def _check(self, samples: list[Sample]) -> None:
        self._samples = None
        self._thread = Thread(target=self._find, args=(samples[-2 * self._n :],), daemon=True)
        self._thread.start()

    def _find(self, samples: list[Sample]) -> None:
        x_d, x = (np.array([getattr(one, name) for one in samples], dtype=np.float64) for name in ("x_d", "x_meas"))
        if samples[0].ahead:  # it is of the command that came a look-ahead before
            x_d, x = x_d[: -self._Np], x[self._Np :]
        if np.isnan(x).all():
            return
        t = self._T_s * np.arange(len(x), dtype=np.float64)
        log = Log(t, x_d, x, self._T_s, Path("stream"), unit=self._unit, unit_stated=self._stated)
        found = [one for one in check(log) if one.refused]  # others are counted as they come, or need more than seconds
        self._say(found)
