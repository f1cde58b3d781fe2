"""Residual model that can be trusted: features with priors, candidates shrunk by their variance, and their blend.

Where the paper's regression has one bare penalty λ on every weight, here each weight has a prior from the effect that
its feature may have, and λ is the variance of the noise, estimated from the residuals. Nothing has a scale of its own:
results for positions in another unit are the same in that unit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...base.saved import Saved
from ...base.settings import PredictorSettings
from ...base.signals import Array
from ...model.discrete import DiscreteModel
from ..forecast import FeatureScales
from ..regression import RidgeRegression
from ..residual_model import ResidualModel, SavedFields, WindowInputs
from .blend import Blend
from .candidates import Candidate, CandidatePrediction, ResidualScale, SolvedCandidate, lags
from .change import DOUBTED, ChangeTest
from .disturbances import LEAST_VELOCITY, Disturbance, StaticFeatures, StaticState
from .forecast import TrustedForecast
from .guard import SensorGuard
from .learned import is_sound, learned_numbers, restore_learned
from .rest import RestBefore
from .saved import check_sizes, forecast_fields, restore_trusted, saved_scales, trusted_fields

__all__ = ["TrustedModel"]

_LAST_LAG = 0.005
"""Prior variance of the weight of a lag relative to that of the lag ``p`` before it."""

_CAUTIOUS = 100.0
"""Correlation beyond which the penalty of a cautious candidate does not grow: it would learn nothing at all."""

_FIRST_WEIGHTS, _LATER_WEIGHTS = (0.0, 0.5, 0.5, 0.0), (0.0, 0.0, 0.5, 0.5)
"""Of the blend without evidence: hold, without lags, with lags, with lags and rows taken as independent. The last one
learns fastest where G_pb is wrong, but errs by far in the beginning."""

_BOUND = 1.2
"""Largest prediction relative to the largest residual so far."""

_RECENT = 0.9
"""Factor by which the mean square of the residual fades from window to window."""

_GROWTH, _GROWTH_LEARNED, _MOTION_LEARNED = 30.0, 1000.0, 15.0
"""Growth of the commanded velocity by which what was learned at lower ones is forgotten: the first one, as that was a
creep, and the second one when rows of so many windows are learned."""

_LEAST_NOISE = 1e-4
"""Bound on λ relative to the largest mean square of the residual: a larger λ would prevent any learning."""

_CARRIED = 30.0
"""Largest weight of earlier runs when another begins, in windows: a machine may have changed meanwhile."""

_SURPRISE, _SURPRISED = 10.0, 0.1
"""Mean square error of a window, relative to the expected one, above which the machine has changed; and what then
remains at least of the weight of all samples before, in windows."""

_BRIDGED = 3
"""Lags of a row that may stand for samples without a measurement."""

_NO_PENALTY = 1e-40
"""λ of the factor itself, m²: penalties come with each solution."""


class TrustedModel(ResidualModel[TrustedForecast]):
    """Model of the residual ``e_pb``, learned online; it stays the physics model where it does not know better.

    Parameters
    ----------
    settings : PredictorSettings
        ``p`` and ``q`` are the largest lags, ``lam`` the least variance of the noise.
    discrete : DiscreteModel
        ``G_pb``.
    """

    may_miss: ClassVar[bool] = True

    def __init__(self, settings: PredictorSettings, discrete: DiscreteModel, own: Sequence[Disturbance] = ()) -> None:
        self.settings, self.preview = settings, settings.Np
        self.static = StaticFeatures(discrete, settings.q, settings.period, own)
        p = settings.p
        self.regression = RidgeRegression(self.static.n + p, _NO_PENALTY)
        lag_scales = np.sqrt(_LAST_LAG ** (np.arange(p) / p))
        self.candidates = (
            Candidate(self.static.n, lag_scales[:0], _CAUTIOUS, settings.Np),
            Candidate(self.static.n, lag_scales, _CAUTIOUS, settings.Np),
            Candidate(self.static.n, lag_scales, 1.0, settings.Np),
        )
        self.blend = Blend(_FIRST_WEIGHTS, _LATER_WEIGHTS, settings.Np)
        self.n_rows = 0.0
        self.largest = np.zeros(self.static.n)
        self.velocity_scale = 0.0
        self.scale = ResidualScale()
        self.guard = SensorGuard(2 * settings.Np)
        self.restart()

    def restart(self) -> None:
        """Begin another run, at rest; what was learned is kept."""
        self.state: StaticState = self.static.rest()
        self.past = np.zeros(self.settings.p)
        self.past_bridged: NDArray[np.bool_] = np.zeros(self.settings.p, dtype=np.bool_)
        self.guard.restart()
        self.n_rejected = 0
        self.rest = RestBefore(self.settings.measurement_delay)
        carried = _CARRIED * self.settings.Np
        self.change: ChangeTest | None = None
        self._discount(carried / max(self.n_rows, carried))
        if self.n_rows > 0.0:
            correlations = tuple(candidate.correlation for candidate in self.candidates)
            self.change = ChangeTest(self.regression, self.n_rows, correlations)

    def begin_in_motion(self, forecast: TrustedForecast, x_d: Array, x_pb: Array) -> TrustedForecast:
        """Correct what was before a run in motion: commands and physics-based prediction went on as they begin."""
        before = np.arange(-len(self.state.x_pb), 0)
        self.state = self.state._replace(x_d=float(2.0 * x_d[0] - x_d[1]), x_pb=x_pb[0] + (x_pb[1] - x_pb[0]) * before)
        return super().begin_in_motion(forecast, x_d, x_pb)

    @property
    def lag_weights(self) -> Array:
        """Weights of the lags from all learned samples, ``(p,)``."""
        return self.regression.weights[self.static.n :]

    @property
    def last(self) -> float:
        """Last residual that was accepted or bridged, m."""
        return float(self.past[0])

    @property
    def may_begin_in_motion(self) -> bool:
        """Whether a run may begin in motion: not under a compensator, which begins at rest."""
        return not self.plans

    @property
    def plans(self) -> bool:
        """Whether a compensator plans with it."""
        return self.preview > self.settings.Np

    def plan_ahead(self, preview: int) -> None:
        """Adapt to a compensator, which plans over a preview, in samples, and moves the drive as it commands."""
        self.preview = preview
        self.static.damping_of_motion = self.plans

    def forecast(self, window: WindowInputs, scales: FeatureScales | None = None) -> TrustedForecast:
        """Predict the residual over the next window; nothing that is learned is changed.

        Parameters
        ----------
        window : WindowInputs
        scales : FeatureScales, optional
            Those of :meth:`scales` for its commands if left out; a compensator's follow from its preview.
        """
        self.static.origin = window.start
        scales = self.scales(window.x_d, window.x_pb) if scales is None else scales
        return self.forecast_by(self.solved(scales), window.x_d, window.x_pb, scales)

    def forecast_by(
        self,
        solved: tuple[SolvedCandidate, ...],
        x_d: Array,
        x_pb: Array,
        scales: FeatureScales,
        held: tuple[CandidatePrediction, ...] = (),
    ) -> TrustedForecast:
        """Predict as :meth:`forecast` by the candidates of :meth:`solved`, with the variances ``held`` if there are."""
        predictions: tuple[CandidatePrediction, ...] = ()
        before: Sequence[CandidatePrediction | None] = held or [None] * len(solved)
        x = x_pb
        if solved:
            rows = self._rows(x_d, x_pb, x_pb, scales)
            # The stiffness acts at the position, which the physics model alone does not give well enough.
            x = x_pb + self.predict(solved[0], rows, before[0]).e_h
            rows = self._rows(x_d, x_pb, x, scales)
            predictions = tuple(
                self.predict(candidate, rows, one) for candidate, one in zip(solved, before, strict=True)
            )
        hold = self.hold
        candidates = self._blended(hold, predictions, len(x_d))
        e_h = self.blend.weights @ candidates
        disagreement = np.maximum(self.blend.weights @ candidates**2 - e_h**2, 0.0)
        return TrustedForecast(x_d, x_pb, e_h, disagreement, x, hold, predictions, scales)

    def _rows(self, x_d: Array, x_pb: Array, x: Array, scales: FeatureScales) -> Array:
        """Return the static features to predict with, ``(n, n_static)``; ``x``: position that the stiffness acts at.

        The constant that earlier runs have taught is that of motion: before the first one of this run it is 0.
        """
        rows, _ = self.static.rows(self.state, x_d, x_pb, x, scales.velocity)
        if self.change is not None:
            rows[: scales.n_rest, 0] = 0.0
        return rows

    def scales(self, x_d: Array, x_pb: Array, path: Array | None = None) -> FeatureScales:
        """Return the scales of the features, those of the next window included.

        Parameters
        ----------
        x_d, x_pb : (n,) array, m
            Commands and physics-based prediction of the next window, relative to the start.
        path : (m,) array, m, optional
            Commanded positions as far as they are known: a compensator begins to move before them, with a creep.
        """
        peak = self.static.peak_velocity(self.state, x_d)
        growth = _GROWTH_LEARNED if self.n_rows >= _MOTION_LEARNED * self.settings.Np else _GROWTH
        outgrown = peak > max(growth * self.velocity_scale, LEAST_VELOCITY)
        if path is not None and self.n_rows == 0.0:
            peak = max(float(np.abs(np.diff(path)).max(initial=0.0)) / self.settings.T_s, self.velocity_scale)
            outgrown = peak > max(self.velocity_scale, LEAST_VELOCITY)
        velocity_scale = peak if outgrown else self.velocity_scale
        rows, _ = self.static.rows(self.state, x_d, x_pb, x_pb, velocity_scale)
        before = np.zeros(self.static.n) if outgrown else self.largest
        n_rest = self.rest.ahead(x_d if path is None else path, len(x_d))
        return FeatureScales(velocity_scale, np.maximum(before, np.abs(rows).max(axis=0)), n_rest)

    def has_learned(self, velocity_scale: float) -> bool:
        """Return whether there is something to predict with at a velocity scale of :meth:`scales`, m/s."""
        return self.n_rows > 0.0 and velocity_scale == self.velocity_scale and self.scale.largest_square > 0.0

    def solved(self, scales: FeatureScales) -> tuple[SolvedCandidate, ...]:
        """Return the candidates with their weights; none if there is nothing to predict with."""
        if not self.has_learned(scales.velocity):
            return ()
        return tuple(self.solve(candidate, scales.largest) for candidate in self.candidates)

    @property
    def hold(self) -> float:
        """Last residual, m, bounded: one that was not learned may be larger."""
        return min(max(float(self.past[0]), -self.bound), self.bound)

    def learn(self, forecast: TrustedForecast, x: Array, *, fold: bool = True) -> NDArray[np.bool_]:
        """Learn from the measurement of a window; return which samples are accepted, ``(m,)`` bool.

        Parameters
        ----------
        forecast : Forecast
            The last one.
        x : (m,) array, m
            Measured positions of its first ``m`` samples, relative to the start; NaN where missing.
        fold : bool
            Whether they are learned; the next window starts from them in any case.
        """
        m, p = len(x), self.settings.p
        if forecast.scales.velocity != self.velocity_scale:  # outgrown
            self.regression = RidgeRegression(self.regression.n_features, _NO_PENALTY)
            self.n_rows = 0.0
            self.change = None
        self.velocity_scale, self.largest, n_rest = forecast.scales
        x_d, x_pb = forecast.x_d[:m], forecast.x_pb[:m]
        doubtful = self._with_less_of_earlier_runs(forecast)
        accepted = self.guard.accepts(x, x_pb, self.scale.largest)
        e = _bridged(float(self.past[0]), x - x_pb, accepted)
        rows, self.state = self.static.rows(self.state, x_d, x_pb, x_pb + e, self.velocity_scale)
        bridged: NDArray[np.bool_] = np.concatenate((self.past_bridged, ~accepted))
        if fold and accepted.any():
            n_bridged = np.convolve(bridged[:-1].astype(np.float64), np.ones(p), "valid")
            self._fold(rows, e, accepted & (n_bridged <= _BRIDGED))
            changed = bool(forecast.predictions) and self._has_changed()
            doubted = self._is_doubted(forecast, doubtful, e, accepted)
            self._assess(forecast, e, accepted, surprises=not (changed or doubted))
            self._conclude(changed, doubted)
        self.rest.pass_by(m, n_rest)
        self.n_rejected += m - int(accepted.sum())
        self.past = np.concatenate((e[::-1], self.past))[:p]
        self.past_bridged = bridged[-p:]
        return accepted

    def doubted(self, x_pb: Array) -> Array | None:
        """Return the residual if the rejected measurement before the window is true, ``(n,)``, m; None if none was."""
        return self.guard.doubted(x_pb, self.scale.largest)

    @staticmethod
    def check_sizes(saved: Saved, settings: PredictorSettings) -> None:
        """Raise StateError if arrays do not have the sizes of the settings."""
        check_sizes(saved, settings)

    def saved(self) -> SavedFields:
        """Return the complete state."""
        return trusted_fields(self)

    def restore(self, saved: Saved) -> None:
        """Restore the state of :meth:`saved`; StateError if it is inconsistent: the model must not be used then."""
        restore_trusted(self, saved)

    def saved_forecast(self, forecast: TrustedForecast) -> SavedFields:
        """Return the scales of a forecast, which a compensator has from its preview."""
        return forecast_fields(forecast.scales)

    def restored_forecast(self, saved: Saved, window: WindowInputs) -> TrustedForecast:
        """Return the forecast of :meth:`saved_forecast`; StateError if it is inconsistent."""
        forecast = self.forecast(window, saved_scales(saved, self.static.n))
        if not np.isfinite(forecast.e_h).all():
            raise saved.error("the prediction of the pending window must be finite")
        return forecast

    def learned(self) -> dict[str, Array]:
        """Return what has been learned besides the regression, in the order of a weights file."""
        return learned_numbers(self)

    def is_sound(self, learned: Mapping[str, Array]) -> bool:
        """Return whether the numbers of :meth:`learned` are finite and in range."""
        return is_sound(self, learned)

    def restore_learned(self, learned: Mapping[str, Array]) -> None:
        """Restore the numbers of :meth:`learned`, which are sound."""
        restore_learned(self, learned)

    def _with_less_of_earlier_runs(self, forecast: TrustedForecast) -> Array | None:
        """Return the prediction with lags if earlier runs had less weight, ``(n,)``, m; None if there is no other."""
        change = self.change
        if change is None or change.n_after == 0.0 or not forecast.predictions:
            return None
        rows = self._rows(forecast.x_d, forecast.x_pb, forecast.x, forecast.scales)
        scales = self._static_scales(forecast.scales.largest)
        solved = self.candidates[1].solve(change.all_rows(DOUBTED), scales, self._least_variance)
        return self.predict(solved, rows).e_h

    def _is_doubted(
        self, forecast: TrustedForecast, doubtful: Array | None, measured: Array, accepted: NDArray[np.bool_]
    ) -> bool:
        """Return whether earlier runs had better have less weight, as in the prediction ``doubtful``."""
        m = len(measured)
        if self.change is None or doubtful is None or forecast.scales.n_rest >= m:
            return False
        predictions = (forecast.predictions[1].e_h[:m], doubtful[:m], np.zeros(m))
        return self.change.is_doubted(*(float(np.sum((measured - e)[accepted] ** 2)) for e in predictions))

    def _has_changed(self) -> bool:
        """Return whether the plant of this run is another one than that of earlier runs."""
        if self.change is None:
            return False
        correlation = min(self.change.correlations[0], self.candidates[0].correlation_max)
        variance = max(self.candidates[0].noise_variance, self._least_variance)
        return self.change.has_changed(
            self.regression, self._static_scales(self.largest), variance, self._least_variance, correlation
        )

    def _conclude(self, changed: bool, doubted: bool) -> None:
        """Forget what earlier runs have taught if the plant has changed, and end the comparison once it is decided."""
        change = self.change
        if change is not None and doubted and not changed:
            change.doubt()
            self.regression, self.n_rows = change.all_rows(), change.n_before + change.n_after
        if change is not None and changed:
            self.regression, self.n_rows = change.after, change.n_after
            recent = min(self.scale.recent, change.largest_square)
            self.scale = ResidualScale(recent, change.largest_square, change.largest)
            self.blend = Blend(_FIRST_WEIGHTS, _LATER_WEIGHTS, self.settings.Np)
            for candidate, correlation in zip(self.candidates, change.correlations, strict=True):
                candidate.correlation = correlation
        if change is not None and (changed or change.is_over):
            self.change = None

    def _assess(
        self, forecast: TrustedForecast, measured: Array, accepted: NDArray[np.bool_], *, surprises: bool
    ) -> None:
        """Judge the candidates and their blend by the measurement of their window, which may surprise."""
        m = len(measured)
        self._judge(forecast, measured, accepted, surprises)
        sound = measured[accepted]
        if self.change is not None:
            self.change.follow(sound)
        largest, mean_square = float(np.abs(sound).max()), float(np.mean(sound**2))
        recent = _RECENT * self.scale.recent + (1.0 - _RECENT) * mean_square if self.scale.recent else mean_square
        self.scale = ResidualScale(
            recent, max(self.scale.largest_square, mean_square), max(self.scale.largest, largest)
        )
        candidates = self._blended(forecast.hold, forecast.predictions, m)
        scale, change = self.scale.largest_square, self.change
        if change is not None and change.n_after > change.n_before:
            scale = change.largest_square  # what was larger in earlier runs says nothing of the blend any more
        self.blend.update(candidates[:, accepted], sound, scale, self.n_rows)

    @property
    def bound(self) -> float:
        """Bound on what is predicted, m."""
        return _BOUND * self.scale.largest

    def solve(self, candidate: Candidate, largest: Array) -> SolvedCandidate:
        """Return a candidate with the weights that follow from all rows so far.

        Parameters
        ----------
        candidate : Candidate
        largest : (n_static,) array
            Largest magnitudes of the static features, those of the window to predict included.
        """
        return candidate.solve(self.regression, self._static_scales(largest), self._least_variance)

    @property
    def _least_variance(self) -> float:
        """Least variance of the noise, m²."""
        return min(self.settings.lam, _LEAST_NOISE * self.scale.largest_square)

    def _static_scales(self, largest: Array) -> Array:
        """Return the prior standard deviations of the weights of the static features, ``(n_static,)``."""
        effect = self.settings.effect or math.sqrt(self.scale.largest_square)
        return effect * self.static.shares / np.maximum(largest, 1e-150)

    def predict(
        self, solved: SolvedCandidate, rows: Array, held: CandidatePrediction | None = None
    ) -> CandidatePrediction:
        """Return the prediction of a candidate over a window, bounded by the residuals so far."""
        found = solved.predict(rows, self.past[: len(solved.lag_weights)], self.scale, held)
        return found._replace(
            e_h=np.clip(found.e_h, -self.bound, self.bound), noise_variance=found.noise_variance / self.n_rows
        )

    @staticmethod
    def _blended(hold: float, predictions: tuple[CandidatePrediction, ...], m: int) -> Array:
        """Return the predictions that are blended, ``(4, m)``, m: hold, and the learned candidates, 0 at first."""
        learned = [prediction.e_h[:m] for prediction in predictions] or [np.zeros(m)] * (len(_FIRST_WEIGHTS) - 1)
        return np.stack((np.full(m, hold), *learned))

    def _judge(self, forecast: TrustedForecast, measured: Array, accepted: NDArray[np.bool_], surprises: bool) -> None:
        """Estimate the errors of the candidates from the measurement of their window."""
        m, given = len(measured), self.settings.noise_std**2
        if not forecast.predictions:
            # Third differences leave white noise, 20 times its variance, and little else.
            first = float(np.mean(np.diff(measured, 3) ** 2)) / 20.0 if m > 10 else float(np.mean(measured**2))
            for candidate in self.candidates:
                candidate.noise_variance = given or first
            return
        cautious = forecast.predictions[1]
        expected = cautious.variance + float(cautious.spread[:m].mean())
        surprise = float(np.mean((measured - cautious.unshrunk[:m])[accepted] ** 2)) / expected
        if surprises and surprise > _SURPRISE:
            self._discount(min(max((_SURPRISE / surprise) ** 2, _SURPRISED * self.settings.Np / self.n_rows), 1.0))
        for candidate, prediction in zip(self.candidates, forecast.predictions, strict=True):
            candidate.judge(prediction.unshrunk[:m][accepted], measured[accepted])
            candidate.noise_variance = given or prediction.noise_variance

    def _discount(self, kept: float) -> None:
        """Weigh all samples so far by ``kept``."""
        self.regression.discount(kept)
        self.n_rows *= kept
        if self.change is not None:
            self.change.discount(kept)

    def _fold(self, static: Array, measured: Array, learned: NDArray[np.bool_]) -> None:
        """Update the regression with a window's rows ``[static features | lags | e_pb]``."""
        m = len(measured)
        rows = np.empty((m, self.regression.n_features + 1), order="F")
        rows[:, : self.static.n] = static
        rows[:, self.static.n : -1] = lags(self.past, measured)
        rows[:, -1] = measured
        if self.settings.forgetting > 0.0:
            self._discount(math.exp(-m * self.settings.T_s / self.settings.forgetting))
        stacked = np.asfortranarray(rows[learned])
        if self.change is None:
            self.regression.update_stacked(stacked)
        else:
            self.change.learn(stacked)
            self.regression = self.change.all_rows()
        self.n_rows += int(learned.sum())


def _bridged(last: float, measured: Array, accepted: NDArray[np.bool_]) -> Array:
    """Return residuals with those not accepted interpolated between accepted ones; ``last`` is before the first."""
    known = np.flatnonzero(accepted)
    places, values = np.concatenate(([-1], known)), np.concatenate(([last], measured[known]))
    return np.asarray(np.interp(np.arange(len(measured)), places, values))
