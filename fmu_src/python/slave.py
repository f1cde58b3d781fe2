"""Base of the pythonfmu slaves: variables of ``machine.json``, refusals, states; what they compute is the library's.

A refused step, which has changed nothing, is ``fmi2Discard``, an exception ``fmi2Fatal``.
"""

from __future__ import annotations

import ctypes
import json
import logging
from abc import abstractmethod
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real
from pythonfmu.enums import Fmi2Status

from hybridsep.base.clock import check_communication_point, check_step_size
from hybridsep.base.errors import FmuError, HybridSepError, StateError
from hybridsep.base.state import pack, unpack

_KIND = "fmu"
_LOG = logging.getLogger("hybridsep.fmu")
_TYPES = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "Enumeration": Integer}  # pythonfmu has no Enumeration
_Method = TypeVar("_Method", bound=Callable[..., Any])


def _surviving(method: _Method) -> _Method:
    """Keep the instance's objects alive when pythonfmu sees an exception, and say it on stderr.

    pythonfmu 0.7 gives up its references to the slave, its class and its messages at every exception, and once more
    when the instance is freed: the second exception would end the importer's process.
    """

    @wraps(method)
    def survive(self: Slave, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except BaseException as error:  # KeyboardInterrupt, too
            _LOG.error("%s: %s", self.instance_name, error or type(error).__name__)
            for thing in (self, type(self), self.log_queue):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
            raise

    return survive  # type: ignore[return-value]


class Slave(Fmi2Slave):  # type: ignore[misc]
    """Slave over a core, which its subclass makes of ``values``, the inputs and parameters by name.

    A machine's data are the instance's own: FMUs that carry the same library share its modules within one process.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        described = json.loads(Path(self.resources, "machine.json").read_text(encoding="utf-8"))
        self.modelName, self.unit, self.content = described["name"], described["unit"], described["content"]
        self.values: dict[str, Any] = {}
        self._begun: dict[str, Any] | None = None  # values that the core was made of
        self.running, self.end = False, 0.0  # of the last step, s
        for variable in described["variables"]:
            self._add(variable)

    @abstractmethod
    def begin(self) -> None:
        """Make the core; HybridSepError if the values do not fit."""

    @abstractmethod
    def advance(self, h: float) -> None:
        """Do a step of ``h``, s; HybridSepError, with nothing changed, if it cannot be done."""

    @abstractmethod
    def output(self, name: str) -> float | int | bool:
        """Return an output or local variable."""

    @abstractmethod
    def saved(self) -> bytes:
        """Return the core's state."""

    @abstractmethod
    def restore(self, blob: bytes) -> None:
        """Take over what :meth:`saved` returned."""

    def setup_experiment(self, start_time: float, *_: Any) -> None:
        """Keep the start time; an importer keeps to its stop time."""
        self.end = start_time

    def exit_initialization_mode(self) -> None:
        """Make the core."""
        self.begin()
        self.running = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance, or say why not."""
        try:
            if not self.running:
                raise FmuError("doStep is not allowed before the initialization has ended")
            check_step_size(step_size)
            check_communication_point(current_time, self.end, 0.5 * step_size)
            self.advance(step_size)
        except HybridSepError as error:
            self.log(f"{self.instance_name}: {error}", Fmi2Status.error)
            _LOG.error("%s: %s", self.instance_name, error)
            return False
        self.end = current_time + step_size
        return True

    def _add(self, variable: Mapping[str, Any]) -> None:
        name, kind, causality, start = (variable[key] for key in ("name", "kind", "causality", "start"))
        given = causality in ("input", "parameter")
        fixed = causality == "parameter" and variable["variability"] == "fixed"
        if given:
            self.values[name] = start

        def get() -> Any:
            if given:
                return self.values[name]
            if not self.running and self._begun != self.values:
                self.begin()
                self._begun = dict(self.values)
            return self.output(name)

        def assign(value: Any) -> None:
            if not given or (fixed and self.running):
                what = (
                    "a fixed parameter, which cannot be set after initialization"
                    if given
                    else f"an {causality} variable"
                )
                raise FmuError(f"{name} is {what}, got {value!r}")
            self.values[name] = value

        kinds = {"causality": Fmi2Causality[causality], "variability": Fmi2Variability[variable["variability"]]}
        self.register_variable(_TYPES[kind](name, **kinds, getter=get, setter=assign), nested=False)

    def _get_fmu_state(self) -> bytes:
        meta = {"content": self.content, "running": self.running, "end": self.end, "values": self.values}
        return pack(_KIND, meta, {}, {"core": self.saved() if self.running else b""})

    def _set_fmu_state(self, state: bytes) -> None:
        meta, _, parts = unpack(_KIND, state)
        if meta["content"] != self.content:
            raise StateError(f"the state belongs to another FMU than {self.modelName} as it is here")
        before, self.values = self.values, meta["values"]
        try:
            if meta["running"]:
                self.restore(parts["core"])
        except StateError:
            self.values = before
            raise
        self.running, self.end, self._begun = meta["running"], meta["end"], None

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return bytes(state)  # checked when it is set: an exception here leaves pythonfmu with an object it has freed


for _name in (
    *("setup_experiment", "exit_initialization_mode", "do_step", "_get_fmu_state", "_set_fmu_state"),
    *(f"{verb}_{kind}" for verb in ("get", "set") for kind in ("real", "integer", "boolean", "string")),
):
    setattr(Slave, _name, _surviving(getattr(Slave, _name)))
