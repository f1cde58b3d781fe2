"""Plan on the averaged model, by Newton steps that follow the slope of its disturbances.

``min ‖w (x_d − x_h(x_d + δ))‖² + jerk_weight·‖D³ δ‖²`` within the drive's limits. The weights ``w`` of the errors fall
to the end of a plan (``splines.py``), and ``x_h`` is not affine in ``δ``: friction that follows the command changes its
sign with the command's velocity. One to three Gauss-Newton steps begin at the remainder of the last plan. Each solves
the quadratic programme of the model linearised where the last one ended, with the slope of friction over as large a
change of velocity as the last step made, and goes to its minimum, or less far if only that lowers the cost; the next
window goes on from there. The first samples of a plan follow the last one, and the plan is made while they act; the
solver's steps are limited, so that the work fits into these samples. Predictions are shrunk by their variance, so where
the model knows nothing the plan is the physics model's.

The slope at given commands is ``sech²(v/v_i)`` for friction and ``2|x|`` for stiffness. Stop operators, the weights of
the experts and of the stack, and the shrinking by the variance, are held constant:

``∂x_h = (1 − π_c − π_r) G_pb + Σ_i π_i ∂f_i + (π_c + π_r) ∂x_c``

``c`` is ``arx_command``, linear and time-invariant: its features are increments and lags of the command. ``i`` are
``arx_residual`` and ``static``; ``fresh_start`` counts as the expert whose counterpart it is. ``π_r`` is of what
``recall`` moves by the answer of ``arx_command``.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array, first_differences
from ..predict.averaging.experts import ARX_COMMAND, COMMAND_RESIDUAL, RECALL, STATIC, SolvedExpert
from ..predict.averaging.features import N_FRICTION, N_LASTING, N_SPANS, N_STOPS, StaticFeatures, StaticState
from ..predict.averaging.model import AveragedForecast, AveragedModel
from ..predict.window import ResidualWindow
from .limits import Bounds
from .qp import Tolerance, solve_change
from .splines import N_DECIDED, PlanCost, SplineBasis

_OWN_REACH = 1e-3
"""Change of velocity, relative to the velocity scale, that slopes of the user's own disturbances are taken over where
the friction's is the tangent."""

_VARIANCE_STRIDE = 4  # samples after the window that share the variance of the first one's features


class DisturbanceSlopes(NamedTuple):
    """Slopes of the disturbances at given commands; stop operators count as constant."""

    friction: Array  # (n, N_FRICTION), s/m: of each friction with the commanded velocity
    # (n,), m and m/s: of ``x·|x|`` with ``x`` and of ``v·|v|`` with ``v``
    stiffness: Array
    damping: Array
    of_position: Array  # (n, n_disturbances − N_LASTING), 1/m: of all others with ``x``
    of_velocity: Array  # (n, n_own), s/m: of the user's own, the last ones, with the commanded velocity

    def after(self, n: int) -> "DisturbanceSlopes":
        """Return the slopes after the first ``n`` samples."""
        return DisturbanceSlopes(*(one[n:] for one in self))

    def change(self, weights: Array, velocity: Array, moved: Array, moved_velocity: Array) -> Array:
        """Return what the disturbances change by, ``(n, m)``.

        ``weights``: (n_disturbances,); ``velocity``: (n, m), m/s: changes of the commanded velocity, each a column;
        ``moved``, ``moved_velocity``: (n, m), m and m/s: changes of the position, and of its velocity.
        """
        stiffness = N_FRICTION + N_STOPS
        of_position = weights[stiffness] * self.stiffness + self.of_position @ weights[N_LASTING:]
        of_velocity = self.friction @ weights[:N_FRICTION]
        if n_own := self.of_velocity.shape[1]:
            of_velocity = of_velocity + self.of_velocity @ weights[-n_own:]
        return np.asarray(
            of_velocity[:, None] * velocity
            + of_position[:, None] * moved
            + (weights[stiffness + 1] * self.damping)[:, None] * moved_velocity
        )


