"""Look-ahead buffer between interpolator and drive, sample by sample.

The timing contract is the same as the FMUs'. Sample ``k`` brings ``x_d_ahead = r(k)`` and ``x_meas = x(k)``; after it
the outputs belong to ``k + 1``, and ``x_d(k) = r(k − delay)``, where ``delay`` is the planner's preview: ``Np`` with a
predictor only, which is the planner that changes nothing (:class:`_Unmodified`). When ``k + 1`` is a
multiple of ``Np``, all commands of the next window's preview and every measurement before it have arrived: the weights
are solved and the window is planned in that sample.

During the first fill (``k < delay``) the commanded position is the start. A mere predictor neither predicts nor learns
it. A compensator plans from the beginning, so that it can act ahead of a move within its preview; it does not learn
what is measured over the fill. ``t_init`` counts from the end of the fill.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from ..base.errors import SignalError, check_has
from ..base.settings import check, samples_before
from ..base.signals import Array, check_position
from ..base.state import arrays_of, pack, restored, restoring, unpack
from ..predict.predictor import HybridPredictor
from .monitor import Monitor


class SepState(IntEnum):
    """Model that the commands of a window are planned with; as an output also that the monitor tripped."""

    OFF = 0
    PHYSICS = 1
    HYBRID = 2
    TRIPPED = 3


@dataclass(frozen=True)
class PublishedWindow:
    """Commands of a window and the position predicted under them."""

    # (Np,), m: commanded position, and the modified command sent to the drive; the same without a planner
    x_d: Array
    x_dm: Array
    # (Np,), m: predictions under ``x_dm`` by the physics model and by the best available model
    x_pb: Array
    x_h: Array
    x_h_std: Array  # (Np,), m: standard deviation of the error of ``x_h``; 0 where it is not known
    state: int  # model that planned it (:class:`SepState`); 0 without a planner
    n_warm_up: int  # leading samples where ``x_h = x_pb``
    # leading samples that follow the plan before, while a controller makes this one; and the model that planned them
    n_followed: int = 0
    state_before: int = 0

    @classmethod
    def at_rest(cls, start: float, Np: int) -> "PublishedWindow":
        """Return the window of a drive at rest at ``start``, m, without a prediction."""
        rest = np.full(Np, start)
        return cls(rest, rest, rest, rest, np.zeros(Np), 0, Np)


class Planner(Protocol):
    """Interface of a planner, which modifies the commands of a window before they are predicted; it can be saved."""

    predictor: HybridPredictor
    preview: int  # samples of the command that it knows ahead, at least ``Np``
    monitor: Monitor  # takes in each sample that is measured, before its window is updated

    def restart(self, start: float | None = None, *, t_init: float = 0.0, lead_in: int = 0) -> None:
        """Begin another run, at rest at ``start``, m, for ``lead_in`` samples; what was learned is kept."""

    def plan(self, x_d: Array, load: Array) -> PublishedWindow:
        """Plan the next window from ``(preview,)`` commands and loads, m."""

    def update(self, x: Array) -> None:
        """Learn from the positions measured over the planned window, ``(Np,)``, m."""

    def to_bytes(self) -> bytes:
        """Return parameters and state, the predictor's included."""

    @classmethod
    def from_bytes(cls, blob: bytes) -> "Planner":
        """Return the planner of :meth:`to_bytes`."""


class _Unmodified:
    """Planner that sends the commands as they are, with a predictor's prediction of them.

    The lead-in is one window, at rest, which is neither predicted nor learned; ``at_rest`` says whether it is now.
    """

    def __init__(self, predictor: HybridPredictor, *, at_rest: bool) -> None:
        self.predictor, self.preview, self.monitor = predictor, predictor.Np, Monitor()
        self._at_rest = at_rest

    def restart(self, start: float | None = None, *, t_init: float = 0.0, lead_in: int = 0) -> None:
        self.predictor.restart(start, t_init=t_init)
        self._at_rest = lead_in > 0

    def plan(self, x_d: Array, load: Array) -> PublishedWindow:
        if self._at_rest:
            return PublishedWindow.at_rest(float(x_d[0]), self.preview)
        found = self.predictor.predict(x_d + load)
        return PublishedWindow(x_d, x_d, found.x_pb, found.x_h, found.x_h_std, 0, found.n_warm_up)

    def update(self, x: Array) -> None:
        if not self._at_rest:
            self.predictor.update(x)
        self._at_rest = False


_KIND = "look-ahead"


def _now(signal: str, what: str) -> Any:
    """Return the property of a look-ahead that is a signal of its window at the sample now."""
    return property(lambda ahead: float(getattr(ahead.window, signal)[ahead.k % ahead.Np]), doc=what)


def _rms(i: int, what: str) -> Any:
    """Return the property of a look-ahead that is the running RMS of one of its sums of squares."""
    return property(lambda ahead: math.sqrt(ahead._sums[i] / max(ahead._n_scored, 1)), doc=what)


