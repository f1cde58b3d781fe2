"""The paper's model of the residual: ``e_h = wᵀφ`` with the features of eq. (5) and the weights of eq. (6).

``φ(k) = [1, x_pb(k) … x_pb(k−q), e_pb(k−1) … e_pb(k−p)]``; every weight has the penalty λ.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..base.state import FIXED
from .regression import RidgeRegression, lags
from .window import FeatureScales, Forecast, ResidualWindow


@dataclass(frozen=True, eq=False)
class PaperModel:
    """State of the paper's model."""

    n_rejected: ClassVar[int] = 0
    farthest: ClassVar[float] = 0.0
    learned: ClassVar[tuple[()]] = ()

    settings: PredictorSettings = field(metadata=FIXED)
    # (q,) and (p,), m: past samples, oldest first, zero before the first one
    x_pb: Array
    e_pb: Array
    regression: RidgeRegression

    @classmethod
    def init(cls, settings: PredictorSettings) -> PaperModel:
        """Return the model at rest, with nothing learned."""
        p, q = settings.p, settings.q
        return cls(settings, np.zeros(q), np.zeros(p), RidgeRegression.init(2 + q + p, settings.lam))

    @property
    def regressions(self) -> tuple[RidgeRegression, ...]:
        """All regressions that another run begins with."""
        return (self.regression,)

    @property
    def lag_weights(self) -> Array:
        """Autoregressive weights, ``(p,)``."""
        return self.regression.weights[2 + self.settings.q :]

    @property
    def last(self) -> float:
        """Last measured residual, m."""
        return float(self.e_pb[-1])

    def restart(self) -> PaperModel:
        """Return the model at the beginning of another run, at rest; what was learned is kept."""
        return replace(self, x_pb=np.zeros_like(self.x_pb), e_pb=np.zeros_like(self.e_pb))

    def plan_ahead(self, preview: int) -> PaperModel:
        """Return the model where a compensator decides the commands: the same."""
        return self

    def take_over(self, learned: tuple[()], regressions: tuple[RidgeRegression, ...]) -> PaperModel:
        """Return the model with what another one has learned."""
        return replace(self, regression=regressions[0])

    def begin_in_motion(self, window: ResidualWindow, scales: FeatureScales | None) -> PaperModel:
        """Return the model at the beginning of a run in motion: the same, a run of the paper's begins at rest."""
        return self

    def learn(
        self, forecast: Forecast, x: Array, *, fold: bool = True, ahead: Array | None = None
    ) -> tuple[PaperModel, NDArray[np.bool_]]:
        """Learn from the measurement of a window; every sample is accepted.

        ``x``, (m,), m: measured positions of its first ``m`` samples, relative to the start; ``fold``: whether they
        are learned; the next window starts from them in any case; ``ahead``: none. Returns (m,).
        """
        m, Np = len(x), self.settings.Np
        predicted, regression = forecast.window.x_pb[:m], self.regression
        x_pb, e_pb = np.concatenate((self.x_pb, predicted)), np.concatenate((self.e_pb, x - predicted))
        p, q = len(self.e_pb), len(self.x_pb)
        for k in range(0, m, Np) if fold else ():
            n = min(Np, m - k)
            of_x, of_e = lags(x_pb[k : k + q + n], q + 1), lags(e_pb[k : k + p + n - 1], p)
            rows = np.column_stack((np.ones(n), of_x, of_e))  # φ(k), eq. (5)
            regression = regression.update(rows, e_pb[k + p : k + p + n])
        return replace(self, x_pb=x_pb[m:], e_pb=e_pb[m:], regression=regression), np.ones(m, dtype=np.bool_)

    def forecast(self, window: ResidualWindow, scales: FeatureScales | None = None) -> Forecast:
        """Predict the residual over the next window."""
        return Forecast(window, self._free_run(window.x_pb), np.zeros(len(window.x_pb)), scales)

    def operator(self, g_pb: Array, free_pb: Array) -> tuple[Array, Array]:
        """Return the first column of ``G_h`` and the free response of eq. (3), ``(n,)`` each, from ``G_pb``'s."""
        # x_h = x_pb + wᵀφ as filters: G_h = (1 + W_x(z) / (1 − W_e(z))) G_pb
        w, w_e = self.regression.weights, self.lag_weights
        g_h = g_pb + lfilter(w[1 : -len(w_e)], np.concatenate(([1.0], -w_e)), g_pb)
        return np.asarray(g_h), free_pb + self._free_run(free_pb)

    def _free_run(self, x_pb: Array) -> Array:
        """Return ``wᵀφ`` over a window ``x_pb``, relative to the start, in free run, ``(n,)`` both, m; eq. (4)."""
        w, w_e = self.regression.weights, self.lag_weights
        # Exogenous part: w₀ + Σ_i w_x,i x_pb(k−i)
        drive = w[0] + np.convolve(np.concatenate((self.x_pb, x_pb)), w[1 : -len(w_e)], "valid")
        # e(k) = drive(k) + Σ_i w_e,i e(k−i), an all-pole filter started from the measured residuals:
        # its state is z_j = Σ_m w_e,j+m e(−m)
        before = np.correlate(w_e, self.e_pb[::-1], "full")[len(w_e) - 1 :]
        e_h, _ = lfilter([1.0], np.concatenate(([1.0], -w_e)), drive, zi=before)
        return np.asarray(e_h)