class PlanModel:
    """Averaged model with the weights of this instant, as a function of the commands of a plan.

    ``model``: where the measurements end, which is the beginning of the plan unless they are late; ``state``:
    (n_state,): state of ``G_pb`` there; ``late``: (n_late,), m: commands between there and the plan, relative to the
    start; ``start``: m; ``x_d``: (n,), m: commands from which the scales of the features and the variances of
    predictions follow, of the remainder of the last plan, relative to the start; ``path``: (horizon,), m: unmodified
    commands, likewise; ``load``: (horizon,), m: what the drive's load adds to any commands.
    """

    def __init__(
        self, model: AveragedModel, state: Array, late: Array, start: float, x_d: Array, path: Array, load: Array
    ) -> None:
        self._model, self._static, self._discrete = model, model.static, model.static.discrete
        self._state, self._late, self._start, self._path = state, late, start, np.concatenate((late, path))
        self._load = load
        window = self._window(x_d)
        self.scales, of_physics = model.scales_of(window)
        self._solved = model.solved(self.scales)
        rows, first = np.arange(len(late) + len(x_d)), len(late) + model.settings.Np
        rows[first:] -= np.arange(len(rows[first:])) % _VARIANCE_STRIDE  # after the window some stand for others
        # Prediction under ``x_d``, whose variances all others have.
        self.of_previous_plan = model.forecast_by(
            *(self._solved, window, self.scales), variance_rows=rows, of_physics=of_physics
        )

    def _window(self, x_d: Array) -> ResidualWindow:
        """Return the plan under commands ``x_d``, and what is late before it."""
        command = np.concatenate((self._late, x_d + self._load))
        x_pb, _ = self._discrete.forced_response(self._state, command)
        return ResidualWindow(command, x_pb, self._start, self._path)

    @property
    def has_learned(self) -> bool:
        """Whether it has learned how the drive's disturbances act."""
        return STATIC in self._solved

    def outgrows(self, factor: float) -> bool:
        """Return whether the unmodified commands, and the physics model under them, are faster than what is learned.

        They are, if they exceed the fastest motion that was learned by ``factor``. Both count, as commands may have
        corners that no drive follows, and a model may overshoot them.
        """
        late, n = len(self._late), len(self.of_previous_plan.e_h)
        window = self._window(self._path[late:n])
        fastest = min(np.abs(np.diff(signal)).max() for signal in (window.x_d, window.x_pb))
        return not fastest <= factor * self._model.learned.fastest

    def speed(self, change: Array) -> float:
        """Return the velocity, RMS, of a change of the commands, ``(n,)``, m, relative to the scale; 0 without one."""
        moved, scale = first_differences(change), self.scales.velocity * self._discrete.T_s
        return math.sqrt(float(moved @ moved) / len(moved)) / scale if scale > 0.0 else 0.0

    def predict(self, x_d: Array) -> AveragedForecast:
        """Predict the plan, and what is late before it, under commands ``x_d``, ``(n,)``, m."""
        return self._model.forecast_by(self._solved, self._window(x_d), self.scales, self.of_previous_plan)

    def position(self, at: AveragedForecast) -> Array:
        """Return ``x_h`` of :meth:`predict` over the plan, ``(n,)``, m."""
        return (at.window.x_pb + at.e_h)[len(self._late) :]

    def slope(self, at: AveragedForecast, changes: Array, passed: Array, reach: float) -> Array:
        """Return the change of ``x_h`` with changes of the commands, ``(n, m)``, once something is learned.

        ``at``: of :meth:`predict`, where the model is linearised; ``changes``: (n, m): changes of the commands, each
        a column; ``passed``: (n, m): the changes filtered by ``G_pb``; ``reach``: half of the change of velocity that
        the friction's slope is taken over, relative to the velocity scale.
        """
        n_late, weights = len(self._late), at.shares.tolist()
        over_all = slopes_of(self._static, self._model.run.static, at.window, at.x, self.scales.velocity, reach)
        slopes = over_all.after(n_late)
        total: Array = passed.copy()
        for expert, one in self._solved.items():
            weight = weights[expert.place]
            recalled = weights[RECALL.place] * at.moves if expert is ARX_COMMAND else 0.0
            if weight + recalled == 0.0:
                continue
            prediction = at.predictions[expert]
            left = prediction.shrinkage.copy()  # what shrinking and bounds leave of it
            np.divide(prediction.e_h, prediction.unshrunk, out=left, where=prediction.unshrunk != 0.0)
            shrinkage = weight * left[n_late:, None]
            if expert.like(self._model).target == COMMAND_RESIDUAL:
                # As late as the command's expert takes them
                acted = np.pad(changes, ((self._static.command.dead_time, 0), (0, 0)))[: len(changes)]
                drive = lfilter(one.solution.weights[1 : one.n_static], [1.0], first_differences(acted), axis=0)
                total += (shrinkage + recalled) * _recur(one, drive) + (weight + recalled) * (acted - passed)
            else:
                total += shrinkage * self._of_disturbances(one, slopes, changes, passed)
        return total

    def _of_disturbances(self, solved: SolvedExpert, slopes: DisturbanceSlopes, changes: Array, passed: Array) -> Array:
        """Return the change of the physics model's residual by an expert with static features, ``(n, m)``."""
        discrete = self._discrete
        velocity = first_differences(changes) / discrete.T_s
        moved = first_differences(passed) / discrete.T_s
        static, weights = self._static, solved.solution.weights[1 : solved.n_static]
        linear, spans, own, differences = np.split(
            weights, np.cumsum([1 + static.n_differences, N_SPANS, static.n_disturbances])
        )
        disturbance = slopes.change(own, velocity, passed, moved)
        disturbance += first_differences(slopes.change(differences, velocity, passed, moved))
        drive, _ = discrete.forced_response(discrete.rest(changes.shape[1]), disturbance)
        difference = passed
        for weight in linear:
            drive = drive + weight * difference
            difference = first_differences(difference)
        commands = np.pad(changes, ((static.command.n_before, 0), (0, 0)))
        for weight, change in zip(spans, static.command.changes(commands, len(changes)), strict=True):
            drive = drive + weight * change
        return _recur(solved, drive)


