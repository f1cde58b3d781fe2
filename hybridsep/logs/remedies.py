"""Changes of a log: what keeps the file's meaning, done when it is read, and what an option asks for.

Each returns other samples and a line that says what was done, empty where nothing was, and leaves the given ones as
they are.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..base.errors import ParameterError
from ..base.signals import Array, Indices

_TURN = 2 * math.pi

_JUMP = 3.0  # largest difference of a jump from a whole turn, in the largest steps that are no jumps
_WITHIN = 1.05  # largest range, in turns, of a position modulo one turn with its noise

_ONE_PHASE, _CHANGES = 0.95, 50
"""Share of a slow sensor's changes that come in one sample of every n, which no other log of a hundred reached for any
n, and fewest changes that show it."""

_BRIDGED = 10
"""Samples missing in a row that get rows of their own on request, a tenth of the default window: a command of 2 m/s² at
1 kHz is interpolated within 0.3 µm over one of them, 30 µm over ten."""

_UNEVEN = 0.05
"""Relative difference of an interval from the log's from which it counts as uneven: at a feed rate of 80 mm/s and
1 kHz, 5 % of an interval are 4 µm of travel, comparable to the noise of an encoder."""


class Samples(NamedTuple):
    """Samples of a log."""

    t: Array  # (n,), s
    x_d: Array  # (n,), m or rad: commanded positions
    x_meas: Array  # (n,), m or rad: measured ones, NaN where missing
    T_s: float  # sampling interval, s
    starts: tuple[int, ...] = (0,)  # first samples of the segments; the first is 0
    signals: Mapping[str, Array] = {}  # (n,) each, m or rad: what the controller says beside them

    def segments(self) -> "list[Samples]":
        """Return each segment by itself."""
        ends = (*self.starts[1:], len(self.t))
        return [self._replace(starts=(0,)).at(slice(*piece)) for piece in zip(self.starts, ends, strict=True)]

    def at(self, which: slice | Indices) -> "Samples":
        """Return some of the samples; the segments remain where they are."""
        signals = {what: values[which] for what, values in self.signals.items()}
        return self._replace(t=self.t[which], x_d=self.x_d[which], x_meas=self.x_meas[which], signals=signals)


def whole_turns(given: Samples) -> tuple[Samples, str]:
    """Return a rotary axis's samples without the jumps of positions modulo one turn."""
    jumps = [_turn_jumps(x) for x in (given.x_d, given.x_meas)]
    n = sum(map(len, jumps))
    if not n:
        return given, ""
    x_d, x_meas = np.unwrap(given.x_d, period=_TURN), given.x_meas.copy()
    known = np.isfinite(x_meas)
    x_meas[known] = np.unwrap(x_meas[known], period=_TURN)
    x_meas -= _TURN * np.round(np.median(x_meas[known] - x_d[known]) / _TURN)
    # A command may well jump by one turn: the axis then follows it through, and loses it if the jump is taken out.
    if _error(x_d, x_meas) > _error(given.x_d, given.x_meas):
        return given, ""
    first = min(int(where[0]) for where in jumps if len(where))
    said = f"{n} jumps of a whole turn, the first at sample {first + 1}: both positions are unwrapped"
    return given._replace(x_d=x_d, x_meas=x_meas), said


def _turn_jumps(x: Array) -> Indices:
    """Return the samples at which a position, NaN where it is missing, is one turn away from where it was before."""
    known = np.flatnonzero(np.isfinite(x))
    steps = np.diff(x[known])
    if len(known) < 2 or np.ptp(x[known]) > _WITHIN * _TURN:
        return np.empty(0, dtype=np.intp)
    far = np.abs(steps) > _TURN / 2
    usual = float(np.abs(steps[~far]).max(initial=0.0))
    off = np.abs(np.abs(steps) - _TURN)
    return np.asarray(known[1:][far & (off <= _JUMP * usual) & (off < _TURN / 2)])


def _error(x_d: Array, x_meas: Array) -> float:
    """Return the RMS of the servo error around its median."""
    error = x_d - x_meas
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean((error - np.median(error)) ** 2)))


