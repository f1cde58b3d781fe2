"""One instance of an FMI 2.0 co-simulation FMU, by variable names; a thin layer over fmpy."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import gettempdir
from types import TracebackType
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)

from .errors import FmuError
from .interrupt import uninterrupted
from .output import named_errors

__all__ = ["FmuInstance", "read_description"]


def read_description(path: str | Path) -> Any:
    """Return fmpy's model description of an FMI 2.0 co-simulation FMU.

    Raises
    ------
    FmuError
        If there is none at ``path``.
    """
    path = Path(path)
    if not path.is_file():
        raise FmuError(f"no FMU at {path}; build it first (hybridsep build)")
    try:
        description = fmpy.read_model_description(str(path), validate=False)
    except Exception as error:  # fmpy raises bare Exceptions here
        raise FmuError(
            f"{path.name} is not a readable FMU: {(str(error) or type(error).__name__).splitlines()[0]}"
        ) from error
    if description.fmiVersion != "2.0":
        raise FmuError(f"{path.name} must be an FMI 2.0 FMU, got FMI {description.fmiVersion}")
    if description.coSimulation is None:
        raise FmuError(f"{path.name} must be a co-simulation FMU, got one for model exchange only")
    return description


class FmuInstance:
    """An instance of a co-simulation FMU; use it as a context manager.

    Parameters
    ----------
    path : str or Path
        The archive.
    instance_name : str, optional
        Shown in log messages; the archive's stem if left out.

    Attributes
    ----------
    description : fmpy's model description
    variables : dict
        fmpy's scalar variables by name.
    log : list of (status, message)
        What the FMU said through its logger; at most the last 1000 messages.

    Raises
    ------
    FmuError
        If the archive cannot be read, is no FMI 2.0 co-simulation FMU, or refuses to be instantiated.
    """

    def __init__(self, path: str | Path, instance_name: str | None = None) -> None:
        self.path = Path(path)
        self.log: list[tuple[int, str]] = []
        self.description = read_description(self.path)
        self.variables: dict[str, Any] = {v.name: v for v in self.description.modelVariables}
        with named_errors(gettempdir()):
            self._folder = fmpy.extract(str(self.path))
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._on_log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        try:
            self._instantiate(instance_name or self.path.stem)
        except Exception as error:  # fmpy raises bare Exceptions here
            shutil.rmtree(self._folder, ignore_errors=True)
            raise FmuError(f"{self.path.name} cannot be instantiated: {error}{self._last_words()}") from error
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> FmuInstance:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @uninterrupted
    def close(self) -> None:
        """Free the instance and its unpacked files."""
        with suppress(FMICallException):
            self.slave.terminate()
        self.slave.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    def initialise(self, values: Mapping[str, Any] | None = None, *, start_time: float = 0.0) -> None:
        """Set parameters and start values and run through the initialization.

        Raises
        ------
        FmuError
            If the FMU refuses; its own message is part of the error.
        """
        self._call(self.slave.setupExperiment, startTime=start_time)
        self._call(self.slave.enterInitializationMode)
        for name, value in (values or {}).items():
            self.set(name, value)
        self._call(self.slave.exitInitializationMode)

    def set(self, name: str, value: Any) -> None:
        """Set one variable."""
        variable = self._variable(name)
        if variable.type == "Integer" and not (isinstance(value, int) and abs(value) < 2**31):
            raise FmuError(f"{self.path.name}: {name} must be a whole number within ±{2**31 - 1}, got {value!r}")
        if variable.type == "Real" and not isinstance(value, (int, float)):
            raise FmuError(f"{self.path.name}: {name} must be a number, got {value!r}")
        if variable.type not in ("Real", "Integer", "Boolean"):
            raise FmuError(f"{self.path.name}: {name} is a {variable.type}, which is not supported here")
        setter = {"Real": self.slave.setReal, "Integer": self.slave.setInteger, "Boolean": self.slave.setBoolean}
        self._call(setter[variable.type], [variable.valueReference], [value])

    def get(self, name: str) -> Any:
        """Return one variable."""
        variable = self._variable(name)
        getter = {"Real": self.slave.getReal, "Integer": self.slave.getInteger, "Boolean": self.slave.getBoolean}
        return self._call(getter[variable.type], [variable.valueReference])[0]

    def real_writer(self, names: Sequence[str]) -> Callable[[Sequence[float]], None]:
        """Return a function that sets these Reals in one FMI call."""
        references = [self._variable(name).valueReference for name in names]
        return lambda values: self._call(self.slave.setReal, references, values)

    def real_reader(self, names: Sequence[str]) -> Callable[[], list[float]]:
        """Return a function that gets these Reals in one FMI call."""
        references = [self._variable(name).valueReference for name in names]
        return lambda: list(self._call(self.slave.getReal, references))

    def step(self, t: float, h: float) -> None:
        """Do one communication step from ``t`` by ``h`` seconds."""
        self._call(self.slave.doStep, t, h)

    def reset(self) -> None:
        """Return to the state after instantiation."""
        self._call(self.slave.reset)

    def save(self) -> bytes:
        """Return the whole state, serialised."""
        state = self._call(self.slave.getFMUstate)
        try:
            return bytes(self._call(self.slave.serializeFMUstate, state))
        finally:
            self._call(self.slave.freeFMUstate, state)

    def restore(self, blob: bytes) -> None:
        """Take over a state that :meth:`save` returned, of this or another instance."""
        state = self._call(self.slave.deSerializeFMUstate, blob)
        try:
            self._call(self.slave.setFMUstate, state)
        finally:
            self._call(self.slave.freeFMUstate, state)

    @uninterrupted
    def _instantiate(self, name: str) -> None:
        self.slave = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate(callbacks=self._callbacks, loggingOn=True)

    def _variable(self, name: str) -> Any:
        if name not in self.variables:
            raise FmuError(f"{self.path.name} has no variable {name!r}")
        return self.variables[name]

    @uninterrupted
    def _call(self, function: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
        try:
            return function(*arguments, **keywords)
        except FMICallException as error:
            raise FmuError(f"{self.path.name}: {error}{self._last_words()}") from error

    def _on_log(self, environment: Any, instance: bytes, status: int, category: bytes | None, message: bytes) -> None:
        self.log.append((status, message.decode("utf-8", "replace")))
        del self.log[:-1000]

    def _last_words(self) -> str:
        """Return the last message, without pythonfmu's frame around an exception."""
        if not self.log:
            return ""
        text = self.log[-1][1]
        framed = re.search(r"\w+Error\(([\"'])(.*)\1\)", text, re.DOTALL)
        return f": {framed[2] if framed else text}"
