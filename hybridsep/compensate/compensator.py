"""Servo error pre-compensation (SEP) on the predictor's lifted model.

Over a preview the predicted position is affine in the command, ``x_h = G_h x_dm + free`` (eq. (3)), so the
modified command ``x_dm = x_d + δ`` that makes ``x_h`` follow ``x_d`` is a least-squares problem. ``δ`` is a sum of
cubic B-splines, each filtered through the current model (the filtered-basis-functions method: Ramani, Duan, Okwudire
and Ulsoy, J. Dyn. Sys. Meas. Control 139 (2017)), with limited preview (receding horizon): of a plan over ``preview``
samples only the splines that begin in the first window are applied, then the next plan follows from new measurements.

Position, velocity and acceleration of ``δ`` are continuous by construction, also between windows and between models.
Every spline ends within its plan, so a plan returns to ``x_d`` and its remainder keeps the limits. The next plan starts
from that remainder: there is always a feasible plan, and where no other can be computed the remainder is followed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import SignalError
from ..base.settings import CompensatorSettings, PredictorSettings
from ..base.signals import Array, as_published, as_samples
from ..predict.predictor import HybridPredictor
from ..predict.trust.disturbances import Disturbance
from ..predict.trust.model import TrustedModel
from ..predict.window import PublishedWindow
from .constraints import Bounds, DriveBounds, solve
from .interior import EXACT
from .linearised import PlanModel
from .plan import PendingPlan, SepState
from .plan_monitor import PlanMonitor, has_stable_poles
from .saved_compensator import compensator_blob, compensator_from
from .sensor import SensorWatch
from .splines import N_DECIDED, SplineBasis, direct_samples
from .trusted_plan import TOLERANCE, TrustedPlanner, is_better

__all__ = ["RECOMMENDED", "SepCompensator", "SepState", "direct_samples"]

_PINNED, _PINNED_WITH_TRUST = 8, 20
"""Leading samples of a window in which a bounded plan follows the last one: real-time solvers take 3 steps in each.
With trust every plan does, as it takes more work."""

RECOMMENDED = PredictorSettings(trust=False, Np=50, p=50, q=40, lam=1e-8, t_init=0.1, v_friction=2e-3)
"""Predictor settings of the paper's model with the smallest tracking error on the staircase drive, with the
compensator's defaults."""


