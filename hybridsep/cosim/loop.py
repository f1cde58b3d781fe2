"""Co-simulation loop of a controller and a drive, FMUs and the library's objects alike.

The Jacobi wiring: at ``t_k`` the drive gets the command that the controller gives it, the controller gets ``x_meas``
and ``x_d_ahead = r(k)``; then both step. The controller delays the trajectory, so ``r`` is held at its end for as many
samples more, and a run is recorded without the first fill. If the controller has a ``measurement_delay``, what is
measured arrives that many samples later; a run has it as it was measured. With −1 it arrives a sample early: the drive
steps before the controller, as under a sequential (Gauss-Seidel) master.
"""

from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import FmuError, ParameterError
from ..base.signals import as_samples
from ..base.threads import one_blas_thread
from ..compensate.compensator import SepCompensator
from ..logs.log import Log
from ..plants.plant import Encoder, Plant
from ..predict.predictor import HybridPredictor
from .adapters import Compensator, FmuController, FmuDrive, LibraryController, LibraryDrive, OwnController
from .run import Run

Sensor = Callable[[int, float], float]
"""Called as ``sensor(k, x_meas)``, ``k`` counted from the end of the fill; returns what is measured in its place."""

_Disturb = Callable[[int, Any], object]
"""Called as ``disturb(k, plant)`` before sample ``k``, counted likewise; may change the plant."""

Progress = Callable[[int, int], object]  # called with samples done and samples in all, about a hundred times


def cosimulate(
    controller: str | Path | HybridPredictor | SepCompensator | Compensator,
    plant: str | Path | Plant,
    r: ArrayLike | Log,
    *,
    controller_values: Mapping[str, Any] | None = None,
    plant_values: Mapping[str, Any] | None = None,
    encoder: Encoder | None = None,
    t_init: float | None = None,
    sensor: Sensor | None = None,
    disturb: _Disturb | None = None,
    progress: Progress | None = None,
) -> Run:
    """Run a predictor or a compensator and a drive together over a trajectory.

    Parameters
    ----------
    controller : str, Path, HybridPredictor, SepCompensator or Compensator
        An FMU's archive, an object of the library, which begins a run with what it has learned kept, or your own:
        :class:`~hybridsep.cosim.adapters.Compensator`.
    plant : str, Path or Plant
        An FMU's archive, an object of the library, or one of your own; it is reset to rest at ``r(0)``.
    r : (n,) array_like, m, or Log
        Commanded positions at ``k·T_s``, or a log that has them.
    controller_values, plant_values : mapping, optional
        Parameters of an FMU to set before the initialization, for example ``{"compensate": 1}`` and ``{"seed": 3}``.
    encoder : Encoder, optional
        Position sensor of a plant of the library; without noise if left out.
    t_init : float, optional
        Warm-up of a controller of the library, s; its own if left out, 0 for a warm start.
    sensor, disturb, progress : callable, optional
        As :data:`Sensor`, :data:`_Disturb` (of an FMU with its ``FmuInstance``) and :data:`Progress` say.

    Raises
    ------
    FmuError
        If an FMU refuses to load, to initialise or to step, or does not fit; its message is part of the error.
    ParameterError
        If an argument is for an FMU where there is an object, or the other way round.
    SignalError
        If ``r`` is empty or not finite.
    """
    unit = r.unit if isinstance(r, Log) else "m"
    command = as_samples(r.x_d if isinstance(r, Log) else r, "r")
    as_samples(command[:1], "r", 1)
    ahead: FmuController | LibraryController | OwnController
    if isinstance(controller, (str, Path)):
        _refuse(t_init, "t_init is for a controller of the library; an FMU's is among its controller_values")
        ahead = FmuController(controller, controller_values or {})
    else:
        _refuse(controller_values, "controller_values are for an FMU; make the controller with these parameters")
        if isinstance(controller, HybridPredictor | SepCompensator):
            ahead = LibraryController(controller, t_init)
        else:
            _refuse(t_init, "t_init is for a controller of the library; a compensator of your own has none")
            ahead = OwnController(controller)
    drive: FmuDrive | LibraryDrive
    if isinstance(plant, (str, Path)):
        _refuse(encoder, "encoder is for a plant of the library; an FMU's noise and seed are among its plant_values")
        drive = FmuDrive(plant, plant_values or {})
    else:
        _refuse(plant_values, "plant_values are for an FMU; make the plant with these parameters")
        drive = LibraryDrive(plant, encoder or Encoder())
    with one_blas_thread, ExitStack() as stack:
        for adapter in (ahead, drive):
            if isinstance(adapter, AbstractContextManager):
                stack.enter_context(adapter)
        start = float(command[0])
        ahead.initialise(start)
        drive.initialise(start)
        delay, T_s = ahead.delay, ahead.T_s
        if drive.T_s is not None and abs(drive.T_s - T_s) > 1e-6 * T_s:
            raise FmuError(f"{drive.name} has T_s = {drive.T_s:g} s, but {ahead.name} has {T_s:g} s; they must agree")
        kind, n = ahead.kind, len(command) + delay
        signals, state = np.empty((n, len(kind.outputs) + 2)), np.empty(n, dtype=np.int64)
        on_the_way, every, early = deque([start] * max(0, ahead.late)), max(1, n // 100), ahead.late < 0

        def measured(k: int) -> tuple[float, float]:
            """Return the true and the measured position at sample ``k``, m."""
            if disturb is not None:
                disturb(k - delay, drive.plant)
            x, x_meas = drive.outputs()
            return x, x_meas if sensor is None else sensor(k - delay, x_meas)

        x, x_meas = measured(0)
        for k in range(n):
            outputs, state[k] = ahead.outputs()
            signals[k] = *outputs, x, x_meas
            if not early:
                on_the_way.append(x_meas)
            drive.step(k, outputs[0], T_s)
            if k + 1 < n:
                x, x_meas = measured(k + 1)
            if early:
                on_the_way.append(x_meas)
            ahead.step(k, float(command[min(k, len(command) - 1)]), on_the_way.popleft())
            if progress is not None and (k % every == 0 or k == n - 1):
                progress(k + 1, n)
        n_rejected = ahead.n_rejected()
    found = dict(zip((*kind.outputs, "x", "x_meas"), signals[delay:].T.copy(), strict=True))
    found.setdefault("x_dm", found["x_d"])
    found |= {"t": np.asarray(np.arange(delay, n) * T_s, dtype=np.float64), "state": state[delay:]}
    return Run(kind, **found, T_s=T_s, Np=ahead.Np, n_rejected=n_rejected, measurement_delay=ahead.late, unit=unit)


def _refuse(given: object, message: str) -> None:
    if given is not None:
        raise ParameterError(message)
