"""Base class of the pythonfmu slaves: variable table, call order, states and errors.

pythonfmu has no ``fmi2Error``: a step that returns False becomes ``fmi2Discard``, an exception ``fmi2Fatal``. A step
that cannot be done is therefore refused with a logged message and False, and has changed nothing; any other error (a
bad parameter at the end of initialization, a call that is not allowed now) is an exception, whose message pythonfmu
logs.
"""

from __future__ import annotations

import ctypes
import json
import logging
import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real
from pythonfmu.enums import Fmi2Status

from ..base.errors import FmuError, HybridSepError, SignalError, StateError
from ..base.settings import PARAMETERS
from ..base.signals import check_position
from ..base.state import pack, restoring, unpack
from .variables import FmuTable, Variable

DESCRIPTION_FILE = "machine.json"
"""In the resources: model, start values of the parameters, modes and GUID of the FMU's content."""

_LAST_READ: dict[str, dict[str, Any]] = {}
"""Descriptions by their resources' folder, for a reset: pythonfmu 0.7 does not survive a slave that fails then."""

_LOG = logging.getLogger("hybridsep.fmu")
"""Refusals, for stderr: where the importer's logging is off, pythonfmu passes on no message."""

_STOP_TOLERANCE = 1e-6  # of a step: a last step that ended at the stop time but for rounding
_TYPES = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "Enumeration": Integer}  # pythonfmu has no Enumeration


_Method = TypeVar("_Method", bound=Callable[..., Any])


