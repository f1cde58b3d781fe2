"""Co-simulation loop of a controller and a drive, FMUs and the library's objects alike.

The Jacobi wiring: at ``t_k`` the drive gets the command that the controller gives it, the controller gets ``x_meas``
and ``x_d_ahead = r(k)``; then both step. The controller delays the trajectory, so ``r`` is held at its end for as many
samples more, and a run is recorded without the first fill. If the controller has a ``measurement_delay``, what is
measured arrives that many samples later; a run has it as it was measured. With −1 it arrives a sample early: the drive
steps before the controller, as under a sequential (Gauss-Seidel) master.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import FmuError, ParameterError, check_has, check_kind
from ..base.settings import check
from ..base.signals import as_samples, check_interval, check_position
from ..base.threads import one_blas_thread
from ..compensate.compensator import SepCompensator
from ..logs.log import Log
from ..online.look_ahead import LookAhead
from ..plants.plant import Encoder, Plant
from ..predict.predictor import HybridPredictor
from .run import COMPENSATOR, PREDICTOR, ControllerType, Run

Sensor = Callable[[int, float], float]
"""Called as ``sensor(k, x_meas)``, ``k`` counted from the end of the fill; returns what is measured in its place."""

_Disturb = Callable[[int, Any], object]
"""Called as ``disturb(k, plant)`` before sample ``k``, counted likewise; may change the plant."""

Progress = Callable[[int, int], object]  # called with samples done and samples in all, about a hundred times


class Compensator(Protocol):
    """Interface of a compensator of your own in a run; :class:`SepCompensator` has it too."""

    @property
    def T_s(self) -> float:
        """Sampling interval, s."""

    @property
    def delay(self) -> int:
        """Samples by which it delays the command, its look-ahead, ≥ 1."""

    def restart(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""

    def step(self, x_d_ahead: float, x_meas: float) -> float:
        """Process the command ``delay`` samples ahead and the position now, m; return the next sample's command, m."""


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
        :class:`Compensator`.
    plant : str, Path or Plant
        An FMU's archive, an object of the library, or one of your own; it is reset to rest at ``r(0)``.
    r : (n,) array_like, m, or Log
        Commanded positions at ``k·T_s``, or a log that has them; of arrays in another unit ``read_log`` makes one.
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
        If an argument is for an FMU where there is an object, or the other way round, or ``r`` is sampled otherwise.
    SignalError
        If ``r`` is empty or not finite.
    """
    check_kind(Callable | None, sensor=sensor, disturb=disturb, progress=progress)
    check_kind(Mapping | None, controller_values=controller_values, plant_values=plant_values)
    unit = r.unit if isinstance(r, Log) else "m"
    command = as_samples(r.x_d if isinstance(r, Log) else r, "r")
    ahead: FmuController | LibraryController | _OwnController
    if isinstance(controller, (str, Path)):
        _refuse(t_init, "t_init is for a controller of the library; an FMU's is among its controller_values")
        ahead = FmuController(controller, controller_values or {})
    else:
        _refuse(controller_values, "controller_values are for an FMU; make the controller with these parameters")
        if isinstance(controller, HybridPredictor | SepCompensator):
            ahead = LibraryController(controller, t_init, unit)
        else:
            _refuse(t_init, "t_init is for a controller of the library; a compensator of your own has none")
            ahead = _OwnController(controller)
    drive: FmuDrive | _LibraryDrive
    if isinstance(plant, (str, Path)):
        _refuse(encoder, "encoder is for a plant of the library; an FMU's noise and seed are among its plant_values")
        drive = FmuDrive(plant, plant_values or {})
    else:
        _refuse(plant_values, "plant_values are for an FMU; make the plant with these parameters")
        check_kind(Encoder | None, encoder=encoder)
        drive = _LibraryDrive(plant, encoder or Encoder())
    with one_blas_thread, ExitStack() as stack:
        for adapter in (ahead, drive):
            if isinstance(adapter, AbstractContextManager):
                stack.enter_context(adapter)
        start = float(command[0])
        ahead.initialise(start)
        drive.initialise(start)
        delay, T_s = ahead.delay, ahead.T_s
        if isinstance(r, Log):
            check_interval("the log", r.T_s, ahead.name, T_s)
        else:
            as_samples(r, "r", T_s=T_s)
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


# Adapters -------------------------------------------------------------------------------------------------------------
#
# A controller's adapter has ``kind``, ``T_s``, s, and in samples ``Np``, ``delay``, of the trajectory, and ``late``, of
# measurements as it is told; a drive's has ``T_s`` and ``plant``; both have ``name`` and the methods that the FMUs'
# describe. What an FMU reports is known after ``initialise``.


class LibraryController:
    """A predictor or compensator after its look-ahead, with the FMU's timing; a run keeps what it has learned."""

    name: str = "the controller"  # in error messages

    def __init__(self, controller: HybridPredictor | SepCompensator, t_init: float | None, unit: str = "m") -> None:
        self._controller, self._t_init, self._unit = controller, t_init, unit
        self.kind: ControllerType
        if isinstance(controller, SepCompensator):
            self.kind, predictor, self.delay = COMPENSATOR, controller.predictor, controller.preview
        else:
            self.kind, predictor, self.delay = PREDICTOR, controller, controller.Np
        self.T_s, self.Np, self.late = predictor.T_s, predictor.Np, predictor.settings.measurement_delay

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        self._look_ahead = LookAhead(self._controller, start, t_init=self._t_init, unit=self._unit)

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of the kind's outputs, m, and the state, now."""
        ahead, kind = self._look_ahead, self.kind
        return tuple(getattr(ahead, name) for name in kind.outputs), kind.state_offset + int(getattr(ahead, kind.state))

    def n_rejected(self) -> int:
        """Return how many measurements were missing or not plausible."""
        return self._look_ahead.n_rejected

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to the next."""
        self._look_ahead.sample(x_d_ahead, x_meas)


class _OwnController:
    """A compensator of the user's own; a run has NaN for the predictions that it does not make."""

    name: str = "the compensator"
    kind: ControllerType = COMPENSATOR
    late: int = 0

    def __init__(self, compensator: Compensator) -> None:
        check_has("controller", compensator, "T_s", "delay", "restart", "step")
        self._compensator = compensator
        self.T_s: float = check("T_s", compensator.T_s, label="the compensator's T_s")
        self.delay = self.Np = int(check("Np", compensator.delay, label="the compensator's delay"))

    def initialise(self, start: float) -> None:
        self._compensator.restart(start)
        self._x_dm, self._ahead = start, deque([start] * self.delay)

    def outputs(self) -> tuple[tuple[float, ...], int]:
        return (self._x_dm, self._ahead[0], *(math.nan,) * 3), 0

    def n_rejected(self) -> int:
        return 0  # it does not tell

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        x_dm = float(self._compensator.step(x_d_ahead, x_meas))
        check_position("the compensator's command", x_dm, f" at sample {k}")
        self._x_dm = x_dm
        self._ahead.append(x_d_ahead)
        self._ahead.popleft()


