"""Planning: how the plan of a window is chosen and published, with the paper's model and with the averaged one.

With the paper's model a plan is on eq. (3), and on the physics model where the paper's has none. The averaged one, as
soon as it has learned, judges all plans: its own, the physics model's, and the remainder of the last plan; by experts
that are weighed by their errors in the window and half a plan ahead, as who is right for 20 ms may not be so later.
Where compensation is switched off, or has tripped, a plan ends it.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..base.settings import CompensatorSettings
from ..base.signals import Array, as_published
from ..online.look_ahead import SepState
from ..predict.averaging.experts import EXPERTS
from ..predict.averaging.model import AveragedModel
from ..predict.predictor import HybridPredictor
from ..predict.window import FeatureScales, Prediction
from .limits import Bounds, DriveBounds
from .newton import FIRST_REACH, PHYSICS_STEPS, THRICE, TOLERANCE, TWICE, NewtonSearch, PlanModel, is_better
from .qp import EXACT, Tolerance, solve_change
from .splines import N_DECIDED, SplineBasis, solved_splines

_ENDS, _NEW = 5.0, 1e9
"""Periods in a plan of the change whose jerk weighs as much as the change itself in a plan that ends compensation; and
the factor of what it may be after the last plan, so that it is nothing there and ends as soon as the remainder."""


@dataclass(frozen=True)
class PendingPlan:
    """Planned window pending measurement."""

    coefficients: Array  # (3 + n_free,), m: coefficients of the splines, the decided ones first
    # (Np,), m: change of the command, and commanded position
    delta: Array
    x_d: Array
    stop: Array  # (n,), m: coefficients of its stop, where the plan is longer than the preview
    state: SepState  # model of the plan
    share: float  # of the residual model's change of the last plan that is taken, but for what it doubts
    correction: Array  # (3 + n_free,), m: what is taken, before a stop shortens the plan; 0 of any other plan
    reach: float  # of friction's slope in the next Newton step


@dataclass(frozen=True)
class PlanTask:
    """Commands to plan, and what the plan goes on from."""

    # (horizon,), m: commanded positions, and what the drive's load adds to the command of its model
    command: Array
    load: Array
    # (3,), m: last commanded positions before, and last changes of them
    x_d_before: Array
    delta_before: Array
    previous_plan: Array  # (3 + n_free,), m: coefficients of the remainder of the last plan, the decided ones first
    state_before: SepState  # model of the last plan


class ChosenPlan(NamedTuple):
    """Plan of a window."""

    state: SepState  # model that planned it, or what is left of it
    coefficients: Array  # (3 + n_free,), m
    scales: FeatureScales | None  # of the residual model's features
    share: float | None = None  # as :class:`PendingPlan` has it, if the residual model planned
    reach: float | None = None  # likewise, if a Newton step was made


class PublishedPosition(NamedTuple):
    """``x_h``, ``x_h_std``, ``(Np,)``, m; leading samples: in the warm-up (``x_h = x_pb``); following the last plan."""

    x_h: Array
    x_h_std: Array
    n_warm_up: int
    n_followed: int


class Planning(ABC):
    """Plans with a residual model."""

    PINNED: ClassVar[int]  # leading samples of a window in which a bounded plan, or any change of the last, follows it
    SOLVED: ClassVar[Tolerance]  # to which programmes are solved
    # shape (n_ahead, n_experts, Np), in m: entry i is what is stacked for the i-th window from this one, by the plan of
    # half a plan before it, the last one by this window's; NaN where nothing is known; with the paper's model none
    ahead: Array
    share: float  # of the last plan
    corrected: Array  # (3 + n_free,), m: ``correction`` of the last plan, by the splines of the next one

    def __init__(self, basis: SplineBasis, bounds: DriveBounds, settings: CompensatorSettings, Np: int) -> None:
        self.basis, self.bounds, self.settings, self.Np = basis, bounds, settings, Np
        self.horizon, self.spacing = basis.horizon, basis.spacing
        self.n_pinned = min(self.PINNED, Np // 2) // self.spacing
        self.weight: Array | None = None  # (horizon,): of the errors of a plan; without it all count alike
        self.splines = np.eye(basis.n_free)  # (n_free, m): that a plan changes the last one by

    def restart(self) -> None:
        """Begin another run: nothing was planned."""
        self.ahead = np.empty((0, 0, self.Np))
        self.share, self.corrected = 1.0, np.zeros(N_DECIDED + self.basis.n_free)
        self.reach = FIRST_REACH

    def follow(self, plan: PendingPlan) -> None:
        """Count a window that followed its plan."""
        kept = self.Np // self.spacing
        self.share, self.corrected = plan.share, np.concatenate((plan.correction[kept:], np.zeros(kept)))
        self.reach = plan.reach
        self.ahead = np.concatenate((self.ahead[1:], np.full_like(self.ahead[:1], np.nan)))

    @property
    def due(self) -> Array | None:
        """What the plan of half its length ago stacked for this window, ``(n_experts, Np)``, in m; None without any."""
        return self.ahead[0] if len(self.ahead) else None

    @abstractmethod
    def choose(self, predictor: HybridPredictor, task: PlanTask, most: SepState) -> ChosenPlan:
        """Return the best available plan on a model up to ``most``."""

    @abstractmethod
    def published(self, prediction: Prediction, state: SepState) -> PublishedPosition:
        """Return what is published of a prediction, the plan being of a model ``state``.

        Raises SignalError if it diverges.
        """

    def affine_plan(
        self,
        g: Array,
        free: Array,
        x_d: Array,
        task: PlanTask,
        bounds: Bounds,
        n_pinned: int = 0,
        tolerance: Tolerance = EXACT,
    ) -> Array | None:
        """Return the coefficients of the best plan on a model ``g``, ``free`` of eq. (3); None if there is none.

        ``x_d``, ``(horizon,)``, m, counts from where ``free`` does; ``n_pinned``: splines that a bounded plan does not
        change.
        """
        if not (np.isfinite(g).all() and np.isfinite(free).all()):
            return None
        last, before, jerk_weight = task.previous_plan, task.delta_before, self.settings.jerk_weight
        free = free + np.asarray(lfilter(g, [1.0], task.load))
        cost = self.basis.cost(g, free, x_d, last, before, jerk_weight, self.weight).by(self.splines).regular()
        return solve_change(cost, bounds, last, self.splines, n_pinned, tolerance)

    def ending(self, task: PlanTask) -> Array:
        """Return the coefficients, ``(3 + n_free,)``, m, of a plan that ends compensation, smoothly and soon.

        It has the least change of the command that its jerk and the drive's limits allow, and ends where the last plan
        does. Where there is none, or the last plan was one, the remainder of that goes on.
        """
        if task.state_before is SepState.OFF:
            return task.previous_plan
        last = task.previous_plan
        at_once, nothing = np.eye(1, self.horizon)[0], np.zeros(self.horizon)
        jerk_weight = (2.0 * math.sin(math.pi * _ENDS / self.horizon)) ** -6.0
        not_pinned = np.eye(self.basis.n_free)[:, self.n_pinned :]
        cost = self.basis.cost(at_once, nothing, nothing, last, task.delta_before, jerk_weight)
        cost = cost.by(not_pinned).regular()
        new = np.arange(len(cost.v))[-(self.Np // self.spacing) :]
        cost.P[new, new] *= _NEW
        found = solve_change(cost, self.limits(task), last, not_pinned, 0, self.SOLVED)
        return last if found is None else found

    def limits(self, task: PlanTask, *, turns: int = 0, change: float = 1.0) -> Bounds:
        """Return the drive's limits on the coefficients of a plan, and a share of the largest change."""
        before = task.x_d_before, task.delta_before, task.previous_plan
        return self.bounds.bounds(task.command, *before, turns=turns, change=change)


