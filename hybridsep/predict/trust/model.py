"""Residual model that can be trusted: the paper's regression twice, stacked with physics and hold.

``e_pb = x − x_pb`` of a window is predicted by physics (0), hold (the last residual), by static features with lags and
without, and by eq. (4) with ``G_pb = 1``, on the residual of the command itself, which saves a user whose physics model
is poor. Their sum is weighted by their errors so far (:mod:`~hybridsep.predict.trust.stack`). Where the paper's
regression has one bare penalty λ on every weight, here each weight has a prior from the effect that its feature may
have, and λ is the least variance of the noise. Nothing has a scale of its own: results for positions in another unit
are the same in that unit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.settings import PredictorSettings
from ...base.signals import Array
from ...model.discrete import DiscreteModel
from ..forecast import FeatureScales
from ..regression import RidgeRegression
from ..residual_model import ResidualModel, WindowInputs
from .command import CommandFeatures
from .constants import CONSTANTS, TrustConstants
from .disturbances import LEAST_VELOCITY, Disturbance, StaticFeatures, StaticState
from .experts import Evidence, EvidenceOfRuns, Expert, ExpertPrediction, ResidualScale, SolvedExpert, lags
from .forecast import TrustedForecast
from .reach import Reach, reached
from .stack import Stack

__all__ = ["COMMAND", "DOUBTING", "HOLD", "LAGGED", "STATIC", "RunState", "TrustedModel"]

HOLD, LAGGED, STATIC, COMMAND, DOUBTING = range(5)
"""Experts in the order of the stack: the last residual; static features with lags, and without; the command alone; and
the one of these with lags that led, with little weight of earlier runs."""

_BRIDGED = 3
"""Lags of a row that may stand for samples without a measurement."""


class RunState(NamedTuple):
    """What a run has been before the next window; positions relative to the start.

    Attributes
    ----------
    static : StaticState
    commands : (d + p_A + 1,) array, m
        Last commands, oldest first, for the ``p_A`` lags of the command's expert.
    past, past_of_command : (p,) and (p_A,) array, m
        Last residuals of the physics model, and of the command; newest first.
    bridged : (max(p, p_A),) array of bool
        Whether the last ones stand for samples without a measurement, oldest first.
    """

    static: StaticState
    commands: Array
    past: Array
    past_of_command: Array
    bridged: NDArray[np.bool_]


class TrustedModel(ResidualModel[TrustedForecast]):
    """Model of the residual ``e_pb``, learned online; it stays the physics model where it does not know better.

    :class:`~hybridsep.predict.trust.saved.SavedTrustedModel` adds its saved state.

    Parameters
    ----------
    settings : PredictorSettings
        ``p`` and ``q`` are the largest lags, ``lam`` the least variance of the noise.
    discrete : DiscreteModel
        ``G_pb``.
    own : sequence of Disturbance
        Of the user's own.
    constants : TrustConstants

    Attributes
    ----------
    leading : int
        Expert that led when earlier runs ended, LAGGED or COMMAND: DOUBTING is its counterpart.
    """

    may_miss: ClassVar[bool] = True

    def __init__(
        self,
        settings: PredictorSettings,
        discrete: DiscreteModel,
        own: Sequence[Disturbance] = (),
        constants: TrustConstants = CONSTANTS,
    ) -> None:
        self.settings, self.constants, self.preview = settings, constants, settings.Np
        p = settings.p
        self.static = StaticFeatures(discrete, settings.q, settings.period, own, constants)
        self.command = CommandFeatures(discrete.dead_time, constants.lags_of_command, constants.last_lag)
        self.experts = {LAGGED: self._expert(LAGGED), STATIC: Expert(self.static.shares, 0, constants)}
        self.experts |= {COMMAND: self._expert(COMMAND), DOUBTING: self._expert(LAGGED)}
        self.leading = LAGGED
        self.stack = Stack((0.0, constants.first_lagged, constants.first_static, 0.0, 0.0), constants)
        self.evidence = EvidenceOfRuns(self.static.n + p)
        self.evidence_of_command = EvidenceOfRuns(self.command.n + self.command.p)
        self.largest = np.zeros(self.static.n)
        self.velocity_scale = self.largest_step = 0.0
        self.scale, self.scale_of_command = ResidualScale(), ResidualScale()
        self.reach = Reach()
        self.restart()

    def restart(self) -> None:
        """Begin another run, at rest; what was learned is kept."""
        p = self.settings.p
        no: NDArray[np.bool_] = np.zeros(max(p, self.command.p), dtype=np.bool_)
        commands, past_of_command = np.zeros(self.command.n_before), np.zeros(self.command.p)
        self.run = RunState(self.static.rest(), commands, np.zeros(p), past_of_command, no)
        self.reach = Reach(self.reach.fastest)
        self.n_rejected = 0
        for evidence in (self.evidence, self.evidence_of_command):
            evidence.begin_run(self.constants.carried * self.settings.Np)
        self.lead(self._leader)
        self.stack.forget(DOUBTING)
        if self.doubts:
            self.experts[DOUBTING].take_over(self.experts[self.leading])
            self.stack.copy(self.leading, DOUBTING)

    @property
    def _leader(self) -> int:
        """COMMAND, if it has more of the stack than LAGGED and STATIC together, else LAGGED."""
        weights = self.stack.weights
        return COMMAND if weights[COMMAND] > weights[LAGGED] + weights[STATIC] else LAGGED

    def lead(self, expert: int) -> None:
        """Let the doubting expert be the counterpart of LAGGED or COMMAND."""
        self.leading, self.experts[DOUBTING] = expert, self._expert(expert)

    def _expert(self, expert: int) -> Expert:
        """Return a new expert with lags, of the kind of LAGGED or COMMAND."""
        if expert == COMMAND:
            return Expert(self.command.shares, self.command.p, self.constants)
        return Expert(self.static.shares, self.settings.p, self.constants)

    def is_of_command(self, expert: int) -> bool:
        """Return whether an expert predicts the residual of the command."""
        return expert == COMMAND or (expert == DOUBTING and self.leading == COMMAND)

    def begin_in_motion(self, forecast: TrustedForecast, x_d: Array, x_pb: Array) -> TrustedForecast:
        """Correct what was before a run in motion: commands and physics-based prediction went on as they begin."""
        static, n, p = self.run.static, self.command.n_before, self.command.p
        commands = x_d[0] + (x_d[1] - x_d[0]) * np.arange(-n, 0)
        positions = x_pb[0] + (x_pb[1] - x_pb[0]) * np.arange(-max(n, len(static.x_pb)), 0)
        late = commands[-1 - self.command.dead_time :: -1][:p]
        self.run = self.run._replace(
            static=static._replace(x_d=float(commands[-1]), x_pb=positions[-len(static.x_pb) :]),
            commands=commands,
            past_of_command=positions[: -p - 1 : -1] - late,
        )
        return super().begin_in_motion(forecast, x_d, x_pb)

    @property
    def doubts(self) -> bool:
        """Whether what earlier runs have trained is doubted."""
        return self.evidence.earlier is not None

    @property
    def regression(self) -> RidgeRegression:  # type: ignore[override]
        """Of all learned samples."""
        return self.evidence.all().regression

    @property
    def regressions(self) -> tuple[RidgeRegression, ...]:
        """Of the physics model's residual, and of the command's."""
        return self.regression, self.evidence_of_command.all().regression

    @property
    def n_rows(self) -> float:
        """Rows learned so far, weighted."""
        return self.evidence.n_rows

    @property
    def lag_weights(self) -> Array:
        """Weights of the lags from all learned samples, ``(p,)``."""
        return self.regression.weights[self.static.n :]

    @property
    def last(self) -> float:
        """Last residual that was accepted or bridged, m."""
        return float(self.run.past[0])

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
        solved: Mapping[int, SolvedExpert],
        x_d: Array,
        x_pb: Array,
        scales: FeatureScales,
        held: Mapping[int, ExpertPrediction] | None = None,
    ) -> TrustedForecast:
        """Predict as :meth:`forecast` by the experts of :meth:`solved`, with the shrinking of ``held`` if there is."""
        held = {} if held is None else held
        x, rows = x_pb, np.empty((len(x_d), 0))
        if STATIC in solved:
            # The stiffness acts at the position, which the physics model alone does not give well enough.
            rows = self._rows(x_d, x_pb, x_pb, scales)
            x = x_pb + self._predicted(STATIC, solved, rows, held).e_h
            rows = self._rows(x_d, x_pb, x, scales)
        found: dict[int, ExpertPrediction] = {}
        stacked = np.zeros((len(self.stack.first), len(x_d)))
        growth = self._growth(scales)
        stacked[HOLD] = min(max(self.last, -self.bound), self.bound)
        for expert in solved:
            of_command = self.is_of_command(expert)
            features = self.command.rows(self.run.commands, x_d) if of_command else rows
            found[expert] = self._predicted(expert, solved, features, held, growth)
            stacked[expert] = found[expert].e_h
            if of_command:
                follows = self.command.late(self.run.commands, x_d) - x_pb
                most = growth * self.bound
                stacked[expert] = np.clip(stacked[expert] + follows, -most, most)
        e_h = self.stack.weights @ stacked
        second = stacked**2  # second moments of the residual by each expert; hold and physics have no variance
        for expert, prediction in found.items():
            second[expert] += prediction.variance
        variance = np.maximum(self.stack.weights @ second - e_h**2, 0.0)
        return TrustedForecast(x_d, x_pb, e_h, variance, x, stacked, found, scales)

    def _predicted(
        self,
        expert: int,
        solved: Mapping[int, SolvedExpert],
        rows: Array,
        held: Mapping[int, ExpertPrediction],
        growth: float = 1.0,
    ) -> ExpertPrediction:
        """Return what an expert predicts of a window from its features without lags; ``growth`` of the command."""
        if self.is_of_command(expert):
            scale, past = self.scale_of_command.grown(growth), self.run.past_of_command
            bound = self.constants.bound_of_command * scale.largest
        else:
            scale, past, bound = self.scale, self.run.past, self.bound
        return solved[expert].predict(rows, past, scale.largest_square, bound, held.get(expert))

    def _growth(self, scales: FeatureScales) -> float:
        """Return the largest step of the command relative to that before the window, ≥ 1, where its expert leads.

        What follows the command alone is linear in it: it may be larger than anything so far by as much.
        """
        if not (self.largest_step > 0.0 and self._leader == COMMAND):
            return 1.0
        return min(scales.step / self.largest_step, self.constants.growth)

    def _rows(self, x_d: Array, x_pb: Array, x: Array, scales: FeatureScales) -> Array:
        """Return the static features to predict with, ``(n, n_static)``; ``x``: position that the stiffness acts at."""
        rows, _ = self.static.rows(self.run.static, x_d, x_pb, x, scales.velocity)
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
        c, static = self.constants, self.run.static
        peak = self.static.peak_velocity(static, x_d)
        outgrown = peak > max(c.outgrown * self.velocity_scale, LEAST_VELOCITY)
        step = max(self.largest_step, peak * self.settings.T_s)
        if path is not None and self.n_rows == 0.0:
            peak = max(float(np.abs(np.diff(path)).max(initial=0.0)) / self.settings.T_s, self.velocity_scale)
            outgrown = peak > max(self.velocity_scale, LEAST_VELOCITY)
        velocity_scale = peak if outgrown else self.velocity_scale
        rows, _ = self.static.rows(static, x_d, x_pb, x_pb, velocity_scale)
        before = np.zeros(self.static.n) if outgrown else self.largest
        return FeatureScales(velocity_scale, np.maximum(before, np.abs(rows).max(axis=0)), step)

    def solved(self, scales: FeatureScales) -> dict[int, SolvedExpert]:
        """Return the experts that know something, with their weights."""
        solved: dict[int, SolvedExpert] = {}
        if self.n_rows > 0.0 and scales.velocity == self.velocity_scale and self.scale.largest_square > 0.0:
            solved |= self._solved_of(LAGGED, self.evidence, scales.largest, self.scale)
        if self.evidence_of_command.n_rows > 0.0 and self.scale_of_command.largest_square > 0.0:
            largest = self.command.largest(scales.step)
            solved |= self._solved_of(COMMAND, self.evidence_of_command, largest, self.scale_of_command)
        return solved

    def _solved_of(
        self, expert: int, of_runs: EvidenceOfRuns, largest: Array, scale: ResidualScale
    ) -> dict[int, SolvedExpert]:
        """Return the experts of one kind of rows, that of LAGGED or COMMAND, with their weights."""
        evidence = of_runs.all()
        experts = (LAGGED, STATIC) if expert == LAGGED else (COMMAND,)
        solved = {one: self._solved(one, evidence, largest, scale) for one in experts}
        if self.doubts and expert == self.leading:
            solved[DOUBTING] = self._solved(DOUBTING, of_runs.all(self.constants.less), largest, scale)
        return solved

    def _solved(self, expert: int, evidence: Evidence, largest: Array, scale: ResidualScale) -> SolvedExpert:
        """Return an expert with the weights that follow from all rows so far."""
        square, settings = scale.largest_square, self.settings
        effect = settings.effect or math.sqrt(square)
        first = settings.noise_std**2 or self.constants.first_noise * square
        least = min(settings.lam, self.constants.least_noise * square)
        return self.experts[expert].solve(evidence, largest, effect, first, least)

    @property
    def bound(self) -> float:
        """Bound on what is predicted, m."""
        return self.constants.bound * self.scale.largest

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
        m = len(x)
        if forecast.scales.velocity != self.velocity_scale:  # outgrown
            self.evidence.forget()
            self.evidence_of_command.believe_earlier()
            self.stack.forget(DOUBTING)
        self.velocity_scale, self.largest, self.largest_step = forecast.scales
        run, x_d, x_pb = self.run, forecast.x_d[:m], forecast.x_pb[:m]
        before, largest, T_s = float(run.static.x_pb[-1]), self.scale.largest, self.settings.T_s
        accepted, self.reach = reached(self.reach, x, x_pb, before, largest, T_s, self.constants)
        e = _bridged(self.last, x - x_pb, accepted)
        e_0 = e + x_pb - self.command.late(run.commands, x_d)
        rows, static = self.static.rows(run.static, x_d, x_pb, x_pb + e, self.velocity_scale)
        bridged: NDArray[np.bool_] = np.concatenate((run.bridged, ~accepted))
        if fold and accepted.any():
            self._fold(rows, x_d, e, e_0, bridged)
            self._judge(forecast, e, e_0, accepted)
        self.n_rejected += m - int(accepted.sum())
        self.run = RunState(
            static,
            np.concatenate((run.commands, x_d))[m:],
            np.concatenate((e[::-1], run.past))[: self.settings.p],
            np.concatenate((e_0[::-1], run.past_of_command))[: self.command.p],
            bridged[m:],
        )
        return accepted

    def _fold(self, rows: Array, x_d: Array, e: Array, e_0: Array, bridged: NDArray[np.bool_]) -> None:
        """Update the experts' evidence with a window's rows of static features."""
        if self.settings.forgetting > 0.0:
            for evidence in (self.evidence, self.evidence_of_command):
                evidence.discount(math.exp(-len(e) * self.settings.T_s / self.settings.forgetting))
        learned = _learnable(bridged, len(e), self.settings.p)
        self.evidence.this.learn(rows[learned], lags(self.run.past, e)[learned], e[learned])
        learned, of_command = _learnable(bridged, len(e), self.command.p), self.command.rows(self.run.commands, x_d)
        lagged = lags(self.run.past_of_command, e_0)
        self.evidence_of_command.this.learn(of_command[learned], lagged[learned], e_0[learned])

    def _judge(self, forecast: TrustedForecast, e: Array, e_0: Array, accepted: NDArray[np.bool_]) -> None:
        """Judge the experts and their stack by the measurement of their window."""
        given = self.settings.noise_std**2
        for expert, prediction in forecast.predictions.items():
            self.experts[expert].judge(prediction, e_0 if self.is_of_command(expert) else e, accepted, given)
        self.scale = self.scale.with_window(e[accepted])
        self.scale_of_command = self.scale_of_command.with_window(e_0[accepted])
        late = self.settings.measurement_delay
        published = accepted & (np.arange(len(e)) >= late) if late < len(e) else accepted
        if published.any():
            self.stack.update(forecast.stacked[:, : len(e)][:, published], e[published], self.settings.lam)
        if self.doubts and self.stack.weights[DOUBTING] > self.constants.doubt:
            self._forget_earlier_runs()

    def _forget_earlier_runs(self) -> None:
        """Let all experts go on with this run alone, and judge them anew."""
        self.evidence.forget_earlier()
        self.evidence_of_command.forget_earlier()
        for expert in (LAGGED, STATIC) if self.leading == COMMAND else (STATIC,):
            self.experts[expert].restart()
        self.experts[self.leading].take_over(self.experts[DOUBTING])
        self.stack.restart()


def _learnable(bridged: NDArray[np.bool_], n: int, p: int) -> NDArray[np.bool_]:
    """Return which of the last ``n`` samples were measured, as were all but a few of their ``p`` lags."""
    n_bridged = np.convolve(bridged[-n - p : -1].astype(np.float64), np.ones(p), "valid")
    return np.asarray(~bridged[-n:] & (n_bridged <= _BRIDGED))


def _bridged(last: float, measured: Array, accepted: NDArray[np.bool_]) -> Array:
    """Return residuals with those not accepted interpolated between accepted ones; ``last`` is before the first."""
    known = np.flatnonzero(accepted)
    places, values = np.concatenate(([-1], known)), np.concatenate(([last], measured[known]))
    return np.asarray(np.interp(np.arange(len(measured)), places, values))