class _LibraryDrive:
    name: str = "the plant"  # in error messages
    T_s: float | None = None  # sampling interval, s; None if it can be any

    def __init__(self, plant: Plant, encoder: Encoder) -> None:
        check_has("plant", plant, "reset", "step")
        self.plant: Any = plant  # passed to ``disturb``
        self._encoder = encoder

    def initialise(self, start: float) -> None:
        self.plant.reset(start)

    def outputs(self) -> tuple[float, float]:
        x = self.plant.x
        return x, self._encoder.measure(x)

    def step(self, k: int, x_d: float, h: float) -> None:
        self.plant.step(x_d, h)


class _OpenedFmu(AbstractContextManager["_OpenedFmu"]):
    """FMU whose instance lives as long as the context; its log messages call it by its ``role``."""

    def __init__(self, path: str | Path, role: str, values: Mapping[str, Any]) -> None:
        self._path, self._role, self._values = path, role, values
        self.name: str = Path(path).name

    def __enter__(self) -> "_OpenedFmu":
        from .fmu import FmuInstance

        self.fmu = FmuInstance(self._path, self._role)
        return self

    def __exit__(self, *error: object) -> None:
        self.fmu.close()

    def _interval(self) -> float:
        """Return the sampling interval reported by the FMU, s, checked."""
        return float(check("T_s", self.fmu.get("T_s"), label=f"{self.name}: T_s"))


