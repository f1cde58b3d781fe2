"""Order of samples that come over a network: repeated ones are ignored, late ones put in their place, gaps refused."""

from itertools import pairwise
from statistics import median
from time import monotonic

from hybridsep.base.errors import SignalError

from .sample import Sample

HELD_MAX = 64
"""Most samples that wait for one that is late; a network that reorders more would be slower than any window."""

_WAIT = 1.0  # longest wait for a sample that is late while none comes, s

_BACK_MAX = 10_000
"""Samples by which a number may be behind and still be a repeated one: further back, the sender has begun anew."""

_FOLLOW = 0.01
"""Share of its deviation by which the grid of times follows a sample: jitter of half a sample and drift are borne."""

_TIMED, _INTERVAL_TOLERANCE = 21, 0.25
"""Samples whose times tell the sender's interval, and the largest relative difference of its median from ``T_s``."""


class Order:
    """Order of a stream's samples by their number, or by their time where they have none.

    Samples with neither are taken as they come.

    ``T_s``: sampling interval, s. ``n_repeated``, ``n_late``: samples that came again, which are ignored; samples
    that came after a later one.
    """

    def __init__(self, T_s: float) -> None:
        self._T_s = T_s
        self._next: int | None = None
        self._origin = 0.0
        self._held: dict[int, Sample] = {}
        self._since = 0.0
        self._times: list[tuple[int, float]] = []
        self.n_repeated = self.n_late = 0

    def take(self, sample: Sample) -> list[Sample]:
        """Take a sample in; return the samples whose turn it is, with their numbers.

        SignalError if samples are missing before it, its number is far behind, or its times tell another interval.
        """
        if sample.k is None and sample.t is None:
            number = 0 if self._next is None else self._next
            self._next = number + 1
            return [sample._replace(k=number)]
        number = self._number(sample)
        if self._next is None:
            self._next = number
        if number < self._next - _BACK_MAX:
            raise SignalError(
                f"sample {number} came after sample {self._next - 1}: the sender began anew; so must this"
            )
        self._check_interval(number, sample.t)
        if number < self._next or number in self._held:
            self.n_repeated += 1
            return []
        if self._held and number < max(self._held):
            self.n_late += 1
        if not self._held:
            self._since = monotonic()
        self._held[number] = sample._replace(k=number)
        ready = []
        while self._next in self._held:
            ready.append(self._held.pop(self._next))
            self._next += 1
        if ready:
            self._since = monotonic()
        if len(self._held) > HELD_MAX:
            raise self._gap()
        return ready

    def check_waiting(self) -> None:
        """Raise SignalError if later samples have waited for a missing one for too long."""
        if self._held and monotonic() - self._since > _WAIT:
            raise self._gap()

    def finish(self) -> None:
        """Raise SignalError if a sample is still missing."""
        if self._held:
            raise self._gap()

    def _number(self, sample: Sample) -> int:
        """Return a sample's number: its own, or its place in time on a grid of ``T_s``, which follows the times."""
        if sample.k is not None or sample.t is None:
            return sample.k or 0
        if self._next is None:
            self._origin = sample.t
        number = round((sample.t - self._origin) / self._T_s)
        if self._next is None or number >= self._next:
            self._origin += _FOLLOW * (sample.t - self._origin - number * self._T_s)
        return number

    def _check_interval(self, number: int, t: float | None) -> None:
        """Raise SignalError if the sender's times have another interval than the machine."""
        if t is None or len(self._times) >= _TIMED:
            return
        self._times.append((number, t))
        if len(self._times) == _TIMED:
            times = [time for _, time in sorted(self._times)]
            found = median(after - before for before, after in pairwise(times))
            if not abs(found - self._T_s) <= _INTERVAL_TOLERANCE * self._T_s:
                raise SignalError(
                    f"samples come every {found:.4g} s by their times, but the machine has T_s = {self._T_s:g} s; send "
                    "them at that interval, with times in seconds"
                )

    def _gap(self) -> SignalError:
        last = min(self._held) - 1
        missing = f"sample {self._next} is" if last == self._next else f"samples {self._next} … {last} are"
        return SignalError(
            f"{missing} missing, and with them commands, without which nothing can be predicted; send every sample, "
            "without x_meas where it was not measured"
        )