class LookAhead:
    """Delay line of commands, with the position predicted ahead, and the commands modified by a planner.

    SignalError if its ``start`` is not finite.

    Parameters
    ----------
    model : HybridPredictor or Planner
        Restarted here: what it has learned is kept.
    start : float
        Position where the drive is at rest, m.
    t_init : float, optional
        Warm-up after the first fill, s; the predictor's own if left out, 0 for a warm start.
    unit : {"m", "rad"}
        Of positions; a rotary axis may have larger ones.

    Attributes
    ----------
    k : int
        Index of the next sample, from the beginning of the run.
    Np, delay : int
        Samples in a window; samples by which commands are delayed.
    model : HybridPredictor or Planner
    planner : Planner
        The model, or the predictor as the planner that changes nothing.
    window : PublishedWindow
        The window that ``k`` is part of.
    diverged : str
        Message of the window that diverged, after which every sample is refused; empty before.
    """

    x_d: float = _now("x_d", "Commanded position now, m.")
    x_dm: float = _now("x_dm", "Modified command now, m; ``x_d`` with only a predictor.")
    x_pb: float = _now("x_pb", "Physics-based prediction for now, m.")
    x_h: float = _now("x_h", "Prediction for now by the best available model, m.")
    x_h_std: float = _now("x_h_std", "Standard deviation of ``x_meas − x_h`` now, m; 0 where it is not known.")
    rms_e: float = _rms(0, "Running RMS of the measured servo error ``x_d − x_meas`` since ``t_init``, m; 0 before.")
    rms_pb: float = _rms(1, "Running RMS of ``x_meas − x_pb`` since ``t_init``, m; 0 before.")
    rms_h: float = _rms(2, "Running RMS of ``x_meas − x_h`` since ``t_init``, m; 0 before.")
    rms_hold: float = _rms(
        3, "Running RMS of hold, ``x_pb`` plus the last residual measured before a window, since ``t_init``, m."
    )

    diverged: str = ""
    _SAVED = (
        *("k", "start", "window", "_first_scored", "_n_scored", "_sums", "_residual", "_next", "_compared"),
        *("_ahead", "_measured", "_loads", "_first_load"),
    )

    def __init__(
        self, model: HybridPredictor | Planner, start: float, *, t_init: float | None = None, unit: str = "m"
    ) -> None:
        check_has("model", model, "restart", "update")
        self.unit = unit
        self._hold(model, 0)
        warm_up = self.predictor.settings.warm_up if t_init is None else check("t_init", t_init)
        check_position("the start value of x_d_ahead", start, unit=unit)
        self._at_rest(float(start))  # of a whole number the arrays would be of whole numbers
        self._first_scored += samples_before(warm_up, self.predictor.T_s)
        self.planner.restart(self.start, t_init=warm_up, lead_in=self.delay)
        self.window = self.planner.plan(self._ahead.copy(), self._loads.copy())
        self._compare()

    def _at_rest(self, start: float) -> None:
        """Set the state at the beginning of a run, without a warm-up, before its first window is planned."""
        self.k, self.start, self._n_scored, self._sums = 0, start, 0, np.zeros(4)
        self._first_scored = self._first_compared
        self._next = start  # where measurements come a sample early, that of the next sample
        self._residual = 0.0  # of the last sample measured, as published; 0 until one after the first fill is measured
        # Commanded position, x_pb, x_h, hold and modified command, for the samples whose measurement is still to come
        self._compared = np.full((5, self.predictor.settings.n_late + self.Np), start)
        # The last commands, r(k − delay) … r(k − 1), which is x_d(k) … x_d(k + delay − 1)
        self._ahead, self._measured = np.full(self.delay, start), np.full(self.Np, start)
        # Their loads, from that of the first sample on
        self._loads, self._first_load = np.zeros(self.delay), 0.0
        self.window = PublishedWindow.at_rest(start, self.Np)

    def _hold(self, model: HybridPredictor | Planner, k: int) -> None:
        self.model = model
        self.planner: Planner | _Unmodified = (
            _Unmodified(model, at_rest=k < model.Np) if isinstance(model, HybridPredictor) else model
        )
        self.predictor = self.planner.predictor
        self.Np, self.delay = self.predictor.Np, self.planner.preview

    @property
    def may_miss(self) -> bool:
        """Whether measurements may be NaN, which is missing."""
        return self.predictor.settings.averaging

    @property
    def batch(self) -> int:
        """``⌊k/Np⌋``."""
        return self.k // self.Np

    @property
    def e_servo(self) -> float:
        """Predicted servo error ``x_d − x_h``, m."""
        return self.x_d - self.x_h

    @property
    def hybrid_active(self) -> bool:
        """Whether ``x_h`` is the hybrid prediction now."""
        return self.k % self.Np >= self.window.n_warm_up

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible, with averaging; counted window by window."""
        return self.predictor.n_rejected

    @property
    def sep_state(self) -> int:
        """Model that planned the commands of now, or tripped (``SepState``); 0 with only a predictor."""
        if self.alarm:
            return SepState.TRIPPED
        return self.window.state if self.k % self.Np >= self.window.n_followed else self.window.state_before

    @property
    def no_measurement(self) -> bool:
        """Whether the change of the command fades, as no measurement came for ``measurement_timeout``."""
        return self.planner.monitor.is_lost

    @property
    def alarm(self) -> bool:
        """Whether the following error was above ``following_error_max``: the change fades until a reset."""
        return self.planner.monitor.is_tripped

    def sample(self, x_d_ahead: float, x_meas: float, x_load: float = 0.0) -> None:
        """Process sample ``k`` and advance to ``k + 1``.

        ``x_d_ahead``, m: ``r(k)``, the command for ``delay`` samples later; ``x_meas``, m: ``x(k)``, the position
        measured now, with a ``measurement_delay`` of −1 ``x(k + 1)``; ``x_load``, m: load for ``delay`` samples later,
        as :meth:`SepCompensator.plan <hybridsep.compensate.compensator.SepCompensator.plan>` takes it, which counts
        from that of the first sample.

        SignalError if one of them is not finite; nothing is changed then. If the window that begins diverges, every
        later sample is refused, too.
        """
        self.check(x_d_ahead, x_meas, x_load)
        if self.predictor.settings.measurement_delay < 0:
            x_meas, self._next = self._next, x_meas
        x_d, *_, x_dm = self._compared[:, self.k % self.Np].tolist()
        is_sound = self.planner.monitor.take_in(x_meas - x_d, x_dm - x_d)
        if self.k == 0:
            self._first_load = x_load
        self._ahead[self.k % self.delay] = x_d_ahead
        self._loads[self.k % self.delay] = x_load - self._first_load
        self._measured[self.k % self.Np] = x_meas if is_sound or not self.may_miss else math.nan
        if self.k >= self._first_compared and not math.isnan(x_meas):
            self._residual = float(x_meas - self._compared[1, self.k % self.Np])
        if self.k >= self._first_scored and not math.isnan(x_meas):
            self._n_scored += 1
            self._sums += np.square(x_meas - self._compared[:-1, self.k % self.Np])
        self.k += 1
        if self.k % self.Np == 0:
            self.planner.update(self._measured)
            ahead, loads = (np.roll(one, -(self.k % self.delay)) for one in (self._ahead, self._loads))
            try:
                self.window = self.planner.plan(ahead, loads)
            except SignalError as error:
                self.diverged = str(error)
                self.k -= 1  # the sample is refused, and outputs stay as they were
                raise
            self._compare()

    def check(self, x_d_ahead: float, x_meas: float, x_load: float = 0.0) -> None:
        """Raise SignalError if a window has diverged, or an input of the next sample is invalid."""
        if self.diverged:
            raise SignalError(self.diverged)
        for name, value in (("x_d_ahead", x_d_ahead), ("x_meas", x_meas), ("x_load", x_load)):
            check_position(name, value, f" at sample {self.k}", self.unit, may_miss=name == "x_meas" and self.may_miss)

    def to_bytes(self) -> bytes:
        """Return the complete state, predictor and planner included, as a versioned blob."""
        arrays = arrays_of(tuple(getattr(self, name) for name in self._SAVED))
        return pack(_KIND, {"unit": self.unit, "diverged": self.diverged}, arrays, {"model": self.model.to_bytes()})

    @classmethod
    def from_bytes(cls, blob: bytes, model_type: type[HybridPredictor] | type[Planner]) -> "LookAhead":
        """Return the look-ahead of :meth:`to_bytes`, whose predictor or planner is of the type ``model_type``.

        StateError if the blob is foreign, truncated or of another version.
        """
        meta, arrays, parts = unpack(_KIND, blob)
        look_ahead = cls.__new__(cls)
        with restoring(_KIND):
            look_ahead.unit, look_ahead.diverged = meta["unit"], meta["diverged"]
            look_ahead._hold(model_type.from_bytes(parts["model"]), int(arrays["0"]))
            look_ahead._at_rest(0.0)
            like = tuple(getattr(look_ahead, name) for name in cls._SAVED)
            for name, value in zip(cls._SAVED, restored(like, arrays), strict=True):
                setattr(look_ahead, name, value)
        return look_ahead

    @property
    def _first_compared(self) -> int:
        """First sample that is compared: with what was published after the first fill, as it was measured."""
        return self.delay + self.predictor.settings.n_late

    def _compare(self) -> None:
        """Append the window to what measurements are compared with."""
        window, hold = self.window, self.window.x_pb + self._residual
        new = window.x_d, window.x_pb, window.x_h, hold, window.x_dm
        self._compared = np.hstack((self._compared[:, self.Np :], new))
