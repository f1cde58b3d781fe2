"""Servo error pre-compensation (SEP): the modified command ``x_dm = x_d + δ`` with which ``x_h`` follows ``x_d``.

By the paper's model the position is affine in the command, ``x_h = G_h x_dm + free`` (eq. (3)), so this is a
least-squares problem; by the averaged one it is solved in Newton steps (:mod:`~hybridsep.compensate.newton`). ``δ`` is
a sum of cubic B-splines, each filtered through the current model (the filtered-basis-functions method: Ramani, Duan,
Okwudire and Ulsoy, J. Dyn. Sys. Meas. Control 139 (2017)), with limited preview (receding horizon): of a plan only the
splines that begin in the first window are applied, then the next plan follows from new measurements.

Position, velocity and acceleration of ``δ`` are continuous by construction, also between windows and between models.
Every spline ends within its plan, so a plan returns to ``x_d`` at its end, where its error counts least, and its
remainder keeps the limits. The next plan starts from that remainder: there is always a feasible plan, and where no
other can be computed the remainder is followed. Where the preview is shorter than the drive needs, plans go on after
it, and what is carried out of them has a stop within the limits (:mod:`~hybridsep.compensate.stop`).
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import ParameterError, SignalError, check_kind
from ..base.settings import CompensatorSettings, samples_before
from ..base.signals import as_measured, as_published, as_samples
from ..base.state import arrays_of, pack, restored, restoring, unpack
from ..base.threads import one_blas_thread
from ..online.look_ahead import LookAhead, PublishedWindow, SepState
from ..online.monitor import Monitor
from ..predict.averaging.features import Disturbance
from ..predict.predictor import HybridPredictor
from .limits import DriveBounds
from .planning import AveragedPlanning, PaperPlanning, PendingPlan, Planning, PlanTask
from .splines import N_DECIDED, SplineBasis
from .stop import Stop

_KIND = "compensator"
_TUNABLE = tuple(name for name, parameter in CompensatorSettings.parameters().items() if parameter.tunable)


class SepCompensator:
    """Receding-horizon compensator that keeps learning in closed loop.

    Sample by sample, call :meth:`step`. Or for each window, call :meth:`plan` with the commanded positions ahead, send
    its ``x_dm`` to the drive, then call :meth:`update` with the measured positions.

    Where its :attr:`monitor` has tripped, or lost the measurement, no model plans, and a plan ends compensation.

    Parameters
    ----------
    predictor : HybridPredictor
        At the beginning of a run; it learns from the modified commands. With ``averaging`` plans follow the slope of
        its model (:mod:`~hybridsep.compensate.newton`); else they use the paper's.
    settings : CompensatorSettings, optional
        The defaults if left out.

    Raises
    ------
    ParameterError
        If ``preview`` or ``spacing`` does not fit the predictor's ``Np``, or the predictor has a ``measurement_delay``
        without averaging.
    """

    _SAVED = ("lead_in", "_state_before", "monitor", "_previous_plan", "_last_stop", "_before")
    _SAVED_OF_PLANNING = ("ahead", "share", "corrected", "reach")

    def __init__(self, predictor: HybridPredictor, settings: CompensatorSettings | None = None) -> None:
        check_kind(HybridPredictor, predictor=predictor)
        check_kind(CompensatorSettings | None, settings=settings)
        Np = predictor.Np
        predictor.settings.check_planning()
        self.predictor = predictor
        needed = predictor.model.needed_preview(predictor.T_s, predictor.settings.input_hold)
        self.settings = settings = (settings or CompensatorSettings()).for_window(Np, needed, predictor.T_s)
        assert settings.preview is not None
        assert settings.spacing is not None
        assert settings.horizon is not None
        self.preview, self.spacing, self.horizon = settings.preview, settings.spacing, settings.horizon
        predictor.plan_ahead(self.preview)
        self._basis = SplineBasis(self.horizon, self.spacing, Np)
        planning = AveragedPlanning if predictor.settings.averaging else PaperPlanning
        self._planning: Planning = planning(self._basis, self._bounds(settings), settings, Np)
        self._stop = self._stop_within(self._planning.bounds)
        self.restart(predictor.start, t_init=predictor.settings.warm_up)

    def restart(self, start: float | None = None, *, t_init: float = 0.0, lead_in: int = 0) -> None:
        """Begin another run, at rest at ``start``, m, or the first command; what was learned is kept (warm start).

        ``lead_in``: samples at rest before the trajectory, not learned; ``t_init``: warm-up, s, from its end, in which
        the physics model is used.
        """
        self._online: LookAhead | None = None
        predictor = self.predictor
        predictor.restart(start, t_init=t_init + lead_in * predictor.T_s if t_init > 0 else 0.0)
        self.lead_in = int(lead_in)
        self._state_before = min(self.compensate, SepState.PHYSICS)
        self._planning.restart()
        n_lost = samples_before(self.settings.measurement_timeout, self.T_s)
        self.monitor = Monitor(n_lost, self.settings.following_error_max)
        # Coefficients of the remainder of the last plan, and of its stop; (2, n), m: last values of x_d and of δ
        self._previous_plan = np.zeros(N_DECIDED + self._basis.n_free)
        self._last_stop = np.zeros(0 if self._stop is None else self._stop.n)
        self._before = np.repeat([[np.nan], [0.0]], max(3, predictor.settings.n_late), axis=1)
        self._pending: PendingPlan | None = None

    @property
    def compensate(self) -> SepState:
        """Best model allowed."""
        return SepState[self.settings.compensate.upper()]

    def change(self, **settings: Any) -> None:
        """Change settings in a run, from the next window on; no command jumps.

        Every plan goes on from the remainder of the last plan, which keeps the drive's limits and ends at ``x_d``. With
        ``compensate="off"`` a plan ends compensation, smoothly and within the preview. Where the remainder is larger
        than a new ``change_max``, it is the bound. ``following_error_max`` counts from the next sample on; 0 ends no
        trip. These three, of :class:`~hybridsep.base.settings.CompensatorSettings`, can change.

        ParameterError if one is out of its range, or fixed; nothing is changed.
        """
        fixed = [name for name in settings if name not in _TUNABLE]
        if fixed:
            raise ParameterError(f"{', '.join(fixed)} cannot change in a run, {', '.join(_TUNABLE)} can")
        changed = replace(self.settings, **settings)
        if changed != self.settings:
            self.settings = changed
            self.monitor.error_max = changed.following_error_max
            self._planning.bounds, self._planning.settings = self._bounds(changed), changed
            self._stop = self._stop_within(self._planning.bounds)

    @property
    def T_s(self) -> float:
        """Sampling interval, s."""
        return self.predictor.T_s

    @property
    def delay(self) -> int:
        """Samples by which :meth:`step` delays the command: ``preview``."""
        return self.preview

    def step(self, x_d_ahead: float, x_meas: float, x_load: float = 0.0) -> float:
        """Process one sample and return the modified command of the next one, m: an online loop in one call.

        It is a :class:`~hybridsep.online.look_ahead.LookAhead` over this compensator, which begins at the first call
        after :meth:`restart`: there are predictions, errors and a state to save in it.

        ``x_d_ahead``, m: commanded position for ``preview`` samples later; ``x_meas``, m: position measured now;
        ``x_load``, m: load for ``preview`` samples later, as :meth:`plan` takes it, counted from the first sample's.
        SignalError as :meth:`LookAhead.sample <hybridsep.online.look_ahead.LookAhead.sample>`.
        """
        online = self._online or LookAhead(self, x_d_ahead if self.predictor.start is None else self.predictor.start)
        self._online = online  # making it restarts the compensator
        online.sample(x_d_ahead, x_meas, x_load)
        return online.x_dm

    @one_blas_thread
    def plan(self, x_d: ArrayLike, load: ArrayLike | None = None) -> PublishedWindow:
        """Plan the next window for the commanded positions ``x_d``, m, of the preview, ``(preview,)``.

        May be called again, with other commands, before :meth:`update`; the last call counts.

        ``load``, m, ``(preview,)``: force or torque on the axis over the preview, divided by the stiffness of its
        position loop, positive where it pushes the axis forwards, counted from the start of the run: from a rigid-body
        model, gravity or a table. The drive's model gets it beside the command, so plans make up for it; none if left
        out. SignalError if ``x_d`` or ``load`` has another length or is not finite, or the prediction diverges.
        """
        command = as_samples(x_d, "x_d", self.preview, T_s=self.T_s)
        loads = np.zeros(self.preview) if load is None else as_samples(load, "load", self.preview)
        predictor, Np = self.predictor, self.predictor.Np
        if predictor.start is None:  # at rest where the first command is
            predictor.state = replace(predictor.state, start=float(command[0]))
        if np.isnan(self._before[0, 0]):
            self._before[0] = predictor.start
        more = np.arange(1, self.horizon - self.preview + 1)
        path = np.concatenate((command, command[-1] + (command[-1] - command[-2]) * more))
        loads = np.concatenate((loads, np.full(len(more), loads[-1])))
        x_d_before, delta_before = self._before[:, -3:]
        task = PlanTask(path, loads, x_d_before, delta_before, self._previous_plan, self._state_before)
        ends = self.monitor.is_tripped or self.monitor.is_lost
        chosen = self._planning.choose(predictor, task, SepState.OFF if ends else self.compensate)
        coefficients, stop = chosen.coefficients, self._last_stop
        if self._stop is not None:
            limits = self._planning.bounds.hard(command, x_d_before, delta_before, turns=len(command))
            coefficients, stop = self._stop.carried_out(coefficients, stop, *limits)
        delta = (self._basis.values @ coefficients)[:Np]
        x_dm = command[:Np] + delta
        prediction = predictor.predict(x_dm + loads[:Np], path=path, scales=chosen.scales)
        now = command[:Np].copy()
        share, correction = self._planning.share, np.zeros_like(coefficients)
        reach = self._planning.reach if chosen.reach is None else chosen.reach
        if chosen.share is not None:
            share, correction = chosen.share, chosen.coefficients - self._previous_plan
        self._pending = PendingPlan(coefficients, delta, now, stop, chosen.state, share, correction, reach)
        as_published(prediction.x_pb, "x_pb")
        found = self._planning.published(prediction, chosen.state)
        return PublishedWindow(now, x_dm, prediction.x_pb, *found[:2], chosen.state, *found[2:], self._state_before)

    @one_blas_thread
    def update(self, x: ArrayLike) -> None:
        """Learn from the measured positions ``x``, m, of the planned window, ``(Np,)``.

        With ``averaging`` NaN where missing. SignalError if nothing is planned, the length is another one or a value is
        not finite; nothing is changed.
        """
        pending = self._pending
        if pending is None:
            raise SignalError("update must follow plan: there is no planned window to measure")
        predictor, Np = self.predictor, self.predictor.Np
        measured, monitor = as_measured(x, "x", Np, T_s=self.T_s).copy(), replace(self.monitor)
        before = np.hstack((self._before, (pending.x_d, pending.delta)))
        x_d, delta = before[:, -predictor.settings.n_late - Np :][:, :Np]  # what is measured is late
        for i, (error, change) in enumerate(zip((measured - x_d).tolist(), delta.tolist(), strict=True)):
            if i >= monitor.n_taken and not monitor.take_in(error, change) and predictor.settings.averaging:
                measured[i] = np.nan
        predictor.update(measured, learn=predictor.k >= self.lead_in, ahead=self._planning.due)
        self.monitor, monitor.n_taken = monitor, 0
        kept = Np // self.spacing
        self._previous_plan = np.concatenate((pending.coefficients[kept:], np.zeros(kept)))
        self._last_stop = np.concatenate((pending.stop[kept:], np.repeat(pending.stop[-1:], kept)))
        self._before = before[:, Np:]
        self._state_before = pending.state
        self._planning.follow(pending)
        self._pending = None

    def _bounds(self, settings: CompensatorSettings) -> DriveBounds:
        return DriveBounds(
            self._basis, self.predictor.T_s, settings.limits, settings.change_max, no_reversal=settings.no_reversal
        )

    def _stop_within(self, bounds: DriveBounds) -> Stop | None:
        if self.horizon <= self.preview:
            return None
        return Stop(self._basis, bounds, self.preview, self.predictor.Np, self._planning.n_pinned)

    def to_bytes(self) -> bytes:
        """Return parameters and state, predictor and pending window included, as a versioned blob."""
        meta = {"settings": asdict(self.settings), "is_planned": self._pending is not None}
        arrays = arrays_of((self._saved(), self._pending or ()))
        return pack(_KIND, meta, arrays, {"predictor": self.predictor.to_bytes()})

    def _saved(self) -> tuple[Any, ...]:
        return tuple(getattr(owner, name) for owner, name in self._owners())

    def _owners(self) -> list[tuple[object, str]]:
        of_planning = [(self._planning, name) for name in self._SAVED_OF_PLANNING]
        return [*((self, name) for name in self._SAVED), *of_planning]

    @classmethod
    def from_bytes(cls, blob: bytes, disturbances: Sequence[Disturbance] = ()) -> "SepCompensator":
        """Return the compensator of :meth:`to_bytes`, given the ``disturbances`` of its predictor.

        StateError if the blob is foreign, truncated or of another version, or the number of disturbances differs.
        """
        meta, arrays, parts = unpack(_KIND, blob)
        with restoring(_KIND):
            predictor, kept = (HybridPredictor.from_bytes(parts["predictor"], disturbances) for _ in range(2))
            compensator = cls(predictor, CompensatorSettings.from_table(meta["settings"]))
            compensator.predictor = kept  # the constructor has restarted the other one
            nothing = np.zeros(compensator.predictor.Np)
            plan, stop = compensator._previous_plan, compensator._last_stop
            pending = PendingPlan(plan, nothing, nothing, stop, SepState.OFF, 1.0, plan, 0.0)
            saved, found = restored((compensator._saved(), pending if meta["is_planned"] else ()), arrays)
            for (owner, name), value in zip(compensator._owners(), saved, strict=True):
                setattr(owner, name, value)
            compensator._pending = found or None
        return compensator
