"""The compensator, sample by sample: the look-ahead buffer between the interpolator and the drive.

The FMU's timing contract, as in :mod:`hybridsep.lookahead`, with ``preview`` samples in place of ``Np``. Sample ``k``
brings ``x_d_ahead = r(k)`` and ``x_meas = x(k)``; after it the outputs are those of ``k + 1``, and
``x_d(k) = r(k − preview)``. When ``k + 1`` is a multiple of ``Np``, the whole preview of the next window and every
measurement before it have arrived: the weights are solved and the window is planned in that sample.

During the first fill (``k < preview``) the commanded position is the start. Plans are made from the beginning, so that
a move that is already in sight can be prepared; what is measured over the fill is not learned. ``t_init`` counts from
its end, and learning starts with the first window that begins there or later.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.saved import Saved
from ..base.state import pack, unpack
from ..predict.sampled_window import SampledWindow, checked_start
from .compensator import SepCompensator, SepState

__all__ = ["SepLookAhead"]

_KIND = "sep-look-ahead"


class SepLookAhead(SampledWindow):
    """Delays commands by ``preview`` samples and modifies them while they wait.

    Parameters
    ----------
    compensator : SepCompensator
        What plans; put to the beginning of a run here, with what it has learned kept.
    start : float
        Position where the drive is at rest, m.
    t_init : float, optional
        Warm-up, s, in which the physics model plans; the predictor's own if left out, 0 for a warm start.

    Raises
    ------
    SignalError
        If ``start`` is not finite.
    """

    def __init__(self, compensator: SepCompensator, start: float, *, t_init: float | None = None) -> None:
        predictor = compensator.predictor
        self.compensator = compensator
        self.preview, self.Np = compensator.preview, predictor.Np
        self.start = checked_start(start)
        self.k = 0
        compensator.new_run(start, t_init=predictor.t_init if t_init is None else t_init, lead_in=self.preview)
        # The last preview commands: r(k − preview) … r(k − 1), which is x_d(k) … x_d(k + preview − 1)
        self._ahead = np.full(self.preview, start)
        self._measured = np.full(self.Np, start)
        # Sums of squares of the servo error and of the two models' errors over the measured samples since t_init
        self._first = self.preview + max(predictor.n_init - self.preview, 0)
        self._n, self._sums = 0, np.zeros(3)
        self._next_window()

    @property
    def x_dm(self) -> float:
        """Modified command now, m: what the drive gets."""
        return self._now(self.x_dm_window)

    @property
    def rms_e(self) -> float:
        """Running RMS of the measured servo error ``x_d − x_meas`` since ``t_init``, m; 0 before."""
        return self._rms(0)

    @property
    def rms_pb(self) -> float:
        """Running RMS of ``x_meas − x_pb`` since ``t_init``, m; 0 before."""
        return self._rms(1)

    @property
    def rms_h(self) -> float:
        """Running RMS of ``x_meas − x_h`` since ``t_init``, m; 0 before."""
        return self._rms(2)

    def sample(self, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k`` and move on to ``k + 1``.

        Parameters
        ----------
        x_d_ahead : float, m
            ``r(k)``, the command for ``preview`` samples later.
        x_meas : float, m
            ``x(k)``, the position measured now.

        Raises
        ------
        SignalError
            If one of them is not finite; nothing is changed then. If the window that begins diverges, all that follows
            is refused, too.
        """
        self.check(x_d_ahead, x_meas)
        self._ahead[self.k % self.preview] = x_d_ahead
        self._measured[self.k % self.Np] = x_meas
        if self.k >= self._first:
            self._n += 1
            self._sums += np.square([x_meas - self.x_d, x_meas - self.x_pb, x_meas - self.x_h])
        self.k += 1
        if self.k % self.Np == 0:
            self.compensator.update(self._measured)
            self._begin_window()

    def to_bytes(self) -> bytes:
        """Return the whole state, the compensator's included, as a versioned blob."""
        meta = {"start": self.start, "k": self.k, "first": self._first, "n": self._n, "state": int(self.sep_state)}
        arrays = {
            "sums": self._sums,
            "ahead": self._ahead,
            "measured": self._measured,
            "x_d": self.x_d_window,
            "x_dm": self.x_dm_window,
            "x_pb": self.x_pb_window,
            "x_h": self.x_h_window,
        }
        return pack(_KIND, {**meta, "diverged": self.diverged}, arrays, {"compensator": self.compensator.to_bytes()})

    @classmethod
    def from_bytes(cls, blob: bytes) -> SepLookAhead:
        """Return the look-ahead that :meth:`to_bytes` described.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version.
        """
        saved = Saved(_KIND, *unpack(_KIND, blob))
        look_ahead = cls.__new__(cls)
        look_ahead.compensator = compensator = SepCompensator.from_bytes(saved.part("compensator"))
        look_ahead.preview, look_ahead.Np = preview, Np = compensator.preview, compensator.predictor.Np
        with saved.consistent():
            look_ahead.start = checked_start(saved.real("start"))
        look_ahead.k, look_ahead._first, look_ahead._n = (saved.whole(name) for name in ("k", "first", "n"))
        look_ahead.diverged = saved.text("diverged")
        look_ahead._sums = np.abs(saved.array("sums", 3, finite=False))
        look_ahead._ahead, look_ahead._measured = saved.array("ahead", preview), saved.array("measured", Np)
        look_ahead.x_d_window, look_ahead.x_dm_window = saved.array("x_d", Np), saved.array("x_dm", Np)
        look_ahead.x_pb_window, look_ahead.x_h_window = saved.array("x_pb", Np), saved.array("x_h", Np)
        look_ahead.sep_state = SepState(saved.whole("state", max(SepState)))
        if not np.isfinite(look_ahead._sums).all() or not (compensator.is_planned or look_ahead.diverged):
            raise saved.error("the window that runs must be planned, and the sums of its errors finite")
        return look_ahead

    def _rms(self, i: int) -> float:
        return math.sqrt(self._sums[i] / self._n) if self._n else 0.0

    def _next_window(self) -> None:
        x_d = np.roll(self._ahead, -(self.k % self.preview))
        plan = self.compensator.plan(x_d)
        self.sep_state = plan.state
        self.x_d_window = x_d[: self.Np].copy()
        self.x_dm_window = plan.x_dm
        self.x_pb_window = plan.x_pb
        self.x_h_window = plan.x_h