def _recur(solved: SolvedExpert, drive: Array) -> Array:
    """Return the free run ``e(k) = drive(k) + Σ_i w_e,i e(k−i)`` from rest, ``(n, m)``."""
    if not len(solved.lag_weights):
        return drive
    return np.asarray(lfilter([1.0], np.concatenate(([1.0], -solved.lag_weights)), drive, axis=0))


def slopes_of(
    static: StaticFeatures, state: StaticState, window: ResidualWindow, x: Array, velocity_scale: float, reach: float
) -> DisturbanceSlopes:
    """Return the slopes of the disturbances of a window; other parameters as of :meth:`StaticFeatures.rows`.

    ``reach``: half of the change of velocity that the friction's slope is taken over, relative to the velocity scale;
    0: the tangent.
    """
    x_d, x_pb, start, _ = window
    v_d, spread = static.velocity(state, x_d), static.spread(velocity_scale)
    v, half = v_d[:, None], reach * velocity_scale
    # tanh a − tanh b = tanh(a − b)·(1 − tanh a·tanh b), which cancels nothing where a and b are close
    friction = 1.0 - np.tanh((v + half) / spread) * np.tanh((v - half) / spread)
    friction *= np.tanh(2.0 * half / spread) / (2.0 * half) if half > 0.0 else 1.0 / spread
    of_position = []
    if static.period > 0.0:
        angle, turns = static.angle(start + x), 2.0 * np.pi / static.period
        of_position += [(turns * np.cos(angle))[:, None], (-turns * np.sin(angle))[:, None]]
    of_velocity = np.empty((len(x), 0))
    if static.own:
        step, half = velocity_scale * static.discrete.T_s, max(half, _OWN_REACH * velocity_scale)
        of_position.append(
            (static.own_at(start + (x + step), v_d) - static.own_at(start + (x - step), v_d)) / (2.0 * step)
        )
        of_velocity = (static.own_at(start + x, v_d + half) - static.own_at(start + x, v_d - half)) / (2.0 * half)
    damping = 2.0 * np.abs(static.damped_velocity(state, x_pb, x))
    return DisturbanceSlopes(
        friction, 2.0 * np.abs(x), damping, np.hstack([np.empty((len(x), 0)), *of_position]), of_velocity
    )


TOLERANCE = Tolerance(1e-4, 1e-2, 1e-5, 5, 100.0)
"""Of the solver, for the physics model's plan and each Newton step. With a margin as small as rounding an end that
exceeds a bound by a millionth would be no plan; from a larger complementarity five steps end farther inside the bounds:
from that of ``EXACT`` a plan within limits that its command just keeps may change nothing, window after window."""

