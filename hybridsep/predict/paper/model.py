"""The paper's model of the residual: ``e_h = wᵀφ`` with the features of eq. (5) and the weights of eq. (6)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ...base.saved import Saved
from ...base.settings import PredictorSettings
from ...base.signals import Array
from ..forecast import FeatureScales, Forecast
from ..regression import RidgeRegression
from ..residual_model import ResidualModel, SavedFields, WindowInputs
from .features import FeatureLayout, PastSamples

__all__ = ["PaperModel"]


class PaperModel(ResidualModel[Forecast]):
    """Linear model of the residual by its lags and those of ``x_pb``, every weight with the penalty λ.

    Parameters
    ----------
    settings : PredictorSettings

    Attributes
    ----------
    layout : FeatureLayout
    past : PastSamples
    """

    may_miss: ClassVar[bool] = False

    def __init__(self, settings: PredictorSettings) -> None:
        self.Np = settings.Np
        self.layout = FeatureLayout(settings.p, settings.q)
        self.past = PastSamples(self.layout, settings.Np)
        self.regression = RidgeRegression(self.layout.n, settings.lam)
        self.n_rejected = 0

    @property
    def lag_weights(self) -> Array:
        """Autoregressive weights, ``(p,)``."""
        return self.regression.weights[self.layout.e_pb]

    @property
    def last(self) -> float:
        """Last measured residual, m."""
        return float(self.past.e_pb[-1])

    def restart(self) -> None:
        """Begin another run, at rest; what was learned is kept."""
        self.past.restart()

    def forecast(self, window: WindowInputs, scales: FeatureScales | None = None) -> Forecast:
        """Predict the residual over the next window; its features have no scales."""
        n = len(window.x_pb)
        return Forecast(window.x_d, window.x_pb, self.free_run(window.x_pb), np.zeros(n))

    def free_run(self, x_pb: Array) -> Array:
        """Return ``wᵀφ`` over a window in free run, ``(n,)``, m; eq. (4).

        Parameters
        ----------
        x_pb : (n,) array, m
            Physics-based prediction, relative to the start.
        """
        w, layout, past = self.regression.weights, self.layout, self.past
        # Exogenous part: w₀ + Σ_i w_x,i x_pb(k−i)
        drive = w[layout.bias] + np.convolve(np.concatenate((past.x_pb, x_pb)), w[layout.x_pb], "valid")
        # e(k) = drive(k) + Σ_i w_e,i e(k−i), an all-pole filter started from the measured residuals:
        # its state is z_j = Σ_m w_e,j+m e(−m)
        w_e = w[layout.e_pb]
        state = np.correlate(w_e, past.e_pb[::-1], "full")[layout.p - 1 :]
        e_h, _ = lfilter([1.0], np.concatenate(([1.0], -w_e)), drive, zi=state)
        return np.asarray(e_h)

    def impulse_response(self, g_pb: Array) -> Array:
        """Return that of the hybrid model, ``(n,)``, from that of ``G_pb``: the first column of ``G_h`` of eq. (3)."""
        # x_h = x_pb + wᵀφ as filters: G_h = (1 + W_x(z) / (1 − W_e(z))) G_pb
        w_x, denominator = self.regression.weights[self.layout.x_pb], np.concatenate(([1.0], -self.lag_weights))
        return np.asarray(g_pb + lfilter(w_x, denominator, g_pb))

    def learn(self, forecast: Forecast, x: Array, *, fold: bool = True) -> NDArray[np.bool_]:
        """Learn from the measurement of a window; every sample is accepted."""
        m = len(x)
        x_pb = forecast.x_pb[:m]
        e_pb = x - x_pb
        for i in range(0, m, self.Np):
            stop = min(i + self.Np, m)
            self.past.append(x_pb[i:stop], e_pb[i:stop])
            if fold:
                self.regression.update_stacked(self.past.rows(stop - i))
            self.past.advance(stop - i)
        return np.ones(m, dtype=np.bool_)

    @staticmethod
    def check_sizes(saved: Saved, settings: PredictorSettings) -> None:
        """Raise StateError if arrays do not have the sizes of the settings."""
        n = FeatureLayout(settings.p, settings.q).n
        saved.array("x_pb", settings.q), saved.array("e_pb", settings.p), saved.array("factor", n + 1, n + 1)

    def saved(self) -> SavedFields:
        """Return the complete state."""
        arrays = {"x_pb": self.past.x_pb, "e_pb": self.past.e_pb, "factor": self.regression.factor}
        return SavedFields({"n_samples": self.regression.n_samples}, arrays, {})

    def restore(self, saved: Saved) -> None:
        """Restore the state of :meth:`saved`; StateError if it is inconsistent: the model must not be used then."""
        n = self.layout.n
        with saved.consistent():
            self.regression.restore(saved.array("factor", n + 1, n + 1), saved.whole("n_samples"))
        self.past.x_pb[:] = saved.array("x_pb", self.layout.q)
        self.past.e_pb[:] = saved.array("e_pb", self.layout.p)

    def restore_learned(self, learned: Mapping[str, Array]) -> None:
        """Restore nothing: all is in the regression."""
