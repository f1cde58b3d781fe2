"""Online model averaging of the residual: its state, its forecast of a window, and its learning from the measurement.

``e_pb = x − x_pb`` of a window is predicted by physics (0), hold (the last residual), by static features with lags and
without, and by eq. (4) with ``G_pb = 1``, on the residual of the command itself, which saves a user whose physics model
is poor. Their sum is weighted by their errors so far (:mod:`~hybridsep.predict.averaging.stacking`). Where the paper's
regression has one bare penalty λ on every weight, here each weight has a prior from the effect that its feature may
have, and λ is the least variance of the noise. Nothing has a scale of its own: results for positions in another unit
are the same in that unit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...base.settings import PredictorSettings
from ...base.signals import Array, first_differences
from ...base.state import FIXED
from ...model.discrete import DiscreteModel
from ..regression import RidgeRegression, lags
from ..window import FeatureScales, Forecast, ResidualWindow
from .constants import CONSTANTS
from .experts import (
    ARX_COMMAND,
    ARX_RESIDUAL,
    COMMAND_RESIDUAL,
    EXPERTS,
    FRESH_START,
    MODEL_RESIDUAL,
    RECALL,
    REGRESSIONS,
    STATIC,
    ExpertErrors,
    ExpertPrediction,
    ExpertWindow,
    Regression,
    ResidualScale,
    SolvedExpert,
)
from .features import LEAST_VELOCITY, Disturbance, StaticFeatures, StaticRows, StaticState
from .gate import InnovationGate, gated
from .recall import Memory
from .stacking import Stack
from .warm_start import WarmStartRows

_LITTLE = 0.1  # motion of the command, relative to a residual, beside which that is an offset
_AHEAD = 20
"""Samples before the end of a window, half of it at most, at which the noise variances for the next solve are frozen:
an approximation, for controllers, which factor most of that solution in them."""


@dataclass(frozen=True, eq=False)
class RunState:
    """What a run has been before the next window; positions relative to the start."""

    static: StaticState
    # pair of (p,) and (p_A,), m: last residuals of the physics model, and of the command; newest first
    past: tuple[Array, Array]
    gate: InnovationGate
    n_rejected: int  # measurements that were missing or not plausible
    memory: Memory  # of this run and earlier ones
    # m: mean residual of the first window that is learned, 0 if the command moved in it by more than a little
    level: float | None = None

    @classmethod
    def init(cls, p: int, static: StaticFeatures, memory: Memory) -> RunState:
        """Return the beginning of a run, at rest."""
        return cls(static.rest(), (np.zeros(p), np.zeros(static.command.p)), InnovationGate(), 0, memory)


@dataclass(frozen=True, eq=False)
class Learned:
    """What has been learned besides the rows: the numbers of a weights file, in this order, in the C core, too."""

    velocity_scale: float  # m/s: of the friction features; 0 before any motion
    # m: largest change from sample to sample, of the command and of the physics model
    largest_step: float
    fastest: float
    # pair of ResidualScale: sizes of the residuals, of the physics model and of the command
    scales: tuple[ResidualScale, ResidualScale]
    errors: tuple[ExpertErrors, ...]  # of the regressions
    # pair: of predictions, and of plans, by errors half a plan ahead, too; without plans the same
    stacks: tuple[Stack, ...]
    largest: Array  # (n_static,): largest magnitudes of the static features

    @classmethod
    def init(cls, n_static: int) -> Learned:
        """Return that nothing has been learned."""
        scales, errors = (ResidualScale(), ResidualScale()), (ExpertErrors(),) * len(REGRESSIONS)
        return cls(0.0, 0.0, 0.0, scales, errors, (Stack.init(),) * 2, np.zeros(n_static))

    def errors_of(self, expert: Regression) -> ExpertErrors:
        """Return what is known of the errors of an expert."""
        return self.errors[REGRESSIONS.index(expert)]

    @property
    def stack(self) -> Stack:
        """Stack of predictions."""
        return self.stacks[0]

    def with_errors(self, changed: Mapping[Regression, ExpertErrors]) -> Learned:
        """Return the same with other errors of some experts."""
        errors = tuple(changed.get(one, known) for one, known in zip(REGRESSIONS, self.errors, strict=True))
        return replace(self, errors=errors)


@dataclass(frozen=True)
class AveragedForecast(Forecast):
    """Window predicted by the averaged model."""

    scales: FeatureScales
    of_physics: StaticRows | None  # static features for ``x_pb``
    x: Array  # (n,), m: position that the stiffness acts at
    stacked: Array  # (n_experts, n), m: predictions that are stacked
    predictions: Mapping[Regression, ExpertPrediction]  # of the regressions that know something
    # (n_experts,): weights of the experts: RECALL counts as far as the commands are alike, the others for the rest
    shares: Array
    memory: Memory  # with the commands ahead
    moves: float  # share of ARX_COMMAND's answer in what RECALL predicts


@dataclass(frozen=True, eq=False)
class AveragedModel:
    """State of the model: what it has learned, and its run; the physics model where it does not know better."""

    # ``p`` and ``q`` are the largest lags, ``lam`` the least variance of the noise
    settings: PredictorSettings = field(metadata=FIXED)
    static: StaticFeatures = field(metadata=FIXED)
    learned: Learned
    # pair of WarmStartRows: rows of the residuals of the physics model, and of the command
    evidence: tuple[WarmStartRows, WarmStartRows]
    # m²: of the regressions, variances that the penalties of the next solution come from; 0: none yet
    noise: tuple[float, ...]
    leader: int  # place of the expert that led when earlier runs ended
    run: RunState

    @classmethod
    def init(
        cls, settings: PredictorSettings, discrete: DiscreteModel, own: tuple[Disturbance, ...] = ()
    ) -> AveragedModel:
        """Return the model at rest, with nothing learned; ``discrete``: ``G_pb``, ``own``: the user's disturbances."""
        static = StaticFeatures(discrete, settings.q, settings.period, own)
        evidence = WarmStartRows.init(static.n + settings.p), WarmStartRows.init(2 * static.command.p + 2)
        learned, noise, leader = Learned.init(static.n), (0.0,) * len(REGRESSIONS), ARX_RESIDUAL.place
        run = RunState.init(settings.p, static, Memory.init(settings.recall, settings.Np))
        return cls(settings, static, learned, evidence, noise, leader, run)

    @property
    def leading(self) -> Regression:
        """Expert that led when earlier runs ended: FRESH_START is its counterpart."""
        return ARX_COMMAND if self.leader == ARX_COMMAND.place else ARX_RESIDUAL

    def with_noise(self, learned: Learned) -> AveragedModel:
        """Return the model with the variances of the noise that follow from what is learned so far."""
        settings = self.settings

        def noise(expert: Regression) -> float:
            kind = expert.like(self).target
            square = learned.scales[kind].largest_square
            first = settings.noise_std**2 or CONSTANTS.first_noise * square
            least = min(settings.lam, CONSTANTS.least_noise * square)
            return learned.errors_of(expert).variance(self.evidence[kind].target_square(expert.weight), first, least)

        return replace(self, noise=tuple(noise(one) for one in REGRESSIONS))

    @property
    def doubts(self) -> bool:
        """Whether what earlier runs have trained is doubted."""
        return self.evidence[MODEL_RESIDUAL].earlier.n_rows > 0.0

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible."""
        return self.run.n_rejected

    @property
    def farthest(self) -> float:
        """Largest residual among the last samples, m, where these were rejected; else 0."""
        return self.run.gate.farthest

    @property
    def last(self) -> float:
        """Last residual that was accepted or bridged, m."""
        return float(self.run.past[MODEL_RESIDUAL][0])

    @property
    def regressions(self) -> tuple[RidgeRegression, ...]:
        """Of all learned samples: of the physics model's residual, and of the command's."""
        return tuple(one.all() for one in self.evidence)

    @property
    def lag_weights(self) -> Array:
        """Weights of the lags from all learned samples, ``(p,)``, without penalties: no prediction uses them."""
        return self.regressions[MODEL_RESIDUAL].weights[self.static.n :]

    def restart(self) -> AveragedModel:
        """Return the model at the beginning of another run, at rest; what was learned is kept, and doubted."""
        learned, most = self.learned, CONSTANTS.warm_windows_max * self.settings.Np
        evidence = self.evidence[0].begin_run(most), self.evidence[1].begin_run(most)
        leading, errors = learned.stack.leader, ExpertErrors()
        stacks = [one.forget(FRESH_START) for one in learned.stacks]
        if evidence[MODEL_RESIDUAL].earlier.n_rows > 0.0:
            stacks, errors = [one.copy(leading, FRESH_START) for one in stacks], learned.errors_of(leading)
        learned = replace(learned.with_errors({FRESH_START: errors}), stacks=tuple(stacks))
        run = RunState.init(self.settings.p, self.static, self.run.memory.restart())
        return replace(self, learned=learned, evidence=evidence, leader=leading.place, run=run).with_noise(learned)

    def plan_ahead(self, preview: int) -> AveragedModel:
        """Return the model where a compensator decides the commands, and knows ``preview`` samples ahead."""
        return replace(self, static=replace(self.static, n_known=self.settings.n_late + preview))

    def for_plans(self) -> AveragedModel:
        """Return the model with the weights that plans weigh its experts by."""
        _, of_plans = self.learned.stacks
        return replace(self, learned=replace(self.learned, stacks=(of_plans, of_plans)))

    def take_over(self, learned: Learned, regressions: tuple[RidgeRegression, ...]) -> AveragedModel:
        """Return the model with what another one has learned."""
        of_physics, of_command = (
            replace(one.forget(), this=rows) for one, rows in zip(self.evidence, regressions, strict=True)
        )
        return replace(self, learned=learned, evidence=(of_physics, of_command))

    def scales_of(self, window: ResidualWindow) -> tuple[FeatureScales, StaticRows]:
        """Return the scales of the features, a compensator's with its creep, and the window's features for ``x_pb``."""
        static, learned, settings = self.static, self.learned, self.settings
        before = learned.velocity_scale
        peak = static.peak_velocity(np.append(self.run.static.x_d[-1:], window.x_d), window.start)
        n_windows = self.evidence[MODEL_RESIDUAL].earlier.n_rows / settings.Np
        outgrown = peak > max(CONSTANTS.velocity_jump * max(n_windows, 1.0) * before, LEAST_VELOCITY)
        step = max(learned.largest_step, peak * settings.T_s)
        if static.n_known and self.evidence[MODEL_RESIDUAL].n_rows == 0.0:
            peak = max(static.peak_velocity(window.raw_commands[settings.n_late :], window.start), before)
            outgrown = peak > max(before, LEAST_VELOCITY)
        velocity = peak if outgrown else before
        static_rows = static.rows(self.run.static, window, window.x_pb, velocity)
        largest = np.zeros(static.n) if outgrown else learned.largest
        largest = np.maximum(largest, np.abs(static_rows.rows).max(axis=0)) if velocity > 0.0 else np.ones(static.n)
        return FeatureScales(velocity, largest, step), static_rows

    def solved(self, scales: FeatureScales) -> dict[Regression, SolvedExpert]:
        """Return the regressions that know something, with their weights."""
        found = {one: one.solve(self, scales) for one in REGRESSIONS}
        return {one: weights for one, weights in found.items() if weights is not None}

    def forecast_by(
        self,
        solved: Mapping[Regression, SolvedExpert],
        window: ResidualWindow,
        scales: FeatureScales,
        like: AveragedForecast | None = None,
        variance_rows: NDArray[np.intp] | None = None,
        of_physics: StaticRows | None = None,
    ) -> AveragedForecast:
        """Predict as :meth:`forecast` by the regressions of :meth:`solved`.

        ``like``: under other commands, with the same path: its shrinking is held; ``variance_rows``, (n,): as
        :meth:`~hybridsep.predict.averaging.experts.SolvedExpert.predict` has it; ``of_physics``: features of the window
        for ``x_pb``, if they are known.
        """
        x, path, held = window.x_pb, window.raw_commands, like.predictions if like else {}
        memory = like.memory if like else self.run.memory.append_commands(path, self.static.n_known, self.settings.Np)
        recalled = memory.recalled(len(path), RECALL.before(self.static, len(path)))
        moves = like.moves if like else recalled.same * RECALL.moves(self.static, solved, len(path))
        of_physics = of_physics or self.static.rows(self.run.static, window, x, scales.velocity)
        at = ExpertWindow(self, window, solved, scales, of_physics.rows, {}, recalled, moves)
        if STATIC in solved:
            # The stiffness acts at the position, which the physics model by itself does not give well enough. Both
            # predictions are shrunk alike, so that other commands have the same model.
            at_first = STATIC.predict(at, held.get(STATIC), variance_rows)
            x, held = x + at_first.e_h, {**held, STATIC: at_first}
            at = replace(at, rows=self.static.rows(self.run.static, window, x, scales.velocity, of_physics).rows)
        predictions = {one: one.predict(at, held.get(one), variance_rows) for one in solved}
        at, stacked = replace(at, predictions=predictions), np.empty((len(EXPERTS), len(x)))
        for one in EXPERTS:
            stacked[one.place] = one.forecast(at)
        others, weights = self.learned.stack.others(), self.learned.stack.weights
        alike, recall = recalled.alike, RECALL.place
        shares = weights + weights[recall] * (1.0 - alike) * others
        shares[recall] = weights[recall] * alike
        stacked[recall] = alike * stacked[recall] + (1.0 - alike) * (others @ stacked)
        e_h = weights @ stacked
        second = stacked**2  # second moments of the residual by each expert; hold and physics have no variance
        for one, prediction in predictions.items():
            second[one.place] += prediction.variance
        variance = np.maximum(weights @ second - e_h**2, 0.0)
        found = (stacked, predictions, shares, memory, moves)
        return AveragedForecast(window, e_h, variance, scales, of_physics, x, *found)

    def forecast(self, window: ResidualWindow, scales: FeatureScales | None = None) -> AveragedForecast:
        """Predict the residual over the next window; ``scales``: a compensator's, else by :meth:`scales_of`."""
        of_physics = None
        if scales is None:
            scales, of_physics = self.scales_of(window)
        return self.forecast_by(self.solved(scales), window, scales, of_physics=of_physics)

    def begin_in_motion(self, window: ResidualWindow, scales: FeatureScales) -> AveragedModel:
        """Correct what was before a run in motion: commands and physics-based prediction went on as they begin.

        ``window``: the first one, with the motion before it; ``scales``: of the features in it.
        """
        (x_d, x_pb, *_), command, static = window, self.static.command, self.run.static
        commands = x_d[0] + (x_d[1] - x_d[0]) * np.arange(-command.n_before, 0)
        positions = x_pb[0] + (x_pb[1] - x_pb[0]) * np.arange(-max(command.n_before, len(static.x_pb)), 0)
        late = commands[-1 - command.dead_time :: -1][: command.p]
        past = self.run.past[MODEL_RESIDUAL], positions[: -command.p - 1 : -1] - late
        stops = np.sign(x_d[1] - x_d[0]) * self.static.distances(scales.velocity)
        static = replace(static, x_d=commands, x_pb=positions[-len(static.x_pb) :], stops=stops)
        return replace(self, run=replace(self.run, static=static, past=past))

    def learn(
        self, forecast: AveragedForecast, x: Array, *, fold: bool = True, ahead: Array | None = None
    ) -> tuple[AveragedModel, NDArray[np.bool_]]:
        """Learn from the measurement of a window.

        ``forecast``: of this state; ``x``, (m,), m: measured positions of its first ``m`` samples, relative to the
        start; NaN where missing; ``fold``: whether they are learned; the next window starts from them in any case;
        ``ahead``, shape (n_experts, m), in m: of a compensator, what a plan stacked for the window; NaN if none did.
        Returns (m,): which samples are accepted.
        """
        m, run = len(x), self.run
        window = forecast.window._replace(x_d=forecast.window.x_d[:m], x_pb=forecast.window.x_pb[:m])
        fastest = float(np.abs(first_differences(window.x_pb, run.static.x_pb[-1])).max())
        state = _with_scales(self, forecast, max(self.learned.fastest, fastest))
        learned, measured = state.learned, x - window.x_pb
        largest, T_s = learned.scales[MODEL_RESIDUAL].largest, self.settings.T_s
        accepted, gate = gated(run.gate, measured, largest, max(learned.fastest, learned.velocity_scale * T_s), T_s)
        e = _bridged(forecast.e_h[:m], measured, accepted)
        e_0 = e + window.x_pb - self.static.command.late(run.static.x_d, window.x_d)
        x, velocity = window.x_pb + e, learned.velocity_scale
        rows, static, *_ = self.static.rows(run.static, window, x, velocity, forecast.of_physics)
        if fold:
            if run.level is None and accepted.any():
                level = float(np.mean(e[accepted]))
                rests = np.ptp(np.append(window.x_d, run.static.x_d[-1])) <= _LITTLE * abs(level)
                run = replace(run, level=level if rests else 0.0)
                state = replace(state, run=run)
            of_command = self.static.command.rows(run.static.x_d, window.x_d)
            state = _folded(state, forecast, (rows, of_command), (e, e_0), accepted)
            state = _judged(state, forecast, (e, e_0), accepted, ahead) if accepted.any() else state
        past = tuple(np.concatenate((new[::-1], old))[: len(old)] for new, old in zip((e, e_0), run.past, strict=True))
        n_rejected = run.n_rejected + m - int(accepted.sum())
        n, late = len(window.raw_commands), self.static.command.late(run.static.x_d, window.x_d)
        memory = forecast.memory.remember(np.stack((e, late, e - e_0)), n, RECALL.before(self.static, n))
        run = RunState(static, (past[0], past[1]), gate, n_rejected, memory, run.level)
        return replace(state, run=run), accepted


