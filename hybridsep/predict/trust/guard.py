"""Guard against wrong measurements: missing, held, jumping or isolated values are not learned.

Every threshold is relative to what the sensor has shown so far, or to the motion that the physics model predicts, so
the guard has no scale of its own.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...base.errors import SignalError
from ...base.saved import COUNT_MAX
from ...base.signals import Array
from .constants import TrustConstants
from .held import HeldValue

__all__ = ["N_STATE", "SensorGuard"]

_DOUBTED = 3
"""Doubtful samples in a row from which on they may be true; fewer are wrong values."""

_WINDOWS = 2
"""Least patience, in windows: what is believed is learned by windows."""

_NEIGHBOURS = 2
"""Samples to either side that an isolated value is compared with."""

_COUNTS = ("gap", "doubtful", "holding")
_NUMBERS = ("last", "spread", "pace", "last_x_pb", "vibration", "before_run", "measured", "stood")

N_STATE = len(_COUNTS) + len(_NUMBERS) + HeldValue.N_STATE + _NEIGHBOURS
"""Numbers of a state."""

_CHANGES = 8
"""Changes that a window has to have to tell the vibration: most of fewer could be those of one wrong value."""


class SensorGuard:
    """Judges each sample of a window from its residual.

    Parameters
    ----------
    Np : int
        Samples of a usual window.
    T_s : float, s
    constants : TrustConstants

    Attributes
    ----------
    patience, patience_standing : int
        Doubtful samples in a row after which another level is believed, and an axis that stands still.
    last : float, m
        Last accepted residual.
    gap : int
        Samples since then.
    held : HeldValue
    suspect : (n,) array of bool
        Samples of the last window that may be of a held sensor, believed or not: equal under a predicted motion.
    holding : int
        Whether the sensor may be held: the last value was equal under more motion than the axis itself stands, 0 or 1.
    stood : float, m
        Largest predicted motion under which the axis itself stood: it went on from there, while a sensor that was held
        goes on from where the axis has come to meanwhile.
    measured, before_run : float, m
        Last measured residual, and that before the run of equal values.
    spread : float, m
        Mean deviation of a residual from the median of its neighbours; −1 before the first window.
    pace : float, m
        Largest predicted motion of a sample in the last window.
    vibration : float, m
        Median change of the residual from sample to sample, beyond that of noise: a drive that rings at rest is not at
        rest, though its model is.
    doubtful : int
        Held or jumping samples in a row.
    last_x_pb : float, m
        Last prediction; NaN before the first.
    before : (2,) array, m
        Last residuals, oldest first; NaN where missing.
    """

    def __init__(self, Np: int, T_s: float, constants: TrustConstants) -> None:
        self.constants = constants
        self.patience = max(_WINDOWS * Np, math.ceil(constants.patience / T_s))
        self.patience_standing = max(_WINDOWS * Np, math.ceil(constants.patience_standing / T_s))
        self.held, self.spread, self.vibration, self.stood = HeldValue(), -1.0, 0.0, 0.0
        self.restart()

    def restart(self) -> None:
        """Begin another run; what is known of the sensor is kept."""
        self.last, self.gap, self.doubtful = 0.0, 0, 0
        self.held.restart()
        self.holding = 0
        self.suspect: NDArray[np.bool_] = np.zeros(0, dtype=np.bool_)
        self.pace = self.measured = self.before_run = 0.0
        self.before = np.zeros(_NEIGHBOURS)
        self.last_x_pb = math.nan

    def accepts(self, x: Array, x_pb: Array, largest: float) -> NDArray[np.bool_]:
        """Return whether each sample of a window is plausible, ``(n,)`` bool.

        Parameters
        ----------
        x : (n,) array, m
            Measured positions, NaN where missing.
        x_pb : (n,) array, m
            Their physics-based prediction.
        largest : float, m
            Largest accepted residual so far.
        """
        residuals = x - x_pb
        deviation = self._deviations(residuals)
        first = x_pb[0] if math.isnan(self.last_x_pb) else self.last_x_pb
        pace = float(np.abs(np.diff(x_pb, prepend=first)).max())
        motion = max(pace, self.pace, self.vibration)
        plausible = self._plausible(motion, largest)
        self.suspect = np.zeros(len(x), dtype=np.bool_)
        accepted = np.isfinite(x)
        for k, (value, position, e) in enumerate(zip(x.tolist(), x_pb.tolist(), residuals.tolist(), strict=True)):
            self.gap += 1
            if not accepted[k]:
                continue
            if value != self.held.value:
                self._tell_rest(value, e, plausible)
            self.measured = e
            standing = min(self.constants.stood_more * self.stood, self.constants.stood_residual * largest)
            self.holding = int(self.held.holds(value, position, still=max(plausible, standing)))
            if self.holding:
                run = slice(max(k - self.held.repeats + 1, 0), k + 1)
                self.suspect[run] = True
                self.doubtful += 1
                if self.doubtful <= self.patience_standing:
                    accepted[run] = False
                else:  # the axis itself stands still
                    self.last, self.gap = e, 0
                continue
            if self.spread >= 0.0:
                nearest = min(max(e, min(self.last, 0.0)), max(self.last, 0.0))  # towards the prediction is no jump
                jumping = abs(e - nearest) > plausible + self.gap * self.constants.pace * motion
                self.doubtful = self.doubtful + 1 if jumping else 0
                if (jumping and self.doubtful <= self.patience) or deviation[k] > plausible:
                    accepted[k] = False
                    continue
            self.last, self.gap, self.doubtful = e, 0, 0
        self._follow(deviation[np.isfinite(x)], plausible)
        self._follow_vibration(residuals)
        self.pace, self.last_x_pb = pace, float(x_pb[-1])
        self.before = np.concatenate((self.before, residuals))[-_NEIGHBOURS:]
        return accepted

    def doubted(self, x_pb: Array, largest: float) -> Array | None:
        """Return what the residual of the next window may be instead, ``(n,)``, m; None if nothing is doubted.

        An axis that stands still, believed or not, stands until it does not; or the rejected level is the true one.

        Parameters
        ----------
        x_pb : (n,) array, m
            Physics-based prediction of the next window.
        largest : float, m
            Largest accepted residual so far.
        """
        held = self.held
        motion = min(held.high - held.low, self.pace * min(held.repeats, self.patience))
        plausible = self._plausible(max(self.pace, self.vibration), largest)
        if self.holding or held.stays(motion, still=plausible):
            return held.value - x_pb if math.isfinite(held.value) else None
        last = float(self.before[-1])
        if _DOUBTED <= self.doubtful <= self.patience and math.isfinite(last):
            return np.full(len(x_pb), last)
        return None

    def _plausible(self, motion: float, largest: float) -> float:
        """Return the plausible deviation, m, under a predicted motion of a sample, m."""
        c, step = self.constants, 0.0 if math.isinf(self.held.step) else self.held.step
        return c.spreads * self.spread + c.resolution * step + c.small * largest + c.ripple * motion

    def _tell_rest(self, value: float, e: float, plausible: float) -> None:
        """Tell, where a run of equal values ends, an axis that stood from a sensor that was held."""
        held = self.held
        motion = held.high - held.low
        if held.stays(motion, still=plausible, first_step=abs(value - held.value)):
            if abs(e - self.measured) <= abs(e - self.before_run):
                self.stood = max(self.stood, motion)
            elif motion <= self.constants.stood_more * self.stood:  # without that bound: the belief was wrong
                self.stood = 0.0
        self.before_run = self.measured

    def learned(self) -> Array:
        """Return what is known of the sensor, for another run; a spread of −1 and an infinite step are not known."""
        return np.array([self.spread, self.held.step, self.vibration, self.stood])

    def restore_learned(self, learned: Array) -> None:
        """Restore :meth:`learned` numbers, which :meth:`is_sound`."""
        self.spread, self.held.step, self.vibration, self.stood = learned.tolist()

    @staticmethod
    def is_sound(learned: Array) -> bool:
        """Return whether :meth:`learned` numbers are in range."""
        spread, step, *motions = learned.tolist()
        known = step > 0.0 and (spread == -1.0 or 0.0 <= spread < math.inf)
        return known and all(0.0 <= motion < math.inf for motion in motions)

    def state(self) -> list[float]:
        """Return the state as plain numbers."""
        own = [float(getattr(self, name)) for name in (*_COUNTS, *_NUMBERS)]
        return [*own, *self.held.state(), *self.before.tolist()]

    def restore(self, state: Array) -> None:
        """Restore a :meth:`state`; SignalError if it is none."""
        ends = np.cumsum((len(_COUNTS), len(_NUMBERS), HeldValue.N_STATE))
        counts, own, held, before = np.split(state, ends)
        values = dict(zip(_NUMBERS, own.tolist(), strict=True))
        if not all(0 <= count <= COUNT_MAX and count == int(count) for count in counts) or counts[2:].max() > 1:
            raise SignalError("the guard's gap and doubtful samples must be counts, and holding 0 or 1")
        if (
            np.isinf(own).any()
            or np.isinf(before).any()
            or np.isnan([values["last"], values["measured"], values["before_run"]]).any()
        ):
            raise SignalError("the guard's residuals and positions must be finite")
        if not all(values[name] >= 0.0 for name in ("pace", "vibration", "stood")):
            raise SignalError("the guard's motions must be ≥ 0")
        if not (values["spread"] >= 0.0 or values["spread"] == -1.0):
            raise SignalError("the guard's spread must be ≥ 0 or −1")
        self.held.restore(held)
        for name, value in values.items():
            setattr(self, name, value)
        for name, count in zip(_COUNTS, counts.tolist(), strict=True):
            setattr(self, name, int(count))
        self.before = before.copy()

    def _deviations(self, residuals: Array) -> Array:
        """Return the deviation of each residual from the median of its neighbours and itself, ``(n,)``, m."""
        padded = np.concatenate((self.before, residuals, np.full(_NEIGHBOURS, np.nan)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOURS + 1)
        known = np.isfinite(windows)
        ordered = np.sort(np.where(known, windows, np.inf), axis=1)
        count = known.sum(axis=1)
        rows = np.arange(len(residuals))
        median = 0.5 * (
            ordered[rows, np.maximum(count - 1, 0) // 2] + ordered[rows, np.minimum(count // 2, 2 * _NEIGHBOURS)]
        )
        return np.where(np.isfinite(residuals), np.abs(residuals - median), 0.0)

    def _follow(self, deviations: Array, plausible: float) -> None:
        """Follow the mean deviation of the measured samples; one beyond what is plausible counts as that."""
        if not len(deviations):
            return
        if self.spread < 0.0:
            self.spread = float(deviations.mean())
            return
        mean = float(np.minimum(deviations, plausible).mean())
        self.spread += (self.constants.rise if mean > self.spread else self.constants.fall) * (mean - self.spread)

    def _follow_vibration(self, residuals: Array) -> None:
        """Follow the median change of the residual, which no minority of wrong values moves."""
        changes = np.abs(np.diff(residuals, prepend=self.before[-1]))
        changes = changes[np.isfinite(changes)]
        if len(changes) >= _CHANGES:
            seen = max(float(np.median(changes)) - self.constants.vibration_noise * self.spread, 0.0)
            self.vibration += (1.0 if seen > self.vibration else self.constants.fall) * (seen - self.vibration)
