"""Linear hybrid model: prediction of a look-ahead window, and learning from its measurement; eqs. (2) to (6).

``x_h(k) = x_pb(k) + wᵀφ(k)`` with ``φ(k) = [1, x_pb(k) … x_pb(k−q), e_pb(k−1) … e_pb(k−p)]`` and
``e_pb = x − x_pb``. Within a window, residuals not measured yet are replaced by their predictions: a free run of
an ARX recursion from the last ``p`` measured residuals, affine in the command.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from ..base.errors import ParameterError, SignalError
from ..base.output import written_whole
from ..base.settings import PredictorSettings, samples_before
from ..base.signals import Array, as_measured, as_samples
from ..model.physics import ModalModel
from .disturbances import Disturbance
from .features import FeatureLayout, PastSamples
from .forecast import FeatureScales
from .reference_features import ReferenceFeatures
from .regression import RidgeRegression
from .saved_predictor import predictor_blob, predictor_from
from .start_in_motion import motion_before
from .trusted import TrustedModel
from .uncertainty import Uncertainty, first_variance
from .window import PredictedWindow, Prediction, WindowOperator

__all__ = ["HybridPredictor"]


class HybridPredictor:
    """Predictor of a drive's position by windows, learning from their measurement; eqs. (2) to (6).

    For each window, call :meth:`predict` with its commands, then :meth:`update` with the measured positions.
    :meth:`predict` does not change the weights. Memory and cost per window are constant. With a ``measurement_delay``
    what arrives over a window was measured so many samples earlier; what is not measured yet is predicted anew.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``, eq. (15).
    settings : PredictorSettings, optional
        The defaults if left out.
    start : float, optional
        Initial position, m, at rest; the first command if left out. Positions are relative to it internally, because
        ridge regression is not invariant to an offset.
    disturbances : sequence of Disturbance, optional
        With trust: more candidate disturbances, functions ``d(x, v)`` of positions, m, and commanded velocities, m/s,
        ``(n,)`` each, in any unit; what they are worth is learned. A compensator follows their slopes, taken over the
        motion of a sample. They are not part of a saved state, or of an FMU.

    Raises
    ------
    ParameterError
        If disturbances are given without trust, or are not functions.
    """

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
        self.reference_features = ReferenceFeatures(settings.v_friction, self.T_s)
        self.layout = FeatureLayout(settings.p, settings.q, self.reference_features.n)
        self.past = PastSamples(self.layout, self.Np)
        self.disturbances = tuple(disturbances)
        if self.disturbances and not settings.trust:
            raise ParameterError("disturbances are learned with trust = true only")
        for i, one in enumerate(self.disturbances):
            if not callable(one):
                raise ParameterError(f"disturbances[{i}] must be a function of x and v, got {one!r}")
        self.trusted = TrustedModel(settings, self.discrete, self.disturbances) if settings.trust else None
        self._regression = None if settings.trust else RidgeRegression(self.layout.n, settings.lam)
        self.uncertainty = Uncertainty(first_variance(settings), settings.Np)
        self.restart(start, t_init=settings.warm_up)

    @property
    def n_features(self) -> int:
        """Number of features ``n``."""
        return self.regression.n_features

    @property
    def regression(self) -> RidgeRegression:
        """Regression of all learned samples; with trust that of :class:`TrustedModel`."""
        regression = self._regression if self.trusted is None else self.trusted.regression
        assert regression is not None
        return regression

    @property
    def residual_weights(self) -> Array:
        """Autoregressive weights of the learned recursion, ``(p,)``."""
        lags = self.layout.e_pb if self.trusted is None else slice(self.trusted.static.n, None)
        return self.weights[lags]

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
        self.past.restart()
        if self.trusted is not None:
            self.trusted.restart()
        self.reference_features.restart()
        self.pending: PredictedWindow | None = None

    def predict(
        self, x_d: ArrayLike, *, reference: ArrayLike | None = None, scales: FeatureScales | None = None
    ) -> Prediction:
        """Predict the next window from its commands and all earlier measurements; eqs. (2), (4).

        May be called again, with other commands or another length, before :meth:`update`; the last call counts.

        Parameters
        ----------
        x_d : (n,) array_like, m
            Commanded positions of the next ``n ≥ 1`` samples; usually ``n = Np``.
        reference : (m,) array_like, m, optional
            Unmodified commanded positions, ``m ≥ n``, beyond the window as far as known; ``x_d`` if left out.
        scales : FeatureScales, optional
            With trust: scales of the features, in a compensator; those of ``x_d`` if left out.

        Returns
        -------
        Prediction

        Raises
        ------
        SignalError
            If ``x_d`` is empty, not one-dimensional or not finite, or ``reference`` is shorter.
        """
        command = as_samples(x_d, "x_d")
        n = len(command)
        if n == 0:
            raise SignalError("x_d must have at least one sample, got none")
        start = float(command[0]) if self.start is None else self.start
        path = command if reference is None else as_samples(reference, "reference")
        if len(path) < n:
            raise SignalError(f"reference must have at least the {n} samples of x_d, got {len(path)}")
        delay = len(self.late)
        command, path = np.concatenate((self.late, command - start)), np.concatenate((self.late + start, path))
        x_pb, _ = self.discrete.forced_response(self.state, command)  # Eq. (2)
        signs = self.reference_features.signs(path, start)
        e_h, self.pending = self.predicted(command, x_pb, start, path, signs, scales)
        std = self.pending.error.std
        return Prediction(x_pb[delay:] + start, e_h[delay:], std[delay:], self._warm_up(n))

    def predicted(
        self,
        x_d: Array,
        x_pb: Array,
        start: float,
        reference: Array,
        signs: Array,
        scales: FeatureScales | None = None,
    ) -> tuple[Array, PredictedWindow]:
        """Return the residual predicted over a window, ``(n,)``, m, and the window, pending measurement.

        With a ``measurement_delay`` the window begins so many samples earlier, with those not measured yet.
        """
        n, forecast = len(x_d), None
        if self.trusted is not None:
            self.trusted.static.origin = start
            forecast = self.trusted.forecast(x_d, x_pb, scales)
        features = self.reference_features.features(signs, n)
        e_h = self._free_run(x_pb, features) if forecast is None else forecast.e_h
        active = np.arange(n) >= self._warm_up(n, late=len(self.late))
        error = self.uncertainty.predict(
            x_d,
            x_pb,
            np.where(active, e_h, 0.0),
            last=self.last_accepted_residual(),
            disagreement=0.0 if forecast is None else np.where(active, forecast.disagreement, 0.0),
            doubted=None if self.trusted is None else self.trusted.guard.doubted(x_pb, self.trusted.scale.largest),
        )
        return e_h, PredictedWindow(x_d, x_pb, start, reference, signs, error, forecast)

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
        measured = as_samples(x, "x") if self.trusted is None else as_measured(x, "x")
        if not 1 <= len(measured) <= self.n_pending:
            raise SignalError(f"x must have 1 … {self.n_pending} samples, as predicted, got {len(measured)}")
        m = len(measured)
        accepted = np.ones(m, dtype=np.bool_)
        e_pb = measured - pending.start - pending.x_pb[:m]
        if self.trusted is not None and pending.forecast is not None:
            before = deepcopy((self.trusted, self.state)) if self.disturbances else None
            try:
                if self.k == 0 and not self.trusted.plans:
                    pending, e_pb = self._as_it_began(pending, e_pb)
                assert pending.forecast is not None
                accepted = self.trusted.learn(pending.forecast, measured - pending.start, fold=learn)
            except BaseException:  # of a disturbance of the user's own, at a position that was not predicted
                if before is not None:
                    self.trusted, self.state = before
                raise
        else:
            from_reference = self.reference_features.features(pending.signs, m)
            for i in range(0, m, self.Np):
                stop = min(i + self.Np, m)
                self._take_in(pending.x_pb[i:stop], e_pb[i:stop], from_reference[i:stop], learn)
        if learn:
            self.uncertainty.learn(pending.error, e_pb, accepted)
        self.reference_features.advance(pending.signs, pending.reference, m)
        _, self.state = self.discrete.forced_response(self.state, pending.x_d[:m])
        self.start, self.late = pending.start, pending.x_d[m : m + len(self.late)].copy()
        self.k += m
        self.pending = None

    def _as_it_began(self, pending: PredictedWindow, e_pb: Array) -> tuple[PredictedWindow, Array]:
        """Correct the state at the beginning of a run, if its first residuals tell that it was in motion."""
        m, late = len(e_pb), len(self.late)
        before = motion_before(self.model, self.discrete, pending.x_d, e_pb - pending.error.e_h[:m], late)
        if before is None or self.trusted is None or pending.forecast is None:
            return pending, e_pb
        self.state = self.state + before.state
        x_d, x_pb = pending.x_d + before.x_d, pending.x_pb + before.x_pb
        self.trusted.begin_in_motion(x_d, x_pb)
        forecast = replace(pending.forecast, x_d=x_d, x_pb=x_pb)
        return replace(pending, x_d=x_d, x_pb=x_pb, forecast=forecast), e_pb - before.x_pb[:m]

    def operator(self, n: int | None = None, *, reference: ArrayLike | None = None) -> WindowOperator:
        """Return the lifted prediction of the next ``n`` (default ``Np``) samples, affine in their commands; eq. (3).

        It is the hybrid model, during the warm-up too. ``reference``, ``(n,)``, m, is the unmodified command, for the
        features of the reference; at rest if left out.

        Raises
        ------
        ParameterError
            With trust: its model is not affine in the commands.
        SignalError
            If ``n < 1``, or the initial position is neither given nor known from a predicted window.
        """
        if self.trusted is not None:
            raise ParameterError("the operator is that of the paper's model: it needs trust = false")
        length = self.Np if n is None else n
        if length < 1:
            raise SignalError(f"n must be ≥ 1, got {length}")
        start = self.start if self.start is not None or self.pending is None else self.pending.start
        if start is None:
            raise SignalError("the start is not known yet: give start= or predict the first window before")
        w_x, w_e = self.weights[self.layout.x_pb], self.residual_weights
        g_pb = self.discrete.impulse_response(length)
        # x_h = x_pb + wᵀφ as filters: G_h = (1 + W_x(z) / (1 − W_e(z))) G_pb
        denominator = np.concatenate(([1.0], -w_e))
        g_h = g_pb + lfilter(w_x, denominator, g_pb)
        delay = len(self.late)
        free_pb, _ = self.discrete.forced_response(self.state, np.concatenate((self.late, np.zeros(length))))
        path = np.full(length, start) if reference is None else as_samples(reference, "reference", length)
        signs = self.reference_features.signs(np.concatenate((self.late + start, path)), start)
        free = (free_pb + self._free_run(free_pb, self.reference_features.features(signs, delay + length)))[delay:]
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
        return 0 if self.pending is None else len(self.pending.x_d) - len(self.late)

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible; 0 without trust."""
        return 0 if self.trusted is None else self.trusted.n_rejected

    def last_accepted_residual(self) -> float:
        """Return the residual ``e_pb``, m, that the next window starts from: with trust the last one accepted."""
        return float(self.past.e_pb[-1] if self.trusted is None else self.trusted.past[0])

    def to_bytes(self) -> bytes:
        """Return parameters and state, a pending window included, as a versioned blob."""
        return predictor_blob(self)

    @classmethod
    def from_bytes(cls, blob: bytes, disturbances: Sequence[Disturbance] = ()) -> HybridPredictor:
        """Return the predictor of :meth:`to_bytes`, given the ``disturbances`` that it was learned with.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version, or the number of disturbances differs.
        """
        return predictor_from(cls, blob, disturbances)

    def __reduce__(self) -> tuple[Any, ...]:
        # By the saved state: the lags are views, which a plain copy would detach.
        return HybridPredictor.from_bytes, (self.to_bytes(), self.disturbances)

    def save(self, path: str | Path) -> None:
        """Write :meth:`to_bytes` to a file."""
        blob = self.to_bytes()
        with written_whole(path) as file:
            file.write(blob)

    @classmethod
    def load(cls, path: str | Path, disturbances: Sequence[Disturbance] = ()) -> HybridPredictor:
        """Return the predictor of :meth:`save`; :meth:`restart` then begins a warm-started run.

        Raises
        ------
        StateError
            If the file is not a saved predictor, or was learned with another number of disturbances.
        """
        return cls.from_bytes(Path(path).read_bytes(), disturbances)

    def _warm_up(self, n: int, *, late: int = 0) -> int:
        """Return how many of ``n`` samples, the next ones or from ``late`` samples before, are within the warm-up."""
        return min(max(self.n_init - self.k + late, 0), n)

    def _free_run(self, x_pb: Array, reference: Array) -> Array:
        """Return ``wᵀφ`` over a window in free run, ``(n,)``; eq. (4)."""
        w, layout, past = self.weights, self.layout, self.past
        # Exogenous part: w₀ + Σ_i w_x,i x_pb(k−i), and the features of the reference
        drive = w[layout.bias] + np.convolve(np.concatenate((past.x_pb, x_pb)), w[layout.x_pb], "valid")
        if layout.n_reference:
            drive += reference @ w[layout.reference]
        # e(k) = drive(k) + Σ_i w_e,i e(k−i), an all-pole filter started from the measured residuals:
        # its state is z_j = Σ_m w_e,j+m e(−m)
        w_e = w[layout.e_pb]
        state = np.correlate(w_e, past.e_pb[::-1], "full")[layout.p - 1 :]
        e_h, _ = lfilter([1.0], np.concatenate(([1.0], -w_e)), drive, zi=state)
        return np.asarray(e_h)

    def _take_in(self, x_pb: Array, e_pb: Array, reference: Array, learn: bool) -> None:
        """Shift by at most ``Np`` measured samples, learning them if ``learn``."""
        m = len(e_pb)
        self.past.append(x_pb, e_pb)
        if learn:
            self._learn(self.past.rows(m, reference))
        self.past.advance(m)

    def _learn(self, rows: Array) -> None:
        """Update the regression with rows ``[φ(k) | e_pb(k)]``; the place for a guard that weighs or drops rows."""
        self.regression.update_stacked(rows)
