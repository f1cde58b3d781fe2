"""Linear hybrid model: prediction of a look-ahead window, and learning from its measurement; eqs. (2) to (6).

``x_h(k) = x_pb(k) + wᵀφ(k)`` with ``φ(k) = [1, x_pb(k) … x_pb(k−q), e_pb(k−1) … e_pb(k−p)]`` and
``e_pb = x − x_pb``. Within a window, residuals not measured yet are replaced by their predictions: a free run of
an ARX recursion from the last ``p`` measured residuals, affine in the command.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import ParameterError, SignalError
from ..base.settings import PredictorSettings, samples_before
from ..base.signals import Array, as_measured, as_samples
from ..base.threads import one_blas_thread
from ..model.physics import ModalModel
from .forecast import FeatureScales, Forecast
from .paper.model import PaperModel
from .regression import RidgeRegression
from .residual_model import ResidualModel, WindowInputs
from .start_in_motion import motion_before
from .trust.disturbances import Disturbance
from .trust.saved import SavedTrustedModel
from .uncertainty import Uncertainty, first_variance
from .window import PredictedWindow, Prediction, WindowOperator

__all__ = ["WindowPredictor"]


class WindowPredictor:
    """Prediction and learning; :class:`~hybridsep.predict.predictor.HybridPredictor` adds its saved state."""

    def __init__(
        self,
        model: ModalModel,
        settings: PredictorSettings | None = None,
        *,
        start: float | None = None,
        disturbances: Sequence[Disturbance] = (),
    ) -> None:
        self.settings = settings = PredictorSettings() if settings is None else settings
        self.Np, self.T_s = settings.Np, settings.T_s
        self.model = model
        self.discrete = model.discretise(self.T_s, settings.input_hold, block=self.Np)
        self.disturbances = tuple(disturbances)
        if self.disturbances and not settings.trust:
            raise ParameterError("disturbances are learned with trust = true only")
        for i, one in enumerate(self.disturbances):
            if not callable(one):
                raise ParameterError(f"disturbances[{i}] must be a function of x and v, got {one!r}")
        self.residual: ResidualModel[Any] = (
            SavedTrustedModel(settings, self.discrete, self.disturbances) if settings.trust else PaperModel(settings)
        )
        self.uncertainty = Uncertainty(first_variance(settings), settings.Np)
        self.restart(start, t_init=settings.warm_up)

    @property
    def n_features(self) -> int:
        """Number of features ``n``."""
        return self.regression.n_features

    @property
    def regression(self) -> RidgeRegression:
        """Regression of all learned samples, that of the residual model."""
        return self.residual.regression

    @property
    def residual_weights(self) -> Array:
        """Autoregressive weights of the learned recursion, ``(p,)``."""
        return self.residual.lag_weights

    @property
    def weights(self) -> Array:
        """``w`` of eq. (6) from all learned samples, ``(n,)``."""
        return self.regression.weights

    def restart(self, start: float | None = None, *, t_init: float = 0.0) -> None:
        """Begin another run, at rest at ``start``; what was learned is kept (warm start).

        Parameters
        ----------
        start : float, optional
            Initial position, m; the first command if left out.
        t_init : float
            Warm-up of the new run, s; none by default. −1: automatic.
        """
        rest = None if start is None else float(as_samples([start], "start")[0])
        self.n_init = samples_before(replace(self.settings, t_init=t_init).warm_up, self.T_s)
        self.start = rest
        self.k = 0
        self.state = self.discrete.rest()
        self.late = np.zeros(self.settings.measurement_delay)
        self.residual.restart()
        self.pending: PredictedWindow | None = None

    @one_blas_thread
    def predict(self, x_d: ArrayLike, *, scales: FeatureScales | None = None) -> Prediction:
        """Predict the next window from its commands and all earlier measurements; eqs. (2), (4).

        May be called again, with other commands or another length, before :meth:`update`; the last call counts.

        Parameters
        ----------
        x_d : (n,) array_like, m
            Commanded positions of the next ``n ≥ 1`` samples; usually ``n = Np``.
        scales : FeatureScales, optional
            With trust: scales of the features, in a compensator; those of ``x_d`` if left out.

        Returns
        -------
        Prediction

        Raises
        ------
        SignalError
            If ``x_d`` is empty, not one-dimensional or not finite.
        """
        command = as_samples(x_d, "x_d")
        n = len(command)
        if n == 0:
            raise SignalError("x_d must have at least one sample, got none")
        start = float(command[0]) if self.start is None else self.start
        delay = len(self.late)
        command = np.concatenate((self.late, command - start))
        x_pb, _ = self.discrete.forced_response(self.state, command)  # Eq. (2)
        forecast = self.residual.forecast(WindowInputs(command, x_pb, start), scales)
        self.pending = self.predicted(forecast, start)
        std = self.pending.error.std
        return Prediction(x_pb[delay:] + start, forecast.e_h[delay:], std[delay:], self._warm_up(n))

    def predicted(self, forecast: Forecast, start: float) -> PredictedWindow:
        """Return the window of a forecast with what is known of its error, pending measurement.

        With a ``measurement_delay`` the window begins so many samples earlier, with those not measured yet.
        """
        active = np.arange(len(forecast.x_d)) >= self._warm_up(len(forecast.x_d), late=len(self.late))
        error = self.uncertainty.predict(
            forecast.x_pb,
            np.where(active, forecast.e_h, 0.0),
            np.where(active, forecast.variance, 0.0),
        )
        return PredictedWindow(start, error, forecast)

    @one_blas_thread
    def update(self, x: ArrayLike, *, learn: bool = True) -> None:
        """Learn from the measurement of the predicted window, or of its first samples; eq. (6).

        Parameters
        ----------
        x : (m,) array_like, m
            Measured positions that arrived, ``1 ≤ m ≤ n`` of the last :meth:`predict`.
        learn : bool
            Whether the samples enter the regression; the next window starts from their residuals in any case.

        Raises
        ------
        SignalError
            If nothing was predicted, ``x`` is longer than the window, or a value is not finite. Nothing is changed.
        """
        pending = self.pending
        if pending is None:
            raise SignalError("update must follow predict: there is no predicted window to measure")
        measured = as_measured(x, "x") if self.residual.may_miss else as_samples(x, "x")
        if not 1 <= len(measured) <= self.n_pending:
            raise SignalError(f"x must have 1 … {self.n_pending} samples, as predicted, got {len(measured)}")
        m = len(measured)
        e_pb = measured - pending.start - pending.forecast.x_pb[:m]
        before = deepcopy((self.residual, self.state)) if self.disturbances else None
        try:
            if self.k == 0 and self.residual.may_begin_in_motion:
                pending, e_pb = self._as_it_began(pending, e_pb)
            accepted = self.residual.learn(pending.forecast, measured - pending.start, fold=learn)
        except BaseException:  # of a disturbance of the user's own, at a position that was not predicted
            if before is not None:
                self.residual, self.state = before
            raise
        if learn:
            self.uncertainty.learn(pending.error, e_pb, accepted)
        x_d = pending.forecast.x_d
        _, self.state = self.discrete.forced_response(self.state, x_d[:m])
        self.start, self.late = pending.start, x_d[m : m + len(self.late)].copy()
        self.k += m
        self.pending = None

    def _as_it_began(self, pending: PredictedWindow, e_pb: Array) -> tuple[PredictedWindow, Array]:
        """Correct the state at the beginning of a run, if its first residuals tell that it was in motion."""
        m, late = len(e_pb), len(self.late)
        forecast = pending.forecast
        before = motion_before(self.model, self.discrete, forecast.x_d, e_pb - pending.error.e_h[:m], late)
        if before is None:
            return pending, e_pb
        self.state = self.state + before.state
        moved = self.residual.begin_in_motion(forecast, forecast.x_d + before.x_d, forecast.x_pb + before.x_pb)
        return replace(pending, forecast=moved), e_pb - before.x_pb[:m]

    def operator(self, n: int | None = None) -> WindowOperator:
        """Return the lifted prediction of the next ``n`` (default ``Np``) samples, affine in their commands; eq. (3).

        It is the hybrid model, during the warm-up too.

        Raises
        ------
        ParameterError
            With trust: its model is not affine in the commands.
        SignalError
            If ``n < 1``, or the initial position is neither given nor known from a predicted window.
        """
        paper = self.residual
        if not isinstance(paper, PaperModel):
            raise ParameterError("the operator is that of the paper's model: it needs trust = false")
        length = self.Np if n is None else n
        if length < 1:
            raise SignalError(f"n must be ≥ 1, got {length}")
        start = self.start if self.start is not None or self.pending is None else self.pending.start
        if start is None:
            raise SignalError("the start is not known yet: give start= or predict the first window before")
        g_pb = self.discrete.impulse_response(length)
        g_h = paper.impulse_response(g_pb)
        delay = len(self.late)
        free_pb, _ = self.discrete.forced_response(self.state, np.concatenate((self.late, np.zeros(length))))
        free = (free_pb + paper.free_run(free_pb))[delay:]
        free_pb = free_pb[delay:]
        return WindowOperator(
            g_h=g_h,
            free=free + start * (1.0 - np.cumsum(g_h)),
            g_pb=g_pb,
            free_pb=free_pb + start * (1.0 - np.cumsum(g_pb)),
        )

    def physics_operator(self, n: int) -> tuple[Array, Array]:
        """Return the first column of ``G_pb``, m/m, and its free response, m, ``(n,)`` each; the start is known."""
        assert self.start is not None
        g_pb = self.discrete.impulse_response(n)
        free, _ = self.discrete.forced_response(self.state, np.concatenate((self.late, np.zeros(n))))
        return g_pb, free[len(self.late) :] + self.start * (1.0 - np.cumsum(g_pb))

    @property
    def n_pending(self) -> int:
        """Samples of the predicted window pending measurement; 0 if there is none."""
        return 0 if self.pending is None else len(self.pending.forecast.x_d) - len(self.late)

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible; 0 without trust."""
        return self.residual.n_rejected

    def last_accepted_residual(self) -> float:
        """Return the residual ``e_pb``, m, that the next window starts from: with trust the last one accepted."""
        return self.residual.last

    def _warm_up(self, n: int, *, late: int = 0) -> int:
        """Return how many of ``n`` samples, the next ones or from ``late`` samples before, are within the warm-up."""
        return min(max(self.n_init - self.k + late, 0), n)