def _surviving(method: _Method) -> _Method:
    """Keep the instance's objects alive when pythonfmu sees an exception.

    pythonfmu 0.7 gives up its references to the slave, its class and its messages at every exception, and once more
    when the instance is freed; without a reference in their place the second exception ends the importer's process.
    """

    @wraps(method)
    def survive(self: TableSlave, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except BaseException as error:  # KeyboardInterrupt, too
            _LOG.error("%s: %s", self.instance_name, error or type(error).__name__)
            for thing in (self, type(self), self.log_queue):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
            raise

    return survive  # type: ignore[return-value]


def _read_description(resources: str) -> dict[str, Any]:
    """Return the FMU's description from the archive."""
    path = Path(resources) / DESCRIPTION_FILE
    try:
        _LAST_READ[resources] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        if resources not in _LAST_READ:
            raise FmuError(f"{path} cannot be read, unpack the whole archive again: {error}") from error
    return _LAST_READ[resources]


class _References(dict[int, Any]):
    """Variables by value reference; a reference to none is refused by its number and the range."""

    def __missing__(self, reference: int) -> Any:
        raise FmuError(f"value reference must be 0 … {len(self) - 1}, got {reference}")


class TableSlave(Fmi2Slave):  # type: ignore[misc]
    """Slave whose variables come from its table and whose arithmetic is in the library.

    The machine's data are read from the instance's own resources: two FMUs that carry the same library share its
    modules within one process, so nothing of a machine may live at module level.
    """

    command: ClassVar[str]  # the input whose start value is the position where a run begins, m

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.vars = _References()
        described = _read_description(self.resources)
        self.content, table = described["content"], FmuTable.from_json(described)
        self.modelName, self.table, self.unit = table.name, table.variables, table.unit
        self.values: dict[str, Any] = {v.name: v.start for v in self.table if v.causality in ("input", "parameter")}
        self.running = self.terminated = False
        self.warned: set[str] = set()
        self.start_time = 0.0
        self.stop_time: float | None = None
        for variable in self.table:
            self.register_variable(self._as_pythonfmu(variable), nested=False)

    # Implemented by each slave -----------------------------------------------------------------------------------

    @abstractmethod
    def initialise(self) -> None:
        """Make the core from ``self.values``; raise HybridSepError if they do not fit."""

    @abstractmethod
    def initial_value(self, name: str) -> float | int | bool:
        """Return an output or local variable at ``t_0``, before the core exists."""

    @abstractmethod
    def current_value(self, name: str) -> float | int | bool:
        """Return an output or local variable now."""

    @abstractmethod
    def advance(self, t: float, h: float) -> None:
        """Do one communication step; raise HybridSepError, with nothing changed, if it cannot be done."""

    @abstractmethod
    def core_state(self) -> tuple[dict[str, Any], bytes]:
        """Return the core's scalars and its blob."""

    @abstractmethod
    def restore_core(self, meta: Mapping[str, Any], blob: bytes) -> None:
        """Take over what :meth:`core_state` returned."""

    # FMI -------------------------------------------------------------------------------------------------------

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Keep start and stop time; the tolerance has no meaning here."""
        if not math.isfinite(start_time):
            raise FmuError(f"the start time must be finite, got {start_time} s")
        if stop_time is not None and not stop_time >= start_time:
            raise FmuError(f"the stop time must be ≥ the start time {start_time:.9g} s, got {stop_time:.9g} s")
        self.start_time, self.stop_time = start_time, stop_time

    def exit_initialization_mode(self) -> None:
        """Check the parameters together and make the core."""
        self.initialise()
        self.running = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance, or log why not and refuse the step."""
        try:
            if not self.running:
                raise FmuError("doStep is not allowed before the initialization has ended")
            if self.terminated:
                raise FmuError("doStep is not allowed after terminate")
            if self.stop_time is not None and current_time >= self.stop_time - _STOP_TOLERANCE * step_size:
                raise FmuError(
                    f"a step must begin before the stop time {self.stop_time:.9g} s, got one from {current_time:.9g} s"
                )
            self.advance(current_time, step_size)
        except HybridSepError as error:
            self.log(f"{self.instance_name}: {error}", Fmi2Status.error)
            _LOG.error("%s: %s", self.instance_name, error)
            return False
        return True

    def terminate(self) -> None:
        """Allow no more steps; values can still be read."""
        self.terminated = True

    def warn_once(self, warnings: Mapping[str, str]) -> None:
        """Log warnings, of each kind the first one of this instance alone."""
        for kind, message in warnings.items():
            if kind not in self.warned:
                self.warned.add(kind)
                self.log(f"{self.instance_name}: {message}", Fmi2Status.warning)

    # The whole state, not only the registered variables --------------------------------------------------------

    def _get_fmu_state(self) -> bytes:
        meta: dict[str, Any] = {
            "content": self.content,
            "running": self.running,
            "terminated": self.terminated,
            "start_time": self.start_time,
            "stop_time": self.stop_time,
            "values": self.values,
        }
        core: dict[str, bytes] = {}
        if self.running:
            meta["core"], core["core"] = self.core_state()
        return pack("fmu", meta, {}, core)

    def _set_fmu_state(self, state: bytes) -> None:
        meta, _, parts = unpack("fmu", state)
        if meta["content"] != self.content:
            raise StateError(f"the state belongs to another FMU than {self.modelName} as it is here")
        before, self.values = self.values, meta["values"]
        try:
            if meta["running"]:
                with restoring("fmu"):
                    self.restore_core(meta["core"], parts["core"])
        except StateError:
            self.values = before
            raise
        self.running, self.terminated = meta["running"], meta["terminated"]
        self.start_time, self.stop_time = meta["start_time"], meta["stop_time"]

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        # Checked when it is set: an exception here leaves pythonfmu with an object it has freed.
        return bytes(state)

    def _as_pythonfmu(self, variable: Variable) -> Any:
        return _TYPES[variable.kind](
            variable.name,
            causality=Fmi2Causality[variable.causality],
            variability=Fmi2Variability[variable.variability],
            description=variable.description,
            getter=self._getter(variable),
            setter=self._setter(variable),
        )

    def _getter(self, variable: Variable) -> Callable[[], Any]:
        name = variable.name
        if variable.causality in ("input", "parameter"):
            return lambda: self.values[name]
        return lambda: self.current_value(name) if self.running else self._value_before(name)

    def _value_before(self, name: str) -> float | int | bool:
        """Return an output or local variable at ``t_0``, which the start value of the command must tell."""
        try:
            check_position(f"the start value of {self.command}", self.values[self.command], unit=self.unit)
        except SignalError as error:
            raise SignalError(f"{name} is not known yet: {error}") from error
        return self.initial_value(name)

    def _setter(self, variable: Variable) -> Callable[[Any], None]:
        name, causality = variable.name, variable.causality

        def assign(value: Any) -> None:
            if causality not in ("input", "parameter"):
                raise FmuError(f"{name} is an {causality} variable and cannot be set")
            if causality == "parameter" and variable.variability == "fixed" and self.running:
                raise FmuError(f"{name} is a fixed parameter and cannot be set after initialization, got {value!r}")
            if name in PARAMETERS and self.running:
                parameter = PARAMETERS[name]
                parameter.checked(parameter.from_fmi(value))
            self.values[name] = value

        return assign


for _name in (
    *("setup_experiment", "enter_initialization_mode", "exit_initialization_mode", "do_step", "terminate"),
    *(f"{verb}_{kind}" for verb in ("get", "set") for kind in ("real", "integer", "boolean", "string")),
    *("_get_fmu_state", "_set_fmu_state"),
):
    setattr(TableSlave, _name, _surviving(getattr(TableSlave, _name)))
