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

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import ParameterError, SignalError
from ..base.saved import Saved
from ..base.settings import CompensatorSettings, PredictorSettings
from ..base.signals import Array, as_published, as_samples
from ..base.state import pack, unpack
from ..predict.predictor import HybridPredictor
from ..predict.window import Prediction, PublishedWindow
from .constraints import DriveBounds, solve
from .plan import PendingPlan, SepState
from .sensor import SensorWatch
from .splines import N_DECIDED, SplineBasis, direct_samples
from .trust import Trust, has_stable_poles

__all__ = ["RECOMMENDED", "SepCompensator", "SepState", "direct_samples"]

_KIND = "compensator"

_PINNED = 8
"""Leading samples of a window in which a bounded plan follows the last one: real-time solvers take 3 steps in each."""

RECOMMENDED = PredictorSettings(trust=False, Np=50, p=50, q=40, lam=1e-8, t_init=0.1, v_friction=2e-3)
"""Predictor settings with the smallest tracking error on the staircase drive, with the compensator's defaults."""


class SepCompensator:
    """Receding-horizon compensator that keeps learning in closed loop.

    For each window, call :meth:`plan` with the commanded positions ahead, send its ``x_dm`` to the drive, then call
    :meth:`update` with the measured positions.

    Parameters
    ----------
    predictor : HybridPredictor
        At the beginning of a run; it learns from the modified commands.
    settings : CompensatorSettings, optional
        The defaults if left out.

    Raises
    ------
    ParameterError
        If ``preview`` or ``spacing`` does not fit the predictor's ``Np``, or the predictor is one with ``trust``.
    """

    def __init__(self, predictor: HybridPredictor, settings: CompensatorSettings | None = None) -> None:
        if predictor.settings.trust:
            raise ParameterError(
                "trust must be false in a compensator's predictor: "
                "it plans with a model that is affine in the commands, which that with trust is not"
            )
        Np = predictor.Np
        self.predictor = predictor
        self.settings = settings = (settings or CompensatorSettings()).for_window(Np)
        assert settings.preview is not None
        assert settings.spacing is not None
        self.preview, self.spacing = settings.preview, settings.spacing
        self.compensate = SepState[settings.compensate.upper()]
        self._basis = SplineBasis(self.preview, self.spacing)
        self._n_pinned = min(_PINNED, Np // 2) // self.spacing
        self._bounds = DriveBounds(
            self._basis, predictor.T_s, settings.limits, settings.change_max, no_reversal=settings.no_reversal
        )
        self._trust = Trust()
        self.restart(predictor.start, t_init=predictor.settings.warm_up)

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
        self._trust.restart()
        self._sensor = SensorWatch()
        self._measured_before = True
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
        state, coefficients = self._best_plan(command)
        delta = (self._basis.values @ coefficients)[:Np]
        x_dm = command[:Np] + delta
        prediction = predictor.predict(x_dm, reference=command)
        self._pending = PendingPlan(coefficients, delta, command[:Np].copy(), prediction, state)
        as_published(prediction.x_pb, "x_pb")
        if state is SepState.HYBRID:
            x_h, n_warm_up = as_published(prediction.x_pb + prediction.e_h, "x_h"), 0
        else:
            x_h, n_warm_up = prediction.x_pb.copy(), Np
        x_h_std = prediction.x_h_std if state is SepState.HYBRID else np.zeros(Np)
        return PublishedWindow(command[:Np].copy(), x_dm, prediction.x_pb, x_h, x_h_std, state, n_warm_up)

    def update(self, x: ArrayLike) -> None:
        """Learn from the measurement of the planned window.

        A window with missing samples (NaN, or a value held while the drive moves) is not learned: its residuals are
        replaced by their predictions, and learning resumes after a completely measured window.

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
                self._trust.observe(measured - x_pb, e_h, regression.residual_sum / regression.n_samples)
        self._measured_before = not missing
        kept = Np // self.spacing
        self._rest = np.concatenate((pending.coefficients[kept:], np.zeros(kept)))
        self._delta_before, self._x_d_before = (
            _last_three(self._delta_before, pending.delta),
            _last_three(self._x_d_before, pending.x_d),
        )
        self._pending = None

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
            if not (np.isfinite(g).all() and np.isfinite(free).all()):
                continue
            cost = self._basis.cost(g, free, command, rest[:N_DECIDED], self._delta_before, self.settings.jerk_weight)
            found = solve(cost, bounds, rest[N_DECIDED:], self._n_pinned)
            if found is not None:
                return state, np.concatenate((rest[:N_DECIDED], found))
        return SepState.OFF, rest

    def _candidates(self) -> list[SepState]:
        """Return the candidate models, best first."""
        predictor = self.predictor
        hybrid = (
            self.compensate is SepState.HYBRID
            and predictor.k >= predictor.n_init
            and predictor.regression.n_samples > 0
            and self._trust.hybrid
            and has_stable_poles(predictor.residual_weights)
        )
        candidates = [SepState.HYBRID] if hybrid else []
        return candidates + ([SepState.PHYSICS] if self.compensate is not SepState.OFF else [])

    def to_bytes(self) -> bytes:
        """Return parameters and state, predictor and pending window included, as a versioned blob."""
        pending = self._pending
        meta = {
            "settings": self.settings.as_table(),
            "lead_in": self.lead_in,
            "excess": self._trust.excess,
            "measured_before": self._measured_before,
            "pending": None if pending is None else [int(pending.state), pending.prediction.n_warm_up],
        }
        arrays = {
            "rest": self._rest,
            "delta_before": self._delta_before,
            "x_d_before": self._x_d_before,
            "sensor": np.array(self._sensor.state()),
        }
        if pending is not None:
            arrays |= {"coefficients": pending.coefficients, "delta": pending.delta, "x_d": pending.x_d}
            arrays |= {name: getattr(pending.prediction, name) for name in ("x_pb", "e_h", "x_h_std")}
        return pack(_KIND, meta, arrays, {"predictor": self.predictor.to_bytes()})

    @classmethod
    def from_bytes(cls, blob: bytes) -> SepCompensator:
        """Return the compensator of :meth:`to_bytes`.

        Raises
        ------
        StateError
            If the blob is foreign, truncated or of another version.
        """
        saved = Saved(_KIND, *unpack(_KIND, blob))
        predictor = HybridPredictor.from_bytes(saved.part("predictor"))
        restored = HybridPredictor.from_bytes(saved.part("predictor"))
        with saved.consistent():
            compensator = cls(predictor, CompensatorSettings.from_table(saved.table("settings")))
        compensator.predictor = restored  # the constructor has restarted the other one
        compensator.lead_in = saved.whole("lead_in")
        compensator._trust.excess, compensator._measured_before = saved.real("excess"), saved.flag("measured_before")
        n, Np = len(compensator._rest), predictor.Np
        compensator._rest, compensator._delta_before = saved.array("rest", n), saved.array("delta_before", 3)
        compensator._x_d_before = saved.array("x_d_before", 3, finite=False)
        with saved.consistent():
            compensator._sensor.restore(saved.array("sensor", 5, finite=False))
        if saved.field("pending") is not None:
            state, n_warm_up = saved.numbers("pending", 2)
            if state not in tuple(SepState) or n_warm_up not in range(Np + 1) or restored.n_pending != Np:
                raise saved.error("the pending window must be planned and predicted")
            # A hybrid prediction that is not used may diverge.
            prediction = Prediction(
                saved.array("x_pb", Np),
                saved.array("e_h", Np, finite=False),
                saved.array("x_h_std", Np),
                int(n_warm_up),
            )
            compensator._pending = PendingPlan(
                saved.array("coefficients", n),
                saved.array("delta", Np),
                saved.array("x_d", Np),
                prediction,
                SepState(int(state)),
            )
        return compensator


def _last_three(before: Array, window: Array) -> Array:
    return np.concatenate((before, window))[-3:]