def _with_scales(state: AveragedModel, forecast: AveragedForecast, fastest: float) -> AveragedModel:
    """Take over the scales of a window; what was learned at lower velocities is forgotten if it outgrows them."""
    learned, (velocity, largest, step) = state.learned, forecast.scales
    of_physics, of_command = state.evidence
    if velocity != learned.velocity_scale:
        of_physics, of_command = of_physics.forget(), of_command.believe_earlier()
        learned = replace(learned, stacks=tuple(one.forget(FRESH_START) for one in learned.stacks))
    learned = replace(learned, velocity_scale=velocity, largest_step=step, fastest=fastest, largest=largest)
    return replace(state, learned=learned, evidence=(of_physics, of_command))


def _folded(
    state: AveragedModel,
    forecast: AveragedForecast,
    rows: tuple[Array, Array],
    e: tuple[Array, Array],
    accepted: NDArray[np.bool_],
) -> AveragedModel:
    """Learn the rows of a window, without lags, and its residuals, of the physics model and of the command."""
    settings, n = state.settings, len(e[MODEL_RESIDUAL])
    first = slice(settings.Np - min(settings.Np // 2, _AHEAD))
    forgetting_factor = math.exp(-n * settings.T_s / settings.forgetting) if settings.forgetting > 0.0 else 1.0

    def taken(kind: int) -> tuple[Array, Array, Array]:
        past = state.run.past[kind]
        return rows[kind], lags(np.concatenate((past[::-1], e[kind][:-1])), len(past)), e[kind]

    of_kind = taken(MODEL_RESIDUAL), taken(COMMAND_RESIDUAL)

    def learned(evidence: Iterable[WarmStartRows], part: slice) -> tuple[WarmStartRows, WarmStartRows]:
        kept = slice(None) if accepted[part].all() else accepted[part]
        of_physics, of_command = (
            one.learn(*(signal[part][kept] for signal in row)) for one, row in zip(evidence, of_kind, strict=True)
        )
        return of_physics, of_command

    state = replace(state, evidence=learned((one.discount(forgetting_factor) for one in state.evidence), first))
    state = state.with_noise(_judged_experts(state, forecast, (e[0][first], e[1][first]), accepted[first]))
    return replace(state, evidence=learned(state.evidence, slice(first.stop, n)))


def _judged_experts(
    state: AveragedModel, forecast: AveragedForecast, e: tuple[Array, Array], accepted: NDArray[np.bool_]
) -> Learned:
    """Judge the experts, and the sizes of the residuals, by the first samples of their window."""
    learned, given = state.learned, state.settings.noise_std**2
    if not accepted.any():
        return learned
    errors = {
        expert: learned.errors_of(expert).judge(one, e[expert.like(state).target], accepted, given)
        for expert, one in forecast.predictions.items()
    }
    level = state.run.level or 0.0
    of_physics, of_command = (scale.follow(one[accepted], level) for scale, one in zip(learned.scales, e, strict=True))
    return replace(learned.with_errors(errors), scales=(of_physics, of_command))


def _bridged(e_h: Array, measured: Array, accepted: NDArray[np.bool_]) -> Array:
    """Return residuals; where they are not accepted the predicted ones, with the error of those beside them."""
    # It is interpolated, 0 before the first one
    known = np.flatnonzero(accepted)
    places, errors = np.concatenate(([-1], known)), np.concatenate(([0.0], (measured - e_h)[known]))
    return np.where(accepted, measured, e_h + np.interp(np.arange(len(measured)), places, errors))


def _judged(
    state: AveragedModel,
    forecast: AveragedForecast,
    e: tuple[Array, Array],
    accepted: NDArray[np.bool_],
    ahead: Array | None,
) -> AveragedModel:
    """Judge the experts and their stacks by the measurement of their window."""
    learned, settings = _judged_experts(state, forecast, e, accepted), state.settings
    n, late = len(accepted), settings.n_late
    published = accepted & (np.arange(n) >= late) if late < n else accepted
    if published.any():
        (stack, of_plans), measured = learned.stacks, e[MODEL_RESIDUAL]
        predicted = forecast.stacked[:, :n][:, published]
        stack = of_both = stack.update(predicted, measured[published], settings.lam)
        if ahead is not None:
            known = accepted & np.isfinite(ahead).all()
            ahead = np.where(state.doubts | (np.arange(len(ahead)) != FRESH_START.place)[:, None], ahead, 0.0)
            predicted = np.hstack((predicted, ahead[:, known]))
            measured = np.concatenate((measured[published], measured[known]))
            of_both = of_plans.update(predicted, measured, settings.lam, stack.weights)
        learned = replace(learned, stacks=(stack, of_both))
    stack, led, fresh = learned.stack, state.leading.place, FRESH_START.place
    largest, (total, rows) = learned.scales[MODEL_RESIDUAL].largest_square, stack.evidence
    squares = stack.gram.diagonal() - 2.0 * stack.cross + total  # of the errors so far
    # Both began the run with the same evidence, so what they differ by has come in it
    harm, seen = squares[led] - squares[fresh], state.evidence[MODEL_RESIDUAL].this.target_square
    errs = squares[led] > CONSTANTS.discard_error * largest * rows
    harmed = errs and harm * seen > CONSTANTS.discard_harm * (largest * settings.Np) ** 2
    if not (state.doubts and harmed and stack.weights[fresh] > CONSTANTS.discard_above):
        return replace(state, learned=learned)
    # All experts go on with only this run, and are judged anew.
    anew = {ARX_RESIDUAL: ExpertErrors(), STATIC: ExpertErrors(), state.leading: learned.errors_of(FRESH_START)}
    learned = replace(learned.with_errors(anew), stacks=(Stack.init(),) * 2)
    evidence = state.evidence[0].forget_earlier(), state.evidence[1].forget_earlier()
    return replace(state, learned=learned, evidence=evidence).with_noise(learned)