_PINNED_PAPER = 8
"""Leading samples of a window in which a bounded plan follows the last one: real-time solvers take 3 steps in each."""


class PaperPlanning(Planning):
    """Plans with the paper's model."""

    PINNED: ClassVar[int] = _PINNED_PAPER
    SOLVED: ClassVar[Tolerance] = EXACT

    def choose(self, predictor: HybridPredictor, task: PlanTask, most: SepState) -> ChosenPlan:
        """Return the plan of the best model that has one, else one without a model."""
        if most is SepState.OFF:
            return ChosenPlan(SepState.OFF, self.ending(task), None)
        learned = predictor.k >= predictor.n_init and predictor.regression.n_rows > 0
        hybrid = most is SepState.HYBRID and learned and has_stable_poles(predictor.residual.lag_weights)
        bounds = self.limits(task)
        with np.errstate(all="ignore"):  # a hybrid model that is no candidate may be unstable
            operator = predictor.operator(self.horizon)  # Eq. (3)
        models = [(SepState.HYBRID, operator.g_h, operator.free), (SepState.PHYSICS, operator.g_pb, operator.free_pb)]
        for state, g, free in models if hybrid else models[1:]:
            found = self.affine_plan(g, free, task.command, task, bounds, self.n_pinned)
            if found is not None:
                return ChosenPlan(state, found, None)
        return ChosenPlan(SepState.OFF, task.previous_plan, None)

    def published(self, prediction: Prediction, state: SepState) -> PublishedPosition:
        """Return the model's position where it planned, else the physics model's."""
        x_h, Np = prediction.x_pb.copy(), len(prediction.x_pb)
        if state is SepState.HYBRID:
            return PublishedPosition(as_published(x_h + prediction.e_h, "x_h"), prediction.x_h_std, 0, 0)
        return PublishedPosition(x_h, np.zeros(Np), Np, 0)