def at_sensor_phase(given: Samples) -> tuple[Samples, str]:
    """Return the samples in which a slow sensor is new, where the measurement is renewed every n samples.

    In a log of its controller's cycle such a sensor's position is held between; no model follows its steps.
    """
    changes = np.diff(given.x_meas)
    at = np.flatnonzero(np.isfinite(changes) & (changes != 0.0)) + 1
    sizes = np.abs(changes[at - 1])
    if len(at) < _CHANGES or np.isclose(np.median(sizes), sizes.min()):  # steps of an encoder that moves evenly
        return given, ""
    usual = int(np.bincount(np.diff(at)).argmax())  # a multiple of the period
    for n in (usual // k for k in range(1, usual) if usual % k == 0):
        share = float(np.bincount(at % n).max()) / len(at)
        if share < _ONE_PHASE:
            continue
        parts = []
        for start, end in zip(given.starts, (*given.starts[1:], len(given.t)), strict=True):
            own = at[(at > start) & (at < end)]
            phase = int(np.bincount(own % n).argmax()) if len(own) else start % n
            parts.append(np.arange(start + (phase - start) % n, end, n))
        kept = [part for part in parts if len(part)]
        starts = np.cumsum([0, *map(len, kept[:-1])])
        said = (
            f"the measured position is renewed every {n} samples ({100 * share:.4g} % of its changes come in one of "
            f"{n}): the samples in which it is new are taken, {n * given.T_s:g} s apart"
        )
        new = given.at(np.concatenate(kept))
        return new._replace(T_s=n * given.T_s, starts=tuple(starts.tolist())), said
    return given, ""


def shifted(given: Samples, delay: int) -> tuple[Samples, str]:
    """Return samples whose measured position was recorded ``delay`` samples too late, or too early if it is negative.

    Of each segment the samples are left out at whose instants nothing was measured then.

    ParameterError if no segment is as long.
    """
    parts = [part for part in given.segments() if len(part.t) > abs(delay)]
    if not parts:
        raise ParameterError(f"--delay must be less than the samples of a segment, got {delay}")
    first, last = max(-delay, 0), max(delay, 0)
    shifts = [(slice(first, len(part.t) - last), slice(last, len(part.t) - first)) for part in parts]
    parts = [
        part.at(here)._replace(x_meas=part.x_meas[there]) for part, (here, there) in zip(parts, shifts, strict=True)
    ]
    way = f"{abs(delay)} samples {'earlier' if delay > 0 else 'later'}"
    return _joined(parts), f"the measured position is taken {way} than recorded (--delay {delay})"


def uneven(t: Array, T_s: float, starts: tuple[int, ...]) -> Indices:
    """Return the samples, first ones of segments aside, whose intervals are not the log's."""
    deviations = np.abs(np.diff(t) / T_s - 1.0)
    deviations[np.array(starts[1:], dtype=np.intp) - 1] = 0.0
    return np.asarray(np.flatnonzero(deviations > _UNEVEN) + 1)


def resampled(given: Samples) -> tuple[Samples, str]:
    """Return samples at even times, linearly between the given ones, with rows of their own in short gaps.

    The measured position is missing in these, NaN. Of each segment the times begin with its own first one.
    """
    T_s = given.T_s
    n_lost = np.round(np.diff(given.t) / T_s)[np.array(given.starts[1:], dtype=np.intp) - 1] - 1.0
    starts = [0, *(start for start, n in zip(given.starts[1:], n_lost, strict=True) if not 0 < n <= _BRIDGED)]
    if len(starts) == len(given.starts) and not len(uneven(given.t, T_s, given.starts)):
        return given, ""
    parts = []
    for part in given._replace(starts=tuple(starts)).segments():
        n = int((part.t[-1] - part.t[0]) / T_s + 1e-6) + 1
        t = part.t[0] + T_s * np.arange(n)
        x_d, x_meas, *signals = (np.interp(t, part.t, x) for x in (part.x_d, part.x_meas, *part.signals.values()))
        after = np.clip(np.searchsorted(part.t, t), 1, len(part.t) - 1)
        apart = np.minimum(np.abs(part.t[after] - t), np.abs(t - part.t[after - 1]))
        x_meas[apart > T_s / 2] = np.nan
        parts.append(Samples(t, x_d, x_meas, T_s, signals=dict(zip(part.signals, signals, strict=True))))
    said = f"taken at even times, {T_s:g} s apart, linearly between samples; gaps of up to {_BRIDGED} have rows"
    return _joined(parts), f"{said} without measurement (--resample)"


def _joined(parts: list[Samples]) -> Samples:
    starts = np.cumsum([0, *(len(part.t) for part in parts[:-1])])
    t, x_d, x_meas = (np.concatenate([part[i] for part in parts]) for i in range(3))
    signals = {what: np.concatenate([part.signals[what] for part in parts]) for what in parts[0].signals}
    return Samples(t, x_d, x_meas, parts[0].T_s, tuple(starts.tolist()), signals)
