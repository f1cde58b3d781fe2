"""Co-simulation calls of FMI 2.0 and 3.0 under the same names, over fmpy's slaves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any, ClassVar

import fmpy
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave

__all__ = ["DRIVERS", "Driver"]


Log = Callable[[int, str], object]
"""Called with the status and the text of each message of an FMU's logger."""


class Driver(ABC):
    """An fmpy slave of one version of FMI.

    Parameters
    ----------
    folder : Path
        Unpacked archive.
    description
        fmpy's model description.
    instance_name : str

    Attributes
    ----------
    slave
        fmpy's, of ``fmpy_class``.
    platform : str
        Folder of this machine's library below ``binaries/``.
    real : str
        Type of real numbers.
    access : mapping
        Type of a variable → type whose functions get and set it.
    state, deserialise : str
        What the version's functions call a state, and its deserialisation.
    """

    fmpy_class: ClassVar[Any]
    platform: ClassVar[str]
    real: ClassVar[str]
    access: ClassVar[Mapping[str, str]]
    state: ClassVar[str]
    deserialise: ClassVar[str]

    def __init__(self, folder: Path, description: Any, instance_name: str) -> None:
        self.slave = self.fmpy_class(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=instance_name,
        )

    @abstractmethod
    def instantiate(self, log: Log) -> None:
        """Make the instance, with logging on."""

    @abstractmethod
    def begin(self, start_time: float, stop_time: float | None = None) -> None:
        """Set the experiment, s, and enter Initialization Mode."""

    def get(self, variables: Sequence[Any]) -> list[Any]:
        """Return the values of variables of one type, those of an array one after the other."""
        references = [variable.valueReference for variable in variables]
        return list(getattr(self.slave, f"get{self.access[variables[0].type]}")(references))

    def set(self, variables: Sequence[Any], values: Sequence[Any]) -> None:
        """Set variables of one type."""
        references = [variable.valueReference for variable in variables]
        getattr(self.slave, f"set{self.access[variables[0].type]}")(references, values)

    def save(self) -> bytes:
        """Return the state, serialised."""
        state = self._call_state("get")
        try:
            return bytes(self._call_state("serialize", state))
        finally:
            self._call_state("free", state)

    def restore(self, blob: bytes) -> None:
        """Take over a serialised state."""
        state = self._call_state(self.deserialise, blob)
        try:
            self._call_state("set", state)
        finally:
            self._call_state("free", state)

    def _call_state(self, verb: str, *arguments: Any) -> Any:
        return getattr(self.slave, f"{verb}{self.state}")(*arguments)


class _Fmi2Driver(Driver):
    fmpy_class = FMU2Slave
    platform = fmpy.platform
    real = "Real"
    access: ClassVar[Mapping[str, str]] = {
        "Real": "Real",
        "Integer": "Integer",
        "Enumeration": "Integer",
        "Boolean": "Boolean",
    }
    state, deserialise = "FMUstate", "deSerialize"

    def instantiate(self, log: Log) -> None:
        def keep(environment: Any, instance: bytes, status: int, category: bytes | None, message: bytes | None) -> None:
            log(status, _text(message))

        functions = fmi2CallbackFunctions()
        functions.logger = fmi2CallbackLoggerTYPE(keep)
        functions.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        functions.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.slave.instantiate(callbacks=functions, loggingOn=True)

    def begin(self, start_time: float, stop_time: float | None = None) -> None:
        self.slave.setupExperiment(startTime=start_time, stopTime=stop_time)
        self.slave.enterInitializationMode()


class _Fmi3Driver(Driver):
    fmpy_class = FMU3Slave
    platform = fmpy.platform_tuple
    real = "Float64"
    access: ClassVar[Mapping[str, str]] = {
        "Float64": "Float64",
        "Int32": "Int32",
        "Enumeration": "Int64",
        "Boolean": "Boolean",
    }
    state, deserialise = "FMUState", "deserialize"

    def instantiate(self, log: Log) -> None:
        def keep(environment: Any, status: int, category: bytes | None, message: bytes | None) -> None:
            log(status, _text(message))

        self.slave.instantiate(loggingOn=True, logMessage=keep)

    def begin(self, start_time: float, stop_time: float | None = None) -> None:
        self.slave.enterInitializationMode(startTime=start_time, stopTime=stop_time)

    def get(self, variables: Sequence[Any]) -> list[Any]:
        references = [variable.valueReference for variable in variables]
        n = sum(prod(variable.shape or ()) for variable in variables)
        return list(getattr(self.slave, f"get{self.access[variables[0].type]}")(references, n))


DRIVERS: Mapping[str, type[_Fmi2Driver | _Fmi3Driver]] = {"2": _Fmi2Driver, "3": _Fmi3Driver}
"""By the first digit of the version of FMI."""


def _text(message: bytes | None) -> str:
    return (message or b"").decode("utf-8", "replace")
