"""Native core on a stream: an FMU that is given each sample as in a co-simulation, and what it said of it.

Where a stream has the commands that the drive gets now, and none ahead, its measured positions are held back by a
look-ahead. So the FMU sees what it would see in the controller, and all that is shown is older by the look-ahead.
"""

import math
from collections import deque
from collections.abc import Iterator
from time import perf_counter_ns
from typing import NamedTuple

import numpy as np

from hybridsep.base.errors import FmuError, SignalError
from hybridsep.cosim.loop import FmuController

from .sample import Sample

_FIGURES = ("rms_pb", "rms_hold", "rms_h")

_SHORTEST, _WIDTH, _BINS = 1e-7, math.log(1.02), 1000
"""Shortest time of a step that is resolved, s, logarithmic width of a bin and number of bins, which reach 40 s."""


class StepTimes:
    """Quantiles of ``n`` step times, the longest ``longest``, s, in constant memory: bins that are 2 % wide."""

    def __init__(self) -> None:
        self.n, self.longest = 0, 0.0
        self._counts = np.zeros(_BINS, dtype=np.int64)

    def add(self, time: float) -> None:
        """Add a time, s."""
        place = int(math.log(time / _SHORTEST) / _WIDTH) if time > _SHORTEST else 0
        self._counts[min(place, _BINS - 1)] += 1
        self.n += 1
        self.longest = max(self.longest, time)

    def quantile(self, share: float) -> float:
        """Return the time, s, that this share of the steps does not exceed, to 2 %; 0 without any step."""
        if self.n == 0:
            return 0.0
        place = int(np.searchsorted(np.cumsum(self._counts), math.ceil(share * self.n)))
        return min(_SHORTEST * math.exp((place + 1) * _WIDTH), self.longest) if place < _BINS - 1 else self.longest


class Row(NamedTuple):
    """Sample with what was predicted for it."""

    k: int  # its number
    t: float  # its time, s: the sender's, or ``k·T_s``
    # commanded and measured position, m; ``x_meas`` is NaN where it is missing
    x_d: float
    x_meas: float
    # physics-based and hybrid prediction, made when the window began, m, and the standard deviation of ``x_meas −
    # x_h``, 0 where it is not known
    x_pb: float
    x_h: float
    x_h_std: float
    active: int  # whether ``x_h`` is the hybrid prediction
    step: float  # time of the FMU's step with this sample's inputs, s


class _Published(NamedTuple):
    """What the FMU published for an instant, and the sample of that instant."""

    sample: Sample
    outputs: tuple[float, ...]
    active: int


class LiveCore:
    """FMU of a predictor on a stream.

    ``controller``: opened; ``first``: the first sample, at whose command the drive rests. ``T_s``: sampling interval,
    s; ``Np``, ``delay``: samples in a window; samples by which rows are behind the stream; ``n_samples``,
    ``n_missing``: number of samples taken in, and of samples without a measured position; ``times``: of the FMU's
    steps.
    """

    def __init__(self, controller: FmuController, first: Sample) -> None:
        self._controller = controller
        controller.initialise(first.x_d)
        self.T_s, self.Np = controller.T_s, controller.Np
        self._ahead, self._late = first.ahead, controller.late
        if self._late < 0:
            raise FmuError(f"{controller.name}: measurement_delay must be 0 or more live; give --measurement_delay 0")
        self.delay = 0 if first.ahead else self.Np
        self._start = Sample(first.x_d, first.x_d)
        self._held_back = deque([self._start] * self.delay)
        self._published: deque[_Published] = deque()
        self._last = self._start
        self._k = 0
        self.n_samples = self.n_missing = 0
        self.times = StepTimes()

    def step(self, sample: Sample) -> Row | None:
        """Take in a sample; return the row that is known by it, None during the first fill.

        SignalError if its command is ahead and the commands before were not, or the other way round; FmuError if the
        FMU refuses it.
        """
        if sample.ahead != self._ahead:
            raise SignalError(f"sample {sample.k}: either all commands are ahead (x_d_ahead) or none")
        self.n_samples += 1
        self.n_missing += math.isnan(sample.x_meas)
        self._held_back.append(sample)
        self._last = sample
        return self._step(sample.x_d, self._held_back.popleft())

    def finish(self) -> Iterator[Row]:
        """Yield the rows of the samples that are held back, with the last command held."""
        while self._held_back:
            row = self._step(self._last.x_d, self._held_back.popleft())
            if row is not None:
                yield row

    def status(self) -> dict[str, float | int]:
        """Return the FMU's own figures, m, what it rejected, and counts."""
        fmu = self._controller.fmu
        figures = {name: float(fmu.get(name)) for name in _FIGURES if name in fmu.variables}
        return {
            **figures,
            "n_samples": self.n_samples,
            "n_missing": self.n_missing,
            "n_rejected": self._controller.n_rejected(),
        }

    def _step(self, x_d: float, measured: Sample) -> Row | None:
        outputs, state = self._controller.outputs()
        self._published.append(_Published(measured, outputs, state - self._controller.kind.state_offset))
        begun = perf_counter_ns()
        try:
            self._controller.step(self._k, x_d, measured.x_meas)
        except FmuError as error:
            raise FmuError(f"sample {0 if measured.k is None else measured.k} is refused: {error}") from error
        step = 1e-9 * (perf_counter_ns() - begun)
        self.times.add(step)
        k, self._k = self._k, self._k + 1
        if len(self._published) <= self._late:
            return None
        # What arrives now was measured at the instant that this was published for
        then = self._published.popleft()
        if k < self.Np + self._late or then.sample.k is None:
            return None
        t = then.sample.k * self.T_s if then.sample.t is None else then.sample.t
        x_d, x_pb, x_h, x_h_std = then.outputs
        return Row(then.sample.k, t, x_d, measured.x_meas, x_pb, x_h, x_h_std, active=then.active, step=step)