def has_stable_poles(w_e: Array) -> bool:
    """Return whether all roots of ``z^p − w_e,1 z^(p−1) − … − w_e,p`` are inside the unit circle.

    Schur-Cohn stability test by step-down recursion (E. I. Jury, *Theory and Application of the z-Transform Method*,
    Wiley 1964; the inverse of the Levinson recursion): ``p²/2`` multiplications and no eigenvalues. Each step takes the
    polynomial to one of a degree less; all roots are inside if and only if every reflection coefficient is below 1 in
    magnitude. Without the test, plans on the stage's Y axis, cold and free to turn, end at 2.8 times the error of the
    physics model's plans instead of 0.8 times.

    ``w_e``: (p,): weights of the past residuals.
    """
    a = -np.asarray(w_e, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        for m in range(len(a) - 1, -1, -1):
            reflection = float(a[m])
            if not abs(reflection) < 1.0:  # NaN too
                return False
            # a_i ← (a_i − κ a_(m−i)) / (1 − κ²)
            a = (a[:m] - reflection * a[:m][::-1]) / ((1.0 - reflection) * (1.0 + reflection))
    return True


FASTER, _UNPROVEN = 1.25, 0.5
"""Speed of the preview, relative to the fastest motion that was learned, above which plans may change the command by
this share of ``change_max`` only, which is the largest error without compensation: a model that was not compared with
such a motion and asks for more is wrong. The physics model's plan may take all where earlier runs' weights judge it."""

_TAKEN_BACK, _LEAST_SHARE, _NEAR = 0.2, 0.7, 4
"""A plan takes a share of its change of the last one, which grows or falls by the first times the cosine between what
it changes and what the last plan has changed, up to 1 and down to the second, over this many windows. Where a drive is
too slow, or the model wrong at a frequency, plans take back what the last one corrected, and the command swings."""

_DOUBT = 0.1
"""Of a change that gains ``g``, m², on the cost of the last plan ``g/(g + d)`` is taken, too, where ``d`` is this share
of the variances of what is predicted over the plan, weighted as its errors. At rest, before sliding, a model from
motion predicts errors as small as its noise, and moved the drive for them."""

_STRAIGHT = 10  # parts of a plan of few windows, in the last of which its way back to the path may not turn friction

_PINNED_AVERAGED = 24
"""Leading samples of a window in which every plan follows the last one, as it takes more work than one on the paper's
model."""


class AveragedPlanning(Planning):
    """Plans with the averaged model, which watches itself."""

    PINNED: ClassVar[int] = _PINNED_AVERAGED
    SOLVED: ClassVar[Tolerance] = TOLERANCE

    def __init__(self, basis: SplineBasis, bounds: DriveBounds, settings: CompensatorSettings, Np: int) -> None:
        super().__init__(basis, bounds, settings, Np)
        self.weight = basis.weight
        self.n_steps = 1 if self.n_pinned * self.spacing < TWICE else 2 if THRICE * Np <= self.horizon else 3
        self.n_turning = self.horizon - (self.horizon // _STRAIGHT if self.n_steps > 2 else 0)
        # A plan that has faded as it had no stop may exceed limits where wide splines cannot leave it
        n = basis.n_free - self.n_pinned
        free = solved_splines(n, Np // self.spacing if self.horizon == settings.preview else n)
        self.splines = np.concatenate((np.zeros((self.n_pinned, free.shape[1])), free))

    def restart(self) -> None:
        """Begin another run: nothing was planned."""
        super().restart()
        self.ahead = np.full((max(1, self.horizon // (2 * self.Np)), len(EXPERTS), self.Np), np.nan)

    def choose(self, predictor: HybridPredictor, task: PlanTask, most: SepState) -> ChosenPlan:
        """Return the allowed plan that the averaged model judges best; before it has learned, the physics model's."""
        averaged, state, previous_plan = predictor.residual, predictor.state, task.previous_plan
        assert isinstance(averaged, AveragedModel)
        assert predictor.start is not None
        path = task.command - predictor.start
        with np.errstate(all="ignore"):  # a prediction that is no candidate may overflow
            x_d = path + self.basis.values @ previous_plan
            model = PlanModel(averaged.for_plans(), state.physics, state.late, predictor.start, x_d, path, task.load)
        scales = model.scales  # of the remainder of the last plan
        self.ahead[-1] = np.nan
        if most is SepState.OFF:
            return ChosenPlan(SepState.OFF, self.ending(task), scales)
        g, free = predictor.physics_operator(self.horizon)
        change = _UNPROVEN if model.outgrows(FASTER) else 1.0
        of_physics_change = 1.0 if averaged.doubts else change
        has_learned = predictor.k >= predictor.n_init and model.has_learned
        follows = has_learned and most is SepState.HYBRID
        tolerance = TOLERANCE._replace(steps=PHYSICS_STEPS) if follows else TOLERANCE
        # relative to the start, as in C: at rest the target is 0, not rounding that a model without a scale would learn
        bounds = self.limits(task, turns=self.horizon if most is SepState.PHYSICS else 0, change=of_physics_change)
        physics = self.affine_plan(g, free, path, task, bounds, tolerance=tolerance)
        if has_learned:
            end = len(self.ahead) * self.Np
            self.ahead[-1] = model.of_previous_plan.stacked[:, end - self.Np : end]
        if physics is None:
            return ChosenPlan(task.state_before, previous_plan, scales)
        if not has_learned:
            return ChosenPlan(SepState.PHYSICS, physics, scales)
        with np.errstate(all="ignore"):
            jerk_weight = self.settings.jerk_weight
            search = NewtonSearch(self.basis, self.splines, jerk_weight, model, path, task.delta_before)
            last = search.point(previous_plan, prediction=model.of_previous_plan)
            of_physics, reach = search.point(physics), None
            if follows:
                hybrid, reach = last, self.reach
                for _ in range(self.n_steps):
                    before = replace(task, previous_plan=hybrid.coefficients)
                    bounds = self.limits(before, turns=self.n_turning, change=change)
                    hybrid, reach = search.step(hybrid, bounds, self.basis.filtered(g), reach)
                if is_better(hybrid.cost, of_physics.cost):
                    step, gain = hybrid.coefficients - previous_plan, last.cost - hybrid.cost
                    share = self._share_of(step)
                    doubt = float(self.basis.weight**2 @ last.prediction.variance[-self.horizon :])
                    left = 1.0 / (1.0 + _DOUBT * doubt / gain) if gain > 0.0 else 0.0
                    step *= share * left if left > 0.0 else 0.0  # not NaN
                    return ChosenPlan(SepState.HYBRID, previous_plan + step, scales, share=share, reach=reach)
            if is_better(last.cost, of_physics.cost):
                return ChosenPlan(task.state_before, last.coefficients, scales, reach=reach)
        return ChosenPlan(SepState.PHYSICS, physics, scales, reach=reach)

    def _share_of(self, change: Array) -> float:
        """Return which share of a change of the last plan, ``(3 + n_free,)``, m, is taken."""
        near = slice(N_DECIDED + self.n_pinned, N_DECIDED + _NEAR * (self.Np // self.spacing))
        now, before = change[near], self.corrected[near]
        size = math.sqrt(float(now @ now)) * math.sqrt(float(before @ before))
        cosine = float(now @ before) / size if size > 0.0 else 0.0
        return min(max(self.share * (1.0 + _TAKEN_BACK * cosine), _LEAST_SHARE), 1.0)

    def published(self, prediction: Prediction, state: SepState) -> PublishedPosition:
        """Return the model's position, whichever model planned.

        Its prediction needs no stability test, and which model planned the window is known only after its first samples
        have acted.
        """
        n_followed = self.n_pinned * self.spacing
        return PublishedPosition(prediction.x_h, prediction.x_h_std, prediction.n_warm_up, n_followed)
