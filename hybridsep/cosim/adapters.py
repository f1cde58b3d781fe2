"""Adapters of the co-simulation loop: a controller and a drive, each an FMU or an object of the library or your own.

All have the same attributes and methods; what an FMU reports of itself is known after ``initialise``.
"""

import math
from collections import deque
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

from ..base.errors import FmuError
from ..base.settings import check
from ..base.signals import check_position
from ..compensate.compensator import SepCompensator
from ..online.look_ahead import LookAhead
from ..plants.plant import Encoder, Plant
from ..predict.predictor import HybridPredictor
from .run import COMPENSATOR, PREDICTOR, ControllerType


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


class LibraryController:
    """A predictor or compensator after its look-ahead, with the FMU's timing.

    ``t_init``: Warm-up, s; its own if left out.
    """

    name: str = "the controller"  # in error messages
    # Sampling interval, s; samples in a window, by which it delays the trajectory, and by which it is told that
    # measurements are late: an FMU's are known after :meth:`initialise`
    T_s: float
    Np: int
    delay: int
    late: int

    def __init__(self, controller: HybridPredictor | SepCompensator, t_init: float | None) -> None:
        self._controller, self._t_init = controller, t_init
        self.kind: ControllerType
        if isinstance(controller, SepCompensator):
            self.kind, predictor, self.delay = COMPENSATOR, controller.predictor, controller.preview
        else:
            self.kind, predictor, self.delay = PREDICTOR, controller, controller.Np
        self.T_s, self.Np, self.late = predictor.T_s, predictor.Np, predictor.settings.measurement_delay

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m, with what was learned kept."""
        self._look_ahead = LookAhead(self._controller, start, t_init=self._t_init)

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


class OwnController:
    """A compensator of the user's own; a run has NaN for the predictions that it does not make.

    ParameterError if ``T_s`` or ``delay`` is out of range.
    """

    name: str = "the compensator"
    kind: ControllerType = COMPENSATOR
    late: int = 0

    def __init__(self, compensator: Compensator) -> None:
        self._compensator = compensator
        self.T_s: float = check("T_s", compensator.T_s, label="the compensator's T_s")
        self.delay = self.Np = int(check("Np", compensator.delay, label="the compensator's delay"))

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        self._compensator.restart(start)
        self._x_dm, self._ahead = start, deque([start] * self.delay)

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of the kind's outputs, m, and the state, now."""
        return (self._x_dm, self._ahead[0], *(math.nan,) * 3), 0

    def n_rejected(self) -> int:
        """Return 0: it does not tell."""
        return 0

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to the next."""
        x_dm = float(self._compensator.step(x_d_ahead, x_meas))
        check_position("the compensator's command", x_dm, f" at sample {k}")
        self._x_dm = x_dm
        self._ahead.append(x_d_ahead)
        self._ahead.popleft()


class LibraryDrive:
    """A plant and its encoder."""

    name: str = "the plant"  # in error messages
    T_s: float | None = None  # sampling interval, s; None if it can be any

    def __init__(self, plant: Plant, encoder: Encoder) -> None:
        self.plant: Any = plant  # passed to ``disturb``
        self._encoder = encoder

    def initialise(self, start: float) -> None:
        """Put the plant to rest at ``start``, m."""
        self.plant.reset(start)

    def outputs(self) -> tuple[float, float]:
        """Return the true and the measured position now, m."""
        x = self.plant.x
        return x, self._encoder.measure(x)

    def step(self, k: int, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""
        self.plant.step(x_d, h)


class _OpenedFmu(AbstractContextManager["_OpenedFmu"]):
    """FMU whose instance lives as long as the context.

    ``path``: the archive; ``role``: name of the instance, as its log messages show it; ``values``: parameters to set
    before the initialization.
    """

    def __init__(self, path: str | Path, role: str, values: Mapping[str, Any]) -> None:
        self._path, self._role, self._values = path, role, values
        self.name: str = Path(path).name

    def __enter__(self) -> "_OpenedFmu":
        from .fmu import FmuInstance

        self.fmu = FmuInstance(self._path, self._role)
        return self

    def __exit__(self, *error: object) -> None:
        self.fmu.close()

    def _initialise(self, inputs: Mapping[str, float]) -> None:
        self.fmu.initialise({**self._values, **inputs})

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
        self._initialise({"x_d_ahead": start, "x_meas": start})
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
        self._initialise({"x_d": start})
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
