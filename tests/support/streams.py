"""One interface to every implementation of a model: library, C core, pythonfmu FMU and native FMU.

A behavioural test that is written against :class:`Stream` runs on all of them. What one of them cannot do stands, with
its reason, in :data:`MISSING`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

import pytest
from c_core import CModel, RefusedError, write_trajectory

from hybridsep import FmuInstance, HybridSepError, build_fmu, load_machine
from hybridsep.base.errors import FmuError
from hybridsep.base.settings import CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.state import pack, unpack
from hybridsep.compensate.compensator import SepCompensator, SepState
from hybridsep.machine import Machine
from hybridsep.plants.plant import Plant
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.look_ahead import LookAhead
from hybridsep.predict.look_ahead_inputs import LookAheadInputs
from hybridsep.predict.predictor import HybridPredictor

Value = float | int | bool

IMPLEMENTATIONS = ("library", "C core", "pythonfmu FMU", "native FMU")

PREDICTOR, COMPENSATOR, TRAJECTORY = "HybridPredictor", "SepCompensator", "ReferenceTrajectory"
DRIVE, STAGE = "FeedDrive", "FeedDrive_als25010_x"
LOOK_AHEADS = (PREDICTOR, COMPENSATOR)
PLANTS = (DRIVE, STAGE)

MISSING = {
    ("library", TRAJECTORY): "an array of positions needs no player",
    ("pythonfmu FMU", TRAJECTORY): "the native one runs beside pythonfmu FMUs; a table of numbers has nothing to edit",
}
"""(implementation, model) that do not exist, and why."""

WITHOUT_SLOPES = {
    "library": "its inputs are samples",
    "pythonfmu FMU": "pythonfmu has no fmi2SetRealInputDerivatives",
}
"""Implementations whose inputs have no time derivative, and why."""

OUTPUTS = {
    PREDICTOR: ("x_d", "x_pb", "x_h", "e_servo", "hybrid_active", "rms_pb", "rms_h", "batch"),
    COMPENSATOR: ("x_dm", "x_d", "x_pb", "x_h", "e_servo", "sep_state", "rms_e", "rms_pb", "rms_h", "batch"),
    TRAJECTORY: ("r",),
    DRIVE: ("x", "v"),
    STAGE: ("x", "v"),
}


class RefusedStreamError(Exception):
    """An implementation refused a call; the text is its message."""


class Stream(Protocol):
    """One instance of a model in one implementation."""

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        """Set parameters and start values, and begin at ``start``, s."""

    def set(self, name: str, value: Value) -> None:
        """Set an input."""

    def set_slope(self, name: str, slope: float) -> None:
        """Set an input's time derivative for the next step."""

    def step(self, t: float, h: float) -> None:
        """Do one communication step."""

    def outputs(self) -> list[float]:
        """Return the model's :data:`OUTPUTS`."""

    def save(self) -> bytes:
        """Return the whole state."""

    def restore(self, blob: bytes) -> None:
        """Take over a state that :meth:`save` returned."""

    def warnings(self) -> list[str]:
        """Return the warnings of all steps so far, as far as the implementation keeps them."""

    def close(self) -> None:
        """End the instance."""


@dataclass
class StreamMaker:
    """Make streams of one model in one implementation; all that were made are closed together."""

    implementation: str
    model: str
    archive: Callable[[], Path]
    resources: Path
    made: list[Stream]

    def __call__(self) -> Stream:
        makers: dict[str, Callable[[], Stream]] = {
            "library": lambda: _LIBRARY[self.model](self.model),
            "C core": lambda: CoreStream(self.model, self.resources),
            "pythonfmu FMU": lambda: FmuStream(self.archive(), self.model),
            "native FMU": lambda: FmuStream(self.archive(), self.model),
        }
        self.made.append(makers[self.implementation]())
        return self.made[-1]

    def close(self) -> None:
        for stream in self.made:
            stream.close()


def cases(models: Sequence[str]) -> list[Any]:
    """Return pytest parameters ``(implementation, model)`` for all that exist."""
    return [
        pytest.param((implementation, model), id=f"{implementation}-{model}")
        for implementation in IMPLEMENTATIONS
        for model in models
        if (implementation, model) not in MISSING
    ]