class FmuController(_OpenedFmu):
    """A predictor or compensator FMU; FmuError if the archive is no FMU, or neither of the two."""

    def __init__(self, path: str | Path, values: Mapping[str, Any]) -> None:
        from .fmu import read_description  # fmpy is loaded where an FMU is

        outputs = [variable.name for variable in read_description(path).modelVariables]
        self.kind: ControllerType = COMPENSATOR if COMPENSATOR.outputs[0] in outputs else PREDICTOR
        check_controller(path, self.kind)
        super().__init__(path, self.kind.name, values)

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        fmu = self.fmu
        fmu.initialise({**self._values, "x_d_ahead": start, "x_meas": start})
        self.delay, self.Np, self.T_s = int(fmu.get(self.kind.delay)), int(fmu.get("Np")), self._interval()
        self.late = int(fmu.get("measurement_delay")) if "measurement_delay" in fmu.variables else 0
        self._get = fmu.reader([*self.kind.outputs, self.kind.state])
        self._step = fmu.real_stepper(["x_d_ahead", "x_meas"])

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of the kind's outputs, m, and the state, now."""
        *positions, state = self._get()
        return tuple(positions), self.kind.state_offset + int(state)

    def n_rejected(self) -> int:
        """Return how many measurements were missing or not plausible; 0 of an FMU that does not tell."""
        return int(self.fmu.get("n_rejected")) if "n_rejected" in self.fmu.variables else 0

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to the next."""
        self._step((x_d_ahead, x_meas), k * self.T_s, self.T_s)


class FmuDrive(_OpenedFmu):
    """A plant FMU; FmuError if the archive is no FMU, or no plant."""

    T_s: float | None = None

    def __init__(self, path: str | Path, values: Mapping[str, Any]) -> None:
        check_plant(path)
        super().__init__(path, "plant", values)

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        self.plant: Any = self.fmu
        self.fmu.initialise({**self._values, "x_d": start})
        if "T_s" in self.fmu.variables:
            self.T_s = self._interval()
        self._get, self._step = self.fmu.reader(["x", "x_meas"]), self.fmu.real_stepper(["x_d"])

    def outputs(self) -> tuple[float, float]:
        """Return the true and the measured position now, m."""
        x, x_meas = self._get()
        return x, x_meas

    def step(self, k: int, x_d: float, h: float) -> None:
        """Advance from sample ``k`` by ``h`` seconds with the command ``x_d``, m, held."""
        self._step((x_d,), k * h, h)


def check_controller(path: str | Path, kind: ControllerType) -> None:
    """Raise FmuError if an archive is no FMU, or lacks variables of a kind of controllers."""
    _check_variables(path, kind.name, ("x_d_ahead", "x_meas"), (*kind.outputs, kind.state))


def check_plant(path: str | Path) -> None:
    """Raise FmuError if an archive is no FMU, or lacks variables of a plant."""
    _check_variables(path, "plant", ("x_d",), ("x", "x_meas"))


def _check_variables(path: str | Path, role: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    from .fmu import read_description

    causalities = {variable.name: variable.causality for variable in read_description(path).modelVariables}
    for causality, names in (("input", inputs), ("output", outputs)):
        for name in names:
            if causalities.get(name) != causality:
                raise FmuError(f"{Path(path).name} is no {role}: it has no {causality} {name}")
