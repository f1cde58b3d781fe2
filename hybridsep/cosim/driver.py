"""Co-simulation calls of FMI 2.0 and 3.0 under the same names, over fmpy's slaves."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_bool, c_double, c_int, c_int32, c_int64, c_uint32
from functools import partial
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
    c_types : mapping
        That type → type of C.
    prefix : str
        Begin of the functions' names.
    sized : bool
        Whether they are told the number of values, which without arrays is the number of variables.
    state, deserialise : str
        What the version's functions call a state, and its deserialisation.
    """

    fmpy_class: ClassVar[Any]
    platform: ClassVar[str]
    real: ClassVar[str]
    access: ClassVar[Mapping[str, str]]
    c_types: ClassVar[Mapping[str, Any]]
    prefix: ClassVar[str]
    sized: ClassVar[bool]
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

    def reader(self, variables: Sequence[Any]) -> Callable[[], list[Any]]:
        """Return a function that gets variables of one type in one FMI call, an array's one after the other."""
        call, values = self._prepared("Get", variables)

        def read() -> list[Any]:
            call()
            return list(values)

        return read

    def writer(self, variables: Sequence[Any]) -> Callable[[Sequence[Any]], None]:
        """Return a function that sets variables of one type in one FMI call, an array's one after the other."""
        call, buffer = self._prepared("Set", variables)

        def write(values: Sequence[Any]) -> None:
            buffer[:] = values
            call()

        return write

    def _prepared(self, verb: str, variables: Sequence[Any]) -> tuple[Callable[[], object], Any]:
        """Return an FMI call that gets or sets variables, and the array of C that their values go through."""
        kind = self.access[variables[0].type]
        n = sum(prod(variable.shape or ()) for variable in variables)
        references = (c_uint32 * len(variables))(*(variable.valueReference for variable in variables))
        values = (self.c_types[kind] * n)()
        arguments = (self.slave.component, references, len(variables), values, *((n,) if self.sized else ()))
        return partial(getattr(self.slave, f"{self.prefix}{verb}{kind}"), *arguments), values

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
    c_types: ClassVar[Mapping[str, Any]] = {"Real": c_double, "Integer": c_int, "Boolean": c_int}
    prefix, sized = "fmi2", False
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
    c_types: ClassVar[Mapping[str, Any]] = {"Float64": c_double, "Int32": c_int32, "Int64": c_int64, "Boolean": c_bool}
    prefix, sized = "fmi3", True
    state, deserialise = "FMUState", "deserialize"

    def instantiate(self, log: Log) -> None:
        def keep(environment: Any, status: int, category: bytes | None, message: bytes | None) -> None:
            log(status, _text(message))

        self.slave.instantiate(loggingOn=True, logMessage=keep)

    def begin(self, start_time: float, stop_time: float | None = None) -> None:
        self.slave.enterInitializationMode(startTime=start_time, stopTime=stop_time)


DRIVERS: Mapping[str, type[_Fmi2Driver | _Fmi3Driver]] = {"2": _Fmi2Driver, "3": _Fmi3Driver}
"""By the first digit of the version of FMI."""


def _text(message: bytes | None) -> str:
    return (message or b"").decode("utf-8", "replace")
