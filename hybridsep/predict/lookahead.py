"""The predictor, sample by sample: the look-ahead buffer between the interpolator and the drive.

The FMU's timing contract. Sample ``k`` brings ``x_d_ahead = r(k)`` and ``x_meas = x(k)``; after it the outputs are
those of ``k + 1``, and the drive gets ``x_d(k) = r(k − Np)``. When ``k + 1`` is a multiple of ``Np``, the whole next
window and every measurement before it have arrived: the weights are solved and the window is predicted in that
sample. The first fill (``k < Np``) keeps the drive at its start; it is neither learned nor used.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.saved import Saved
from ..base.state import pack, unpack
from .predictor import HybridPredictor
from .sampled_window import SampledWindow, checked_start

__all__ = ["LookAhead"]

_KIND = "look-ahead"


class LookAhead(SampledWindow):
    """Delays commands by ``Np`` samples and predicts the drive's position while they wait.

    Parameters
    ----------
    predictor : HybridPredictor
        What predicts; put to the beginning of a run here, with what it has learned kept.
    start : float
        Position where the drive is at rest, m; the drive's command until the first window is there.

    Raises
    ------
    SignalError
        If ``start`` is not finite.
    """

    def __init__(self, predictor: HybridPredictor, start: float) -> None:
        predictor.new_run(checked_start(start), t_init=predictor.t_init)
        self.predictor = predictor
        self.Np = predictor.Np
        self.start = start
        self.k = 0
        rest = np.full(self.Np, start)
        self._ahead, self._measured = rest.copy(), rest.copy()
        self.x_d_window = rest
        self.x_pb_window = rest
        self.x_h_window = rest
        self._n_warm_up = self.Np
        # Sums of squares over the measured samples since t_init
        self._n, self._sum_pb, self._sum_h = 0, 0.0, 0.0

    @property
    def hybrid_active(self) -> bool:
        """Whether ``x_h`` is the hybrid prediction now."""
        return self.k % self.Np >= self._n_warm_up

    @property
    def rms_pb(self) -> float:
        """Running RMS of ``x_meas − x_pb`` since ``t_init``, m; 0 before."""
        return math.sqrt(self._sum_pb / self._n) if self._n else 0.0

    @property
    def rms_h(self) -> float:
        """Running RMS of ``x_meas − x_h`` since ``t_init``, m; 0 before."""
        return math.sqrt(self._sum_h / self._n) if self._n else 0.0

    def sample(self, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k`` and move on to ``k + 1``.

        Parameters
        ----------
        x_d_ahead : float, m
            ``r(k)``, the command for ``Np`` samples later.
        x_meas : float, m
            ``x(k)``, the position measured now.

        Raises
        ------
        SignalError
            If one of them is not finite; nothing is changed then. If the window that begins diverges, all that follows
            is refused, too.
        """
        self.check(x_d_ahead, x_meas)
        i = self.k % self.Np
        self._ahead[i], self._measured[i] = x_d_ahead, x_meas
        if self.k >= self.Np + self.predictor.n_init:
            self._n += 1
            self._sum_pb += (x_meas - self.x_pb) ** 2
            self._sum_h += (x_meas - self.x_h) ** 2
        self.k += 1
        if self.k % self.Np == 0:
            self._begin_window()

    def to_bytes(self) -> bytes:
        """Return the whole state, the predictor's included, as a versioned blob."""
        meta = {
            "start": self.start,
            "k": self.k,
            "n_warm_up": self._n_warm_up,
            "n": self._n,
            "sum_pb": self._sum_pb,
            "sum_h": self._sum_h,
            "diverged": self.diverged,
        }
        arrays = {
            "ahead": self._ahead,
            "measured": self._measured,
            "x_d": self.x_d_window,
            "x_pb": self.x_pb_window,
            "x_h": self.x_h_window,
        }
        return pack(_KIND, meta, arrays, {"predictor": self.predictor.to_bytes()})

    @classmethod
    def from_bytes(cls, blob: bytes) -> LookAhead:
        """Return the look-ahead that :meth:`to_bytes` described.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version.
        """
        saved = Saved(_KIND, *unpack(_KIND, blob))
        look_ahead = cls.__new__(cls)
        look_ahead.predictor = HybridPredictor.from_bytes(saved.part("predictor"))
        look_ahead.Np = Np = look_ahead.predictor.Np
        with saved.consistent():
            look_ahead.start = checked_start(saved.real("start"))
        look_ahead.k, look_ahead._n_warm_up = saved.whole("k"), saved.whole("n_warm_up", Np)
        look_ahead.diverged = saved.text("diverged")
        look_ahead._n = saved.whole("n")
        look_ahead._sum_pb, look_ahead._sum_h = (abs(saved.real(name)) for name in ("sum_pb", "sum_h"))
        look_ahead._ahead, look_ahead._measured = saved.array("ahead", Np), saved.array("measured", Np)
        look_ahead.x_d_window, look_ahead.x_pb_window = saved.array("x_d", Np), saved.array("x_pb", Np)
        look_ahead.x_h_window = saved.array("x_h", Np)
        if look_ahead.predictor.n_pending != (Np if look_ahead.k >= Np else 0) and not look_ahead.diverged:
            raise saved.error("the window that runs must be predicted")
        return look_ahead

    def _next_window(self) -> None:
        if self.k > self.Np:  # the first fill was not predicted and is not learned
            self.predictor.update(self._measured)
        prediction = self.predictor.predict(self._ahead)
        self.x_h_window, self.x_pb_window = prediction.x_h, prediction.x_pb
        self.x_d_window = self._ahead.copy()
        self._n_warm_up = prediction.n_warm_up
