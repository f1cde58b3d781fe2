"""Sample clock: communication steps of any size, counted in samples of ``T_s``.

The clock keeps its own time, the compensated sum of the step sizes: the importer's may be rounded or drift. An instant
within ``δ = max(0.05·T_s, 8 ulp(t))`` of a communication point, or half a step where that is less, is at that point,
and the next one is counted from there: the grid of samples follows the importer's. Elsewhere instants are ``T_s``
apart. An instant at a step's start belongs to that step, where the inputs of sample ``k`` are latched; the sample is
executed in the step whose end reaches the next instant. The arithmetic is the same as in ``hsep_clock.c``, operation by
operation.
"""

import math
from typing import NamedTuple

from .errors import FmuError, ParameterError

_STEP_MAX = 100.0  # longest communication step, s, which bounds the cost of one: 10⁷ samples at the shortest ``T_s``

_TOLERANCE = 0.05  # of T_s: the importer's times may be whole nanoseconds or in single precision


class SampleClock(NamedTuple):
    """Time in samples since the start."""

    T_s: float  # sampling interval, s
    k: int  # index of the last instant reached
    since: float  # time since that instant, s, ≥ 0; 0 where it is at the communication point
    carry: float  # accumulated rounding error of ``since``, s
    end: float  # end of the last step in the importer's time, s

    @classmethod
    def begin(cls, start: float, T_s: float) -> "SampleClock":
        """Return the clock at ``start``, s; FmuError if it cannot resolve a quarter of ``T_s``, or is infinite."""
        if not math.isfinite(start):
            raise FmuError(f"the start time must be finite, got {start} s")
        if not _resolution(start) <= 0.25 * T_s:
            raise FmuError(
                f"the start time must be small enough to resolve samples of T_s = {T_s:g} s, got {start:g} s"
            )
        return cls(T_s, 0, 0.0, 0.0, start)

    @property
    def latched(self) -> bool:
        """Whether the inputs of sample ``k`` have been read: a step began at its instant."""
        return self.since > 0

    def stepped(self, t: float, h: float) -> "ClockStep":
        """Return the communication step from ``t`` by ``h``, s, in samples.

        ParameterError if ``h`` is not in (0, 100] s; FmuError if ``t`` is not where the last step ended.
        """
        check_step_size(h)
        check_communication_point(t, self.end, 0.5 * self.T_s)
        T_s, end = self.T_s, t + h
        since, carry = _add(self.since, self.carry, h)
        # At times so large that doubles no longer resolve T_s / 4, δ is T_s / 4; of several points the nearest counts.
        delta = min(max(_TOLERANCE * T_s, _resolution(end)), 0.25 * T_s, 0.5 * h)
        n = math.floor((since + delta) / T_s)
        since, carry = _take(since, carry, n, T_s)
        if since < -delta:  # the quotient was rounded up to the next instant
            n -= 1
            since, carry = _take(since, carry, -1, T_s)
        reached = n > 0 and since <= delta  # the instant is at this point, and belongs to the next step
        after = SampleClock(T_s, self.k + n, *((0.0, 0.0) if reached else (since, carry)), end)
        return ClockStep(after, n, n + after.latched - self.latched, T_s - self.since if self.latched else 0.0)


class ClockStep(NamedTuple):
    """One communication step, in samples."""

    after: SampleClock  # clock at the end of the step
    n_samples: int  # samples executed in the step
    n_latched: int  # instants at which inputs are latched in the step
    first: float  # time from the start of the step to the first of them, s


def check_step_size(h: float) -> None:
    """Raise ParameterError if ``h``, s, is not a valid communication step size."""
    if not 0 < h <= _STEP_MAX:
        raise ParameterError(f"the communication step size must be > 0 and ≤ {_STEP_MAX:g} s, got {float(h)!r}")


def check_communication_point(t: float, end: float, tolerance: float) -> None:
    """Raise FmuError if a step begins at ``t`` and the last one ended at ``end``, s, unless rounding tells them apart.

    ``tolerance``, s, is the largest difference that may be rounding, or a few spacings of doubles, if they are coarser.
    """
    if not (math.isfinite(t) and abs(t - end) <= max(tolerance, _resolution(t))):
        raise FmuError(f"the communication point must be {end!r} s, where the last step ended, got {t!r} s")


def _resolution(t: float) -> float:
    """Return the resolution of a time ``t``, s: a few roundings of the importer's arithmetic."""
    return 8.0 * math.ulp(t)


def _add(since: float, carry: float, time: float) -> tuple[float, float]:
    """Return ``since + carry + time``, compensated: Knuth's two-sum, then renormalised."""
    total = since + time
    part = total - since
    lost = (since - (total - part)) + (time - part) + carry
    since = total + lost
    return since, lost - (since - total)


def _take(since: float, carry: float, n: int, T_s: float) -> tuple[float, float]:
    """Return ``since + carry − n·T_s``, by two products that are exact for ``n`` below 2²⁷."""
    scaled = 134217729.0 * T_s  # 2^27 + 1 splits a double into two halves (Veltkamp 1968)
    high = scaled - (scaled - T_s)
    return _add(*_add(since, carry, -n * high), -n * (T_s - high))