def machine_of(model: str) -> Machine:
    return load_machine("als25010_x" if model == STAGE else "spring_mass_damper")


def archive_of(model: str, implementation: str, out: Path) -> Path:
    """Return the archive of an FMU, built when first asked for."""
    native = implementation == "native FMU"
    name = model if native else model.replace("FeedDrive", "FeedDrivePy") if model in PLANTS else f"{model}Py"
    path = out / f"{name}.fmu"
    if native:
        return path if path.exists() else build_fmu(machine_of(model), name, out, targets=("host",))
    return path if path.exists() else build_fmu(machine_of(model), name, out, "python")


class FmuStream:
    """An FMU through fmpy."""

    def __init__(self, archive: Path, model: str) -> None:
        self._model = model
        self._fmu = FmuInstance(archive)

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._fmu.slave.setupExperiment(startTime=start, stopTime=stop)
        self._fmu.slave.enterInitializationMode()
        for name, value in values.items():
            self._fmu.set(name, value)
        self._refusing(self._fmu._call, self._fmu.slave.exitInitializationMode)

    def set(self, name: str, value: Value) -> None:
        self._fmu.set(name, value)

    def set_slope(self, name: str, slope: float) -> None:
        reference = self._fmu.variables[name].valueReference
        self._refusing(self._fmu._call, self._fmu.slave.setRealInputDerivatives, [reference], [1], [slope])

    def step(self, t: float, h: float) -> None:
        self._refusing(self._fmu.step, t, h)

    def outputs(self) -> list[float]:
        return [float(self._fmu.get(name)) for name in OUTPUTS[self._model]]

    def save(self) -> bytes:
        return self._fmu.save()

    def restore(self, blob: bytes) -> None:
        self._refusing(self._fmu.restore, blob)

    def warnings(self) -> list[str]:
        return [message for status, message in self._fmu.log if status == 1]

    def close(self) -> None:
        self._fmu.close()

    @staticmethod
    def _refusing(function: Callable[..., Any], *arguments: Any) -> None:
        try:
            function(*arguments)
        except FmuError as error:
            raise RefusedStreamError(str(error)) from error


class CoreStream:
    """The C core through ctypes, as an adapter holds it: without the stop time, which is the adapter's."""

    _NAMES: ClassVar[dict[str, str]] = {
        PREDICTOR: "predictor",
        COMPENSATOR: "compensator",
        TRAJECTORY: "trajectory",
        DRIVE: "feed_drive",
        STAGE: "stage_drive",
    }

    def __init__(self, model: str, resources: Path) -> None:
        self._model = CModel(self._NAMES[model], resources=resources)
        self._outputs = OUTPUTS[model]
        self._warnings: list[str] = []

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        for name, value in values.items():
            self._model[name] = float(value)
        self._refusing(self._model.initialise, start)

    def set(self, name: str, value: Value) -> None:
        self._model[name] = float(value)

    def set_slope(self, name: str, slope: float) -> None:
        self._model.values[self._model.slope_place[name]] = slope

    def step(self, t: float, h: float) -> None:
        self._refusing(self._model.step, t, h)
        if self._model.warning:
            self._warnings.append(self._model.warning)

    def outputs(self) -> list[float]:
        return [self._model[name] for name in self._outputs]

    def save(self) -> bytes:
        return pack("core", {}, {"state": self._model.state, "values": self._model.values})

    def restore(self, blob: bytes) -> None:
        _, arrays, _ = unpack("core", blob)
        self._model.check_state(arrays["state"].tobytes())
        self._model.state[:], self._model.values[:] = arrays["state"], arrays["values"]

    def warnings(self) -> list[str]:
        return self._warnings

    def close(self) -> None:
        pass

    @staticmethod
    def _refusing(function: Callable[..., Any], *arguments: Any) -> None:
        try:
            function(*arguments)
        except RefusedError as error:
            raise RefusedStreamError(str(error)) from error


class LibraryStream:
    """The NumPy library, stepped as an FMU is."""

    def __init__(self, model: str) -> None:
        self._name = model
        self._inputs: dict[str, Value] = {}
        self._warnings: list[str] = []

    def set(self, name: str, value: Value) -> None:
        self._inputs[name] = value

    def set_slope(self, name: str, slope: float) -> None:
        raise NotImplementedError(WITHOUT_SLOPES["library"])

    def warnings(self) -> list[str]:
        return self._warnings

    def close(self) -> None:
        pass