FIRST_REACH, _LEAST_REACH, _REACH, _WIDER, _MOST_REACH = 0.1, 0.03, 0.5, 2.0, 1.0
"""Half of the change of velocity that friction's slope is taken over: relative to the model's velocity scale, in the
first step of a run and at least; and relative to what the last step has changed of the velocity, or would have (RMS). A
slope over less is blind to a sign that changes nearby, one over more sees signs that stay. Where no length of a step
lowers the cost the next one looks farther by a factor, up to the most: otherwise it would be the same step."""

TWICE, THRICE = 15, 5
"""Samples that a plan has from which on it makes two Newton steps, and windows in a plan below which it makes three: a
sample is planned in that many. In long windows one step leaves up to fifteen times the error of two."""

PHYSICS_STEPS = 3  # of the solver, for the physics model's plan that Newton steps are compared with

_LENGTHS = (1.0, 0.3)  # lengths of a step that are tried, relative to the way to the minimum

_LEAST_GAIN = 1e-9
"""Relative gain below which a plan is no better than another: costs that rounding tells apart are equal."""


def is_better(cost: float, other: float) -> bool:
    """Return whether a plan costs less, m², than another; not if it is NaN."""
    return cost < (1.0 - _LEAST_GAIN) * other


@dataclass(frozen=True)
class PlannedPoint:
    """Plan with what the model predicts under it."""

    coefficients: Array  # (3 + n_free,), m
    prediction: AveragedForecast  # under the plan, of the residual
    x_h: Array  # (horizon,), m, relative to the start
    third: Array  # (horizon,), m, third differences of δ
    cost: float  # m²


@dataclass(frozen=True)
class NewtonSearch:
    """Plans of one window on the averaged model."""

    basis: SplineBasis
    splines: Array  # (n_free, m): those that are solved for, as sums of the free ones (``splines.solved_splines``)
    jerk_weight: float  # as of :class:`~hybridsep.base.settings.CompensatorSettings`
    model: PlanModel  # of the plan that the window begins
    x_d: Array  # (horizon,), m: commanded positions, relative to the start
    delta_before: Array  # (3,), m: last three values of δ

    def point(self, coefficients: Array, prediction: AveragedForecast | None = None) -> PlannedPoint:
        """Return a plan, whose prediction may be known, with its cost, which is not finite if that overflows."""
        at = prediction or self.model.predict(self.x_d + self.basis.values @ coefficients)
        before = np.diff(np.concatenate((self.delta_before, np.zeros(self.basis.horizon))), 3)
        third = self.basis.third @ coefficients + before
        x_h = self.model.position(at)
        error = self.basis.weight * (self.x_d - x_h)
        cost = float(error @ error) + self.jerk_weight * float(third @ third)
        return PlannedPoint(coefficients, at, x_h, third, cost)

    def step(self, start: PlannedPoint, bounds: Bounds, passed: Array, reach: float) -> tuple[PlannedPoint, float]:
        """Return the plan after a Newton step, the start itself if none is better, and the reach of the next step.

        ``start``: where the model is linearised; ``bounds``: on coefficients; ``passed``: (horizon, n_free): free
        splines filtered by ``G_pb``; ``reach``: of friction's slope, as of :meth:`PlanModel.slope`.
        """
        values, third = (one[:, N_DECIDED:] @ self.splines for one in (self.basis.values, self.basis.third))
        slope = self.model.slope(start.prediction, values, passed @ self.splines, reach)
        W = self.basis.weight[:, None] * slope
        P = W.T @ W + self.jerk_weight * (third.T @ third)
        v = W.T @ (self.basis.weight * (self.x_d - start.x_h)) - self.jerk_weight * (third.T @ start.third)
        found = solve_change(PlanCost(P, v).regular(), bounds, start.coefficients, self.splines, 0, TOLERANCE)
        if found is None:
            return start, reach
        change = found - start.coefficients
        next_reach = max(_LEAST_REACH, _REACH * self.model.speed(self.basis.values @ change))
        for length in _LENGTHS:
            end = self.point(start.coefficients + length * change)
            if is_better(end.cost, start.cost):
                return end, next_reach
        return start, max(next_reach, min(_WIDER * reach, _MOST_REACH))