class SepCompensator:
    """Receding-horizon compensator that keeps learning in closed loop.

    For each window, call :meth:`plan` with the commanded positions ahead, send its ``x_dm`` to the drive, then call
    :meth:`update` with the measured positions.

    Parameters
    ----------
    predictor : HybridPredictor
        At the beginning of a run; it learns from the modified commands. With ``trust`` plans follow the slope of its
        model (:mod:`~hybridsep.compensate.trusted_plan`); else they use the paper's, where :class:`PlanMonitor` allows.
    settings : CompensatorSettings, optional
        The defaults if left out.

    Raises
    ------
    ParameterError
        If ``preview`` or ``spacing`` does not fit the predictor's ``Np``, or the predictor has a ``measurement_delay``
        without trust.
    """

    def __init__(self, predictor: HybridPredictor, settings: CompensatorSettings | None = None) -> None:
        Np = predictor.Np
        predictor.settings.check_planning()
        self.predictor = predictor
        self.settings = settings = (settings or CompensatorSettings()).for_window(Np)
        assert settings.preview is not None
        assert settings.spacing is not None
        self.preview, self.spacing = settings.preview, settings.spacing
        self.compensate = SepState[settings.compensate.upper()]
        self._basis = SplineBasis(self.preview, self.spacing)
        n_pinned = _PINNED if self._trusted is None else _PINNED_WITH_TRUST
        self._n_pinned = min(n_pinned, Np // 2) // self.spacing
        self._bounds = DriveBounds(
            self._basis, predictor.T_s, settings.limits, settings.change_max, no_reversal=settings.no_reversal
        )
        self._monitor = PlanMonitor()
        if self._trusted is not None:
            self._trusted.plan_ahead(self.preview)
        self.restart(predictor.start, t_init=predictor.settings.warm_up)

    @property
    def _trusted(self) -> TrustedModel | None:
        residual = self.predictor.residual
        return residual if isinstance(residual, TrustedModel) else None

    def restart(self, start: float | None = None, *, t_init: float = 0.0, lead_in: int = 0) -> None:
        """Begin another run, at rest at ``start``; what was learned is kept (warm start).

        Parameters
        ----------
        start : float, optional
            Initial position, m; the first command if left out.
        t_init : float
            Warm-up, s, from the end of the lead-in, in which the physics model is used.
        lead_in : int
            Samples at rest before the trajectory, not learned.
        """
        predictor = self.predictor
        predictor.restart(start, t_init=t_init + lead_in * predictor.T_s if t_init > 0 else 0.0)
        self.lead_in = int(lead_in)
        self._monitor.restart()
        self._sensor = SensorWatch()
        self._measured_before = True
        self._state_before = min(self.compensate, SepState.PHYSICS)
        # Coefficients of the remainder of the last plan; last three values of δ and of x_d
        self._rest = np.zeros(N_DECIDED + self._basis.n_free)
        self._delta_before = np.zeros(3)
        self._x_d_before = np.full(3, np.nan)
        self._pending: PendingPlan | None = None

    def plan(self, x_d: ArrayLike) -> PublishedWindow:
        """Plan the next window.

        May be called again, with other commands, before :meth:`update`; the last call counts.

        Parameters
        ----------
        x_d : (preview,) array_like, m
            Commanded positions of the preview.

        Returns
        -------
        PublishedWindow

        Raises
        ------
        SignalError
            If ``x_d`` has another length or is not finite, or the window's prediction diverges.
        """
        command = as_samples(x_d, "x_d", self.preview)
        predictor, Np = self.predictor, self.predictor.Np
        if predictor.start is None:  # at rest where the first command is
            predictor.start = float(command[0])
        if np.isnan(self._x_d_before[0]):
            self._x_d_before[:] = predictor.start
        trusted = self._trusted
        model = None if trusted is None else self._plan_model(trusted, command - predictor.start)
        state, coefficients = (
            self._best_plan(command) if model is None else self._trusted_plan(command, command - predictor.start, model)
        )
        delta = (self._basis.values @ coefficients)[:Np]
        x_dm = command[:Np] + delta
        prediction = predictor.predict(x_dm, reference=command, scales=None if model is None else model.scales)
        self._pending = PendingPlan(coefficients, delta, command[:Np].copy(), prediction, state)
        return self._published(x_dm, self._pending)

    def _published(self, x_dm: Array, plan: PendingPlan) -> PublishedWindow:
        """Return what is published of a plan; SignalError if its prediction diverges.

        The paper's model is published where it planned. With trust it is published wherever it may plan: it vouches for
        itself, and what planned the window is not known before its first samples have acted.
        """
        Np, prediction, trusted = self.predictor.Np, plan.prediction, self._trusted is not None
        as_published(prediction.x_pb, "x_pb")
        x_h, x_h_std, n_warm_up = prediction.x_pb.copy(), np.zeros(Np), Np
        if trusted and self.compensate is SepState.HYBRID:
            x_h, x_h_std, n_warm_up = prediction.x_h, prediction.x_h_std, prediction.n_warm_up
        elif plan.state is SepState.HYBRID:
            x_h, x_h_std, n_warm_up = as_published(x_h + prediction.e_h, "x_h"), prediction.x_h_std, 0
        n_followed = self._n_pinned * self.spacing if trusted else 0
        return PublishedWindow(
            plan.x_d, x_dm, prediction.x_pb, x_h, x_h_std, plan.state, n_warm_up, n_followed, self._state_before
        )

    def update(self, x: ArrayLike) -> None:
        """Learn from the measurement of the planned window.

        A window with missing samples (NaN, or a value held while the drive moves) is not learned: its residuals are
        replaced by their predictions, and learning resumes after a completely measured window. With ``trust`` the
        predictor itself leaves out what is missing or not plausible.

        Parameters
        ----------
        x : (Np,) array_like, m
            Measured positions; NaN where missing.

        Raises
        ------
        SignalError
            If nothing is planned, the length is another one or a value is infinite. Nothing is changed.
        """
        pending = self._pending
        if pending is None:
            raise SignalError("update must follow plan: there is no planned window to measure")
        predictor, Np = self.predictor, self.predictor.Np
        measured = np.asarray(x, dtype=np.float64)
        as_samples(np.nan_to_num(measured, nan=0.0, posinf=np.inf, neginf=-np.inf), "x", Np)
        if self._trusted is None:
            self._update_paper(measured, pending)
        else:
            predictor.update(measured, learn=predictor.k >= self.lead_in)
        kept = Np // self.spacing
        self._rest = np.concatenate((pending.coefficients[kept:], np.zeros(kept)))
        self._delta_before, self._x_d_before = (
            _last_three(self._delta_before, pending.delta),
            _last_three(self._x_d_before, pending.x_d),
        )
        self._state_before = pending.state
        self._pending = None

    def _update_paper(self, measured: Array, pending: PendingPlan) -> None:
        """Learn from the measurement of the planned window with the paper's model."""
        predictor = self.predictor
        x_pb, e_h = pending.prediction.x_pb, pending.prediction.e_h
        missing = self._sensor.misses(measured, x_pb)
        if missing:
            own = x_pb + e_h if pending.state is SepState.HYBRID else x_pb
            predictor.update(own, learn=False)
        else:
            # After a gap, the lags of the first window are still predictions.
            learn = self._measured_before and predictor.k >= self.lead_in
            # Predictions from few rows, before the warm-up is over, are not used: they are not judged.
            judge = learn and predictor.k >= predictor.n_init
            predictor.update(measured, learn=learn)
            if judge:
                regression = predictor.regression
                self._monitor.observe(measured - x_pb, e_h, regression.residual_sum / regression.n_samples)
        self._measured_before = not missing

    @property
    def is_planned(self) -> bool:
        """Whether a planned window is pending measurement."""
        return self._pending is not None

    def _best_plan(self, command: Array) -> tuple[SepState, Array]:
        """Return the model and the coefficients of the best available plan, the decided ones first."""
        rest = self._rest
        candidates = self._candidates()
        if not candidates:
            return SepState.OFF, rest
        bounds = self._bounds.bounds(command, self._x_d_before, self._delta_before, rest)
        with np.errstate(all="ignore"):  # a hybrid model that is no candidate may be unstable
            operator = self.predictor.operator(self.preview, reference=command)  # Eq. (3)
        for state in candidates:
            hybrid = state is SepState.HYBRID
            g, free = (operator.g_h, operator.free) if hybrid else (operator.g_pb, operator.free_pb)
            found = self._affine_plan(g, free, command, bounds)
            if found is not None:
                return state, found
        return SepState.OFF, rest

    def _affine_plan(self, g: Array, free: Array, command: Array, bounds: Bounds) -> Array | None:
        """Return the coefficients of the best plan on a model ``g``, ``free`` of eq. (3); None if there is none."""
        rest = self._rest
        if not (np.isfinite(g).all() and np.isfinite(free).all()):
            return None
        cost = self._basis.cost(g, free, command, rest[:N_DECIDED], self._delta_before, self.settings.jerk_weight)
        trusted = self._trusted is not None
        tolerance = TOLERANCE if trusted else EXACT
        found = solve(cost, bounds, rest[N_DECIDED:], self._n_pinned, always=trusted, tolerance=tolerance)
        return None if found is None else np.concatenate((rest[:N_DECIDED], found.x))

    def _plan_model(self, trusted: TrustedModel, path: Array) -> PlanModel:
        """Return the trusted model over the preview, with the scales of the rest of the last plan."""
        assert self.predictor.start is not None
        trusted.static.origin = self.predictor.start
        with np.errstate(all="ignore"):  # a prediction that is no candidate may overflow
            return PlanModel(
                trusted, self.predictor.state, self.predictor.late, path + self._basis.values @ self._rest, path
            )

    def _trusted_plan(self, command: Array, path: Array, model: PlanModel) -> tuple[SepState, Array]:
        """Return the model and the coefficients of the best plan, with trust: the physics model's, or a better one."""
        predictor, rest = self.predictor, self._rest
        if self.compensate is SepState.OFF:
            return SepState.OFF, rest
        before = command, self._x_d_before, self._delta_before, rest
        g, free = predictor.physics_operator(self.preview)
        physics = self._affine_plan(g, free, command, self._bounds.bounds(*before))
        if physics is None:
            return SepState.OFF, rest
        if not (self.compensate is SepState.HYBRID and predictor.k >= predictor.n_init and model.has_learned):
            return SepState.PHYSICS, physics
        with np.errstate(all="ignore"):
            planner = TrustedPlanner(self._basis, self.settings.jerk_weight, model, path, self._delta_before)
            bounds = self._bounds.bounds(*before, may_turn=True)
            hybrid, cost = planner.plan(rest, bounds, self._n_pinned, self._basis.filtered(g))
            better = is_better(cost, planner.cost(physics))
        return (SepState.HYBRID, hybrid) if better else (SepState.PHYSICS, physics)

    def _candidates(self) -> list[SepState]:
        """Return the candidate models, best first."""
        predictor = self.predictor
        hybrid = (
            self.compensate is SepState.HYBRID
            and predictor.k >= predictor.n_init
            and predictor.regression.n_samples > 0
            and self._monitor.hybrid
            and has_stable_poles(predictor.residual_weights)
        )
        candidates = [SepState.HYBRID] if hybrid else []
        return candidates + ([SepState.PHYSICS] if self.compensate is not SepState.OFF else [])

    def to_bytes(self) -> bytes:
        """Return parameters and state, predictor and pending window included, as a versioned blob."""
        return compensator_blob(self)

    @classmethod
    def from_bytes(cls, blob: bytes, disturbances: Sequence[Disturbance] = ()) -> SepCompensator:
        """Return the compensator of :meth:`to_bytes`, given the ``disturbances`` of its predictor.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version, or the number of disturbances differs.
        """
        return compensator_from(cls, blob, disturbances)


def _last_three(before: Array, window: Array) -> Array:
    return np.concatenate((before, window))[-3:]
