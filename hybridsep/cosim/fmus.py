"""FMU adapters of the co-simulation loop: a predictor or compensator, and a plant."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from ..base.errors import FmuError, brief
from ..base.settings import check
from .importer import FmuInstance, read_description
from .run import COMPENSATOR, PREDICTOR, Kind

__all__ = ["FmuController", "FmuDrive", "check_controller", "check_plant"]

_SAMPLES_MAX = 1_000_000
"""Most samples of an FMU's window or delay; a hybridsep FMU's have at most a tenth."""


class _OpenedFmu(AbstractContextManager["_OpenedFmu"]):
    """FMU whose instance lives as long as the context.

    Parameters
    ----------
    path : str or Path
        The archive.
    role : str
        Name of the instance, as its log messages show it.
    values : mapping
        Parameters to set before the initialization.
    start_time : float
        Start of the experiment, s.
    """

    def __init__(self, path: str | Path, role: str, values: Mapping[str, Any], start_time: float) -> None:
        self._path, self._role, self._values, self._start_time = path, role, values, start_time
        self.name: str = Path(path).name

    def __enter__(self) -> _OpenedFmu:
        self.fmu = FmuInstance(self._path, self._role)
        return self

    def __exit__(self, *error: object) -> None:
        self.fmu.close()

    def _initialise(self, inputs: Mapping[str, float]) -> None:
        self.fmu.initialise({**self._values, **inputs}, start_time=self._start_time)

    def _samples(self, name: str, least: int = 0) -> int:
        """Return a number of samples reported by the FMU, checked."""
        value = self.fmu.get(name)
        if not least <= value <= _SAMPLES_MAX:  # NaN too
            raise FmuError(f"{self.name}: {name} must be {least} … {_SAMPLES_MAX} samples, got {brief(value)}")
        return int(value)

    def _interval(self) -> float:
        """Return the sampling interval reported by the FMU, s, checked."""
        return float(check("T_s", self.fmu.get("T_s"), label=f"{self.name}: T_s"))


class FmuController(_OpenedFmu):
    """A predictor or compensator FMU.

    Raises
    ------
    FmuError
        If the archive is no FMU, or neither of the two.
    """

    def __init__(self, path: str | Path, values: Mapping[str, Any], start_time: float) -> None:
        outputs = [variable.name for variable in read_description(path).modelVariables]
        self.kind: Kind = COMPENSATOR if COMPENSATOR.outputs[0] in outputs else PREDICTOR
        check_controller(path, self.kind)
        super().__init__(path, self.kind.name, values, start_time)

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        fmu = self.fmu
        self._initialise({"x_d_ahead": start, "x_meas": start})
        self.delay, self.Np, self.T_s = self._samples(self.kind.delay), self._samples("Np"), self._interval()
        self.late = self._samples("measurement_delay", -1) if "measurement_delay" in fmu.variables else 0
        self._get = fmu.reader([*self.kind.outputs, self.kind.state])
        self._step = fmu.real_stepper(["x_d_ahead", "x_meas"])

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of the kind's outputs, m, and the state, now."""
        *positions, state = self._get()
        return tuple(positions), self.kind.lowest + int(state)

    def n_rejected(self) -> int:
        """Return how many measurements were missing or not plausible; 0 of an FMU that does not tell."""
        return int(self.fmu.get("n_rejected")) if "n_rejected" in self.fmu.variables else 0

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to the next."""
        self._step((x_d_ahead, x_meas), self._start_time + k * self.T_s, self.T_s)


class FmuDrive(_OpenedFmu):
    """A plant FMU.

    Raises
    ------
    FmuError
        If the archive is no FMU, or no plant.
    """

    T_s: float | None = None

    def __init__(self, path: str | Path, values: Mapping[str, Any], start_time: float) -> None:
        check_plant(path)
        super().__init__(path, "plant", values, start_time)

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        self.plant: Any = self.fmu
        self._initialise({"x_d": start})
        if "T_s" in self.fmu.variables:
            self.T_s = self._interval()
        self._get, self._step = self.fmu.real_reader(["x", "x_meas"]), self.fmu.real_stepper(["x_d"])

    def outputs(self) -> tuple[float, float]:
        """Return the true and the measured position now, m."""
        x, x_meas = self._get()
        return x, x_meas

    def step(self, k: int, x_d: float, h: float) -> None:
        """Advance from sample ``k`` by ``h`` seconds with the command ``x_d``, m, held."""
        self._step((x_d,), self._start_time + k * h, h)


def check_controller(path: str | Path, kind: Kind) -> None:
    """Raise FmuError if an archive is no FMU, or lacks variables of a kind of controllers."""
    _check_variables(path, kind.name, ("x_d_ahead", "x_meas"), (*kind.outputs, kind.state))


def check_plant(path: str | Path) -> None:
    """Raise FmuError if an archive is no FMU, or lacks variables of a plant."""
    _check_variables(path, "plant", ("x_d",), ("x", "x_meas"))


def _check_variables(path: str | Path, role: str, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    causalities = {variable.name: variable.causality for variable in read_description(path).modelVariables}
    for causality, names in (("input", inputs), ("output", outputs)):
        for name in names:
            if causalities.get(name) != causality:
                raise FmuError(f"{Path(path).name} is no {role}: it has no {causality} {name}")
