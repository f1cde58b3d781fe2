"""The linear hybrid model: predict a look-ahead window, then learn it; eqs. (2) to (6).

``x_h(k) = x_pb(k) + wᵀφ(k)`` with ``φ(k) = [1, x_pb(k) … x_pb(k−q), e_pb(k−1) … e_pb(k−p)]`` and
``e_pb = x − x_pb``. Inside a window the residuals that are not measured yet are their own predictions, so a window
is one free run of an ARX recursion from the last ``p`` measured residuals, and stays affine in the command.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from ..base.errors import SignalError
from ..base.output import written_whole
from ..base.settings import PredictorSettings, check, samples_before
from ..base.signals import Array, as_samples
from ..model.physics import ModalModel
from .features import FeatureLayout, PastSamples
from .reference_features import ReferenceFeatures
from .regression import RidgeRegression
from .saved_predictor import predictor_blob, predictor_from
from .window import PredictedWindow, Prediction, WindowOperator

__all__ = ["HybridPredictor"]


class HybridPredictor:
    """Predicts windows of a drive's position and learns from their measurement; eqs. (2) to (6).

    Call :meth:`predict` with the commands of the next window, then :meth:`update` with what was measured over it,
    window after window. Predicting changes nothing that is learned. Memory and cost per window are constant.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``, eq. (15).
    settings : PredictorSettings, optional
        The defaults if left out.
    start : float, optional
        Position, m, where the drive is at rest before the first sample; the first command if left out. All positions
        are relative to it inside, because ridge regression is not invariant to an offset.
    """

    def __init__(
        self, model: ModalModel, settings: PredictorSettings | None = None, *, start: float | None = None
    ) -> None:
        self.settings = settings = PredictorSettings() if settings is None else settings
        self.Np, self.T_s = settings.Np, settings.T_s
        self.model = model
        self.discrete = model.discretise(self.T_s, settings.input_hold, block=self.Np)
        self.reference_features = ReferenceFeatures(settings.v_friction, self.T_s)
        self.layout = FeatureLayout(settings.p, settings.q, self.reference_features.n)
        self.past = PastSamples(self.layout, self.Np)
        self.regression = RidgeRegression(self.layout.n, settings.lam)
        self.restart(start, t_init=settings.t_init)

    @property
    def n_features(self) -> int:
        """``n``, of all groups of features."""
        return self.layout.n

    @property
    def residual_weights(self) -> Array:
        """Weights of the past residuals, ``(p,)``: those of the learned recursion."""
        return self.weights[self.layout.e_pb]

    @property
    def weights(self) -> Array:
        """``w`` of eq. (6) from all measured windows, ``(n,)``."""
        return self.regression.weights

    def restart(self, start: float | None = None, *, t_init: float = 0.0) -> None:
        """Begin another run, at rest at ``start``, with what is learned kept (a warm start).

        Parameters
        ----------
        start : float, optional
            Where the drive rests, m; the first command if left out.
        t_init : float
            Warm-up of the new run, s; none unless asked for.
        """
        rest = None if start is None else float(as_samples([start], "start")[0])
        self.n_init = samples_before(check("t_init", t_init), self.T_s)
        self.start = rest
        self.k = 0
        self.state = self.discrete.rest()
        self.past.restart()
        self.reference_features.restart()
        self.waiting: PredictedWindow | None = None

    def predict(self, x_d: ArrayLike, *, reference: ArrayLike | None = None) -> Prediction:
        """Predict the next window from its commands and all that was measured before; eqs. (2), (4).

        May be called again, with other commands or another length, before :meth:`update`; the last call counts.

        Parameters
        ----------
        x_d : (n,) array_like, m
            Commanded positions of the next ``n ≥ 1`` samples; usually ``n = Np``.
        reference : (m,) array_like, m, optional
            Commanded positions before a compensator modified them, ``m ≥ n``: of what follows the window too, as far
            as it is known. ``x_d`` if left out.

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
        command = command - start
        x_pb, _ = self.discrete.forced_response(self.state, command)  # Eq. (2)
        path = command + start if reference is None else as_samples(reference, "reference")
        if len(path) < n:
            raise SignalError(f"reference must have at least the {n} samples of x_d, got {len(path)}")
        signs = self.reference_features.signs(path, start)
        self.waiting = PredictedWindow(command, x_pb, start, path, signs)
        e_h = self._free_run(x_pb, self.reference_features.features(signs, n))
        return Prediction(x_pb + start, e_h, min(max(self.n_init - self.k, 0), n))

    def update(self, x: ArrayLike, *, learn: bool = True) -> None:
        """Learn from the measurement of the predicted window, or of its beginning; eq. (6).

        Parameters
        ----------
        x : (m,) array_like, m
            Measured positions, ``1 ≤ m ≤ n`` of the last :meth:`predict`.
        learn : bool
            Whether the samples enter the regression; the next window starts from their residuals in any case.

        Raises
        ------
        SignalError
            If nothing was predicted, ``x`` is longer than the window, or a value is not finite. Nothing is changed.
        """
        waiting = self.waiting
        if waiting is None:
            raise SignalError("update must follow predict: there is no predicted window to measure")
        measured = as_samples(x, "x")
        if not 1 <= len(measured) <= len(waiting.x_d):
            raise SignalError(f"x must have 1 … {len(waiting.x_d)} samples, as predicted, got {len(measured)}")
        m = len(measured)
        e_pb = measured - waiting.start - waiting.x_pb[:m]
        from_reference = self.reference_features.features(waiting.signs, m)
        for i in range(0, m, self.Np):
            stop = min(i + self.Np, m)
            self._take_in(waiting.x_pb[i:stop], e_pb[i:stop], from_reference[i:stop], learn)
        self.reference_features.advance(waiting.signs, waiting.reference, m)
        _, self.state = self.discrete.forced_response(self.state, waiting.x_d[:m])
        self.start = waiting.start
        self.k += m
        self.waiting = None

    def operator(self, n: int | None = None, *, reference: ArrayLike | None = None) -> WindowOperator:
        """Return the model of the next ``n`` samples (``Np`` if left out) as an affine map of their commands; eq. (3).

        It is the hybrid model whether or not the warm-up is over. ``reference``, ``(n,)``, m, is the path that the
        features of the reference follow from; a path at rest if left out.

        Raises
        ------
        SignalError
            If ``n < 1``, or the start is not known yet: it is given, or follows from the first predicted window.
        """
        length = self.Np if n is None else n
        if length < 1:
            raise SignalError(f"n must be ≥ 1, got {length}")
        start = self.start if self.start is not None or self.waiting is None else self.waiting.start
        if start is None:
            raise SignalError("the start is not known yet: give start= or predict the first window before")
        w_x, w_e = self.weights[self.layout.x_pb], self.residual_weights
        g_pb = self.discrete.impulse_response(length)
        # x_h = x_pb + wᵀφ as filters: G_h = (1 + W_x(z) / (1 − W_e(z))) G_pb
        denominator = np.concatenate(([1.0], -w_e))
        g_h = g_pb + lfilter(w_x, denominator, g_pb)
        free_pb, _ = self.discrete.forced_response(self.state, np.zeros(length))
        path = np.full(length, start) if reference is None else as_samples(reference, "reference", length)
        from_reference = self.reference_features.features(self.reference_features.signs(path, start), length)
        free = free_pb + self._free_run(free_pb, from_reference)
        return WindowOperator(
            g_h=g_h,
            free=free + start * (1.0 - np.cumsum(g_h)),
            g_pb=g_pb,
            free_pb=free_pb + start * (1.0 - np.cumsum(g_pb)),
        )

    @property
    def n_pending(self) -> int:
        """Samples of the predicted window that waits for its measurement; 0 if there is none."""
        return 0 if self.waiting is None else len(self.waiting.x_d)

    def last_residual(self) -> float:
        """Return the last measured residual ``e_pb``, m; what the hold baseline keeps over a window."""
        return float(self.past.e_pb[-1])

    def to_bytes(self) -> bytes:
        """Return parameters and state, a window that waits for its measurement too, as a versioned blob."""
        return predictor_blob(self)

    @classmethod
    def from_bytes(cls, blob: bytes) -> HybridPredictor:
        """Return the predictor that :meth:`to_bytes` described.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version.
        """
        return predictor_from(cls, blob)

    def __reduce__(self) -> tuple[Any, ...]:
        # Copies and pickles go through the saved state: the lags are views, which a plain copy would cut off.
        return HybridPredictor.from_bytes, (self.to_bytes(),)

    def save(self, path: str | Path) -> None:
        """Write :meth:`to_bytes` to a file."""
        blob = self.to_bytes()
        with written_whole(path) as file:
            file.write(blob)

    @classmethod
    def load(cls, path: str | Path) -> HybridPredictor:
        """Read what :meth:`save` wrote; call :meth:`restart` on it to start a second run warm.

        Raises
        ------
        StateError
            If the file is not a saved predictor.
        """
        return cls.from_bytes(Path(path).read_bytes())

    def _free_run(self, x_pb: Array, reference: Array) -> Array:
        """Return ``wᵀφ`` over a window whose residuals are predicted as it goes, ``(n,)``; eq. (4)."""
        w, layout, past = self.weights, self.layout, self.past
        # What the command drives: w₀ + Σ_i w_x,i x_pb(k−i)
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
        """Make one stretch of at most ``Np`` measured samples the past, and learn it if it is to be learned."""
        m = len(e_pb)
        self.past.append(x_pb, e_pb)
        if learn:
            self._learn(self.past.rows(m, reference))
        self.past.advance(m)

    def _learn(self, rows: Array) -> None:
        """Fold rows ``[φ(k) | e_pb(k)]`` into the regression; where a guard may weigh, drop or replace them."""
        self.regression.update_stacked(rows)