class LookAheadStream(LibraryStream):
    """A look-ahead of the library behind the clock that FMUs use."""

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        machine = machine_of(self._name)
        position = float(values.get("x_d_ahead", 0.0))
        self._inputs = {"x_d_ahead": position, "x_meas": float(values.get("x_meas", 0.0))}
        new = _predictor if self._name == PREDICTOR else _compensator
        try:
            self._look_ahead: LookAhead = new(machine, values, position)
            self._clock = LookAheadInputs(start, machine.T_s, position)
        except HybridSepError as error:
            raise RefusedStreamError(str(error)) from error

    def step(self, t: float, h: float) -> None:
        inputs = float(self._inputs["x_d_ahead"]), float(self._inputs["x_meas"])
        try:
            warning = self._clock.advance(self._look_ahead, *inputs, t, h)
        except HybridSepError as error:
            raise RefusedStreamError(str(error)) from error
        if warning:
            self._warnings.append(warning)

    def outputs(self) -> list[float]:
        return [float(getattr(self._look_ahead, name)) for name in OUTPUTS[self._name]]

    def save(self) -> bytes:
        return pack("stream", {"clock": self._clock.state()}, {}, {"core": self._look_ahead.to_bytes()})

    def restore(self, blob: bytes) -> None:
        meta, _, parts = unpack("stream", blob)
        self._clock = LookAheadInputs.from_state(meta["clock"])
        self._look_ahead = LookAhead.from_bytes(parts["core"], type(self._look_ahead.model))


class PlantStream(LibraryStream):
    """A plant of the library; its encoder is not drawn from."""

    _plant: Plant

    def initialise(self, values: Mapping[str, Value], *, start: float = 0.0, stop: float | None = None) -> None:
        self._plant = machine_of(self._name).new_plant()
        self._inputs = {"x_d": float(values.get("x_d", 0.0))}
        self._plant.reset(float(self._inputs["x_d"]))

    def step(self, t: float, h: float) -> None:
        try:
            self._plant.step(float(self._inputs["x_d"]), h)
        except HybridSepError as error:
            raise RefusedStreamError(str(error)) from error

    def outputs(self) -> list[float]:
        return [self._plant.x, self._plant.v]

    def save(self) -> bytes:
        return pack("stream", {"plant": self._plant.state()}, {})

    def restore(self, blob: bytes) -> None:
        self._plant.restore(unpack("stream", blob)[0]["plant"])


_LIBRARY: dict[str, type[LookAheadStream] | type[PlantStream]] = {
    PREDICTOR: LookAheadStream,
    COMPENSATOR: LookAheadStream,
    DRIVE: PlantStream,
    STAGE: PlantStream,
}


def _predictor(machine: Machine, values: Mapping[str, Value], start: float) -> LookAhead:
    parameters = {**machine.fmi_parameters(), **values}
    names = ("Np", "p", "q", "lambda", "T_s", "t_init", "input_hold")
    return LookAhead(
        HybridPredictor(machine.model, PredictorSettings.from_fmi({name: parameters[name] for name in names})), start
    )


def _compensator(machine: Machine, values: Mapping[str, Value], start: float) -> LookAhead:
    parameters: dict[str, Any] = {**machine.fmi_compensator_parameters(), **values}
    names = ("Np", "p", "q", "lambda", "T_s", "t_init", "input_hold", "v_friction")
    compensator = SepCompensator(
        HybridPredictor(machine.model, PredictorSettings.from_fmi({name: parameters[name] for name in names})),
        CompensatorSettings(
            limits=Limits(parameters["v_max"], parameters["a_max"], parameters["j_max"]),
            no_reversal=bool(parameters["no_reversal"]),
            compensate=SepState(parameters["compensate"]).name.lower(),
            **{name: parameters[name] for name in ("preview", "spacing", "jerk_weight", "change_max")},
        ),
    )
    return LookAhead(compensator, start)


def write_resources(folder: Path) -> None:
    """Write what the C core's ReferenceTrajectory plays."""
    write_trajectory(folder, staircase()[:2000])
