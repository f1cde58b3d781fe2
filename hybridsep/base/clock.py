"""Sample clock: communication steps of any size, counted in samples of ``T_s``.

The instants are ``t_k = start + k·T_s``. The clock keeps its own time, the compensated sum of the step sizes, because
the importer's may be rounded or drift. An instant within ``δ = max(1e-6·T_s, 8 ulp(t))`` of a step's start belongs to
that step, where the inputs of sample ``k`` are latched at ``t_k``; the sample is executed in the step whose end reaches
``t_{k+1}``. The arithmetic is that of ``hsep_clock.c``, operation by operation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from .errors import FmuError, ParameterError, StateError

__all__ = ["STEP_MAX", "ClockStep", "SampleClock", "check_step_size"]

STEP_MAX = 100.0
"""Longest communication step, s, which bounds the cost of one step: 10⁷ samples at the shortest ``T_s``."""

_TOLERANCE = 1e-6  # of T_s
_SPACINGS = 8.0  # ulp(t): a few roundings of the importer's arithmetic
_SPLIT = 134217729.0  # 2^27 + 1, splits a double into two halves (Veltkamp 1968)


class SampleClock(NamedTuple):
    """Time in samples since ``start``.

    Attributes
    ----------
    start, T_s : float
        Start time and sampling interval, s.
    k : int
        Index of the last instant reached, ``t_k``.
    since : float
        Time since ``t_k``, s; slightly below 0 where a step ended within δ before ``t_k``.
    carry : float
        Accumulated rounding error of ``since``, s.
    end : float
        End of the last step in the importer's time, s.
    latched : bool
        Whether the inputs of sample ``k`` have been read.
    """

    start: float
    T_s: float
    k: int
    since: float
    carry: float
    end: float
    latched: bool

    @classmethod
    def begin(cls, start: float, T_s: float) -> SampleClock:
        """Return the clock at ``start``, s.

        Raises
        ------
        FmuError
            If ``start`` is not finite, or so large that doubles near it do not resolve a quarter of ``T_s``.
        """
        if not math.isfinite(start):
            raise FmuError(f"the start time must be finite, got {start} s")
        if not _resolution(start) <= 0.25 * T_s:
            raise FmuError(
                f"the start time must be small enough to resolve samples of T_s = {T_s:g} s, got {start:g} s"
            )
        return cls(start, T_s, 0, 0.0, 0.0, start, False)

    def stepped(self, t: float, h: float) -> ClockStep:
        """Return the communication step from ``t`` by ``h``, s, in samples.

        Raises
        ------
        ParameterError
            If ``h`` is not in (0, 100] s.
        FmuError
            If ``t`` is not where the last step ended.
        """
        check_step_size(h)
        if not (math.isfinite(t) and abs(t - self.end) <= max(0.5 * self.T_s, _resolution(t))):
            raise FmuError(f"the communication point must be {self.end!r} s, where the last step ended, got {t!r} s")
        T_s = self.T_s
        since, carry = _add(self.since, self.carry, h)
        now = self.start + (self.k * T_s + since)
        # At times so large that doubles no longer resolve T_s / 4, δ is T_s / 4.
        delta = min(max(_TOLERANCE * T_s, _resolution(now)), 0.25 * T_s)
        n = math.floor((since + delta) / T_s)
        since, carry = _take(since, carry, n, T_s)
        if since < -delta:  # the quotient was rounded up to the next instant
            n -= 1
            since, carry = _take(since, carry, -1, T_s)
        latched = since > delta  # an instant within δ of the end belongs to the next step
        after = SampleClock(self.start, T_s, self.k + n, since, carry, t + h, latched)
        return ClockStep(after, n, n + latched - self.latched, (T_s if self.latched else 0.0) - self.since)

    def state(self) -> list[float]:
        """Return all fields as numbers."""
        return list(map(float, self))

    @classmethod
    def from_state(cls, state: Sequence[float]) -> SampleClock:
        """Return the clock of a :meth:`state`.

        Raises
        ------
        StateError
            If a field is out of range.
        """
        start, T_s, k, since, carry, end, latched = map(float, state)
        fits = all(map(math.isfinite, (start, T_s, end))) and T_s > 0 and abs(since) <= T_s
        if not (fits and 0 <= k < 2**53 and k == int(k) and abs(carry) <= abs(since) and latched in (0, 1)):
            raise StateError(f"the saved clock is inconsistent: {list(state)}")
        return cls(start, T_s, int(k), since, carry, end, bool(latched))


class ClockStep(NamedTuple):
    """One communication step, in samples.

    Attributes
    ----------
    after : SampleClock
        Clock at the end of the step.
    n_samples : int
        Samples executed in the step.
    n_latched : int
        Instants at which inputs are latched in the step.
    first : float
        Time from the start of the step to the first of them, s; may be slightly below 0.
    """

    after: SampleClock
    n_samples: int
    n_latched: int
    first: float


def check_step_size(h: float) -> None:
    """Raise ParameterError if ``h``, s, is not a valid communication step size."""
    if not 0 < h <= STEP_MAX:
        raise ParameterError(f"the communication step size must be > 0 and ≤ {STEP_MAX:g} s, got {float(h)!r}")


def _resolution(t: float) -> float:
    """Return the resolution of a time ``t``, s: a few spacings of doubles."""
    return _SPACINGS * math.ulp(t)


def _add(since: float, carry: float, time: float) -> tuple[float, float]:
    """Return ``since + carry + time``, compensated: Knuth's two-sum, then renormalised."""
    total = since + time
    part = total - since
    lost = (since - (total - part)) + (time - part) + carry
    since = total + lost
    return since, lost - (since - total)


def _take(since: float, carry: float, n: int, T_s: float) -> tuple[float, float]:
    """Return ``since + carry − n·T_s``, by two products that are exact for ``n`` below 2²⁷."""
    scaled = _SPLIT * T_s
    high = scaled - (scaled - T_s)
    return _add(*_add(since, carry, -n * high), -n * (T_s - high))
