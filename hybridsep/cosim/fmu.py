"""Instance of an FMI 2.0 or 3.0 co-simulation FMU with access by variable name, a thin layer over fmpy."""

import logging
import os
import re
import shutil
import sys
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from ctypes import ArgumentError, c_bool, c_double, c_int, c_int32, c_int64, c_uint32, c_uint64
from dataclasses import dataclass
from functools import lru_cache, partial
from math import prod
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any

import fmpy
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

from ..base.errors import FmuError, check_kind, first_line, listed
from ..base.files import as_path, named_errors

_LOADING = threading.Lock()

logging.getLogger("hybridsep.fmu").addHandler(logging.NullHandler())  # our FMUs' refusals are part of our errors


@dataclass(frozen=True)
class _Version:
    """What differs between versions of FMI."""

    slave: type[Any]  # fmpy's
    platform: str  # folder of this machine's library below ``binaries/``
    prefix: str  # begin of the functions' names
    sized: bool  # whether they are told the number of values, which without arrays is the number of variables
    access: Mapping[str, str]  # type of a variable → type whose functions get and set it; real numbers first
    c_types: Mapping[str, Any]  # that type → type of C
    # what the version's functions call a state, and its deserialisation
    state: str
    deserialise: str


_VERSIONS = {
    "2": _Version(
        *(fmi2.FMU2Slave, fmpy.platform, "fmi2", False),
        access={"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"},
        c_types={"Real": c_double, "Integer": c_int, "Boolean": c_int},
        state="FMUstate",
        deserialise="deSerialize",
    ),
    "3": _Version(
        *(fmi3.FMU3Slave, fmpy.platform_tuple, "fmi3", True),
        access={name: name for name in ("Float64", "Int32", "UInt64", "Boolean")} | {"Enumeration": "Int64"},
        c_types={"Float64": c_double, "Int32": c_int32, "UInt64": c_uint64, "Int64": c_int64, "Boolean": c_bool},
        state="FMUState",
        deserialise="deserialize",
    ),
}
"""By the first digit of the version."""


def read_description(path: str | Path) -> Any:
    """Return fmpy's model description of an FMI 2.0 or 3.0 co-simulation FMU, which callers share: change none.

    FmuError if there is none at ``path``, or fmpy's validation has a finding.
    """
    path = as_path(path)
    if not path.is_file():
        raise FmuError(f"no FMU at {path}; build it first (hybridsep build)")
    status = path.stat()
    return _description(path.absolute(), status.st_ino, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _description(path: Path, *_file: int) -> Any:
    """Return the same; a file is read again when it is another one or has changed."""
    try:
        with path.open("rb") as archive:  # fmpy leaves one open that it has opened and refused
            found = fmpy.read_model_description(archive)
    except Exception as error:  # fmpy raises bare Exceptions here, of several lines
        raise FmuError(f"{path.name} is not a readable FMU: {first_line(' '.join(str(error).split()))}") from error
    if found.coSimulation is None or found.fmiVersion[0] not in _VERSIONS:
        kind = "one for model exchange" if found.coSimulation is None else f"FMI {found.fmiVersion}"
        raise FmuError(f"{path.name} must be an FMI 2.0 or 3.0 co-simulation FMU, got {kind}")
    return found


@contextmanager
def _working_directory() -> Iterator[Path]:
    """Give the process's working directory to one thread at a time, and restore it."""
    # fmpy changes it, for the whole process, while it loads a library, and leaves it changed if that fails
    with _LOADING:
        try:
            folder = Path.cwd()
        except FileNotFoundError as error:
            raise FmuError("the working directory of this process no longer exists; change to another one") from error
        try:
            yield folder
        finally:
            os.chdir(folder)


class FmuInstance(AbstractContextManager["FmuInstance"]):
    """An instance of a co-simulation FMU; use it as a context manager, or close it.

    Instances may live in several threads, each used by one thread at a time: they are loaded one after the other and
    step in parallel. While one is loaded, the working directory of the process is another for some milliseconds.

    FmuError if the archive cannot be read, is no FMI 2.0 or 3.0 co-simulation FMU, has no library for this platform, or
    refuses to be instantiated. A library's code runs in this process, and a damaged one may end it.

    ``path`` is the archive, ``instance_name`` the name in log messages, the archive's stem if left out. ``description``
    is fmpy's model description, ``variables`` has fmpy's variables by name, and ``log`` the messages of the FMU's
    logger, ``(status, message)``, at most the last 1000.
    """

    def __init__(self, path: str | Path, instance_name: str | None = None) -> None:
        self.path = as_path(path)
        self.log: list[tuple[int, str]] = []
        with _working_directory() as folder:
            archive = folder / self.path
        self.description = read_description(archive)
        self.variables: dict[str, Any] = {v.name: v for v in self.description.modelVariables}
        self._version = _VERSIONS[self.description.fmiVersion[0]]
        self._release: weakref.finalize[..., FmuInstance] | None = None
        folder = Path(mkdtemp())
        try:
            self._load(archive, folder, instance_name or self.path.stem)
        except BaseException:
            self.close()
            _remove(folder)
            raise

    def _load(self, archive: Path, folder: Path, instance_name: str) -> None:
        identifier, version = self.description.coSimulation.modelIdentifier, self._version
        place = f"binaries/{version.platform}/{identifier}{fmpy.sharedLibraryExtension}"
        unused = ("sources/", "documentation/")  # folders with most of an archive's files, which no run needs
        try:
            with named_errors(gettempdir()):
                fmpy.extract(str(archive), folder, include=lambda name: not name.startswith(unused))
            if not (folder / place).is_file():
                there = sorted(path.name for path in (folder / "binaries").glob("*") if path.is_dir())
                raise FmuError(f"{place} is missing, there are binaries for {listed(there, str)}")
            with _working_directory():
                guid, unpacked = self.description.guid, str(folder)
                slave = version.slave(
                    guid=guid, unzipDirectory=unpacked, modelIdentifier=identifier, instanceName=instance_name
                )
        except Exception as error:  # fmpy raises bare Exceptions here
            if isinstance(error, OSError) and error.filename is not None:  # the disk's, with a name
                raise
            raise FmuError(f"{self.path.name} cannot be loaded: {first_line(error)}") from error
        try:
            _instantiate(slave, version, self.log)
        except Exception as error:
            slave.freeLibrary()
            raise FmuError(f"{self.path.name} cannot be instantiated: {error}{self._last_words()}") from error
        self._slave = slave
        self._release = weakref.finalize(self, _release, slave, folder)  # also of an instance that nobody closes

    @property
    def slave(self) -> Any:
        """The instance as fmpy's slave, for FMI calls that have no method here; FmuError if it is closed."""
        if self._release is None or not self._release.alive:
            raise FmuError(f"{self.path.name}: the instance is closed; make a new FmuInstance")
        return self._slave

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and its unpacked files; closing again does nothing."""
        if self._release is not None:
            self._release()

    def initialise(self, values: Mapping[str, Any] | None = None, *, start_time: float = 0.0) -> None:
        """Set parameters and start values and run through the initialization.

        FmuError if the FMU refuses; its own message is part of the error.
        """
        self.begin(values, start_time=start_time)
        self.finish()

    def begin(
        self, values: Mapping[str, Any] | None = None, *, start_time: float = 0.0, stop_time: float | None = None
    ) -> None:
        """Set structural parameters, enter Initialization Mode, set the others; errors as :meth:`initialise`."""
        check_kind(Mapping | None, values=values)
        slave, experiment = self.slave, {"startTime": start_time, "stopTime": stop_time}
        given = dict(values or {})
        structural = [name for name in given if self._variable(name).causality == "structuralParameter"]
        if structural:
            self._call(slave.enterConfigurationMode)
            for name in structural:
                self.set(name, given.pop(name))
            self._call(slave.exitConfigurationMode)
        if self._version.prefix == "fmi2":
            self._call(slave.setupExperiment, **experiment)
            self._call(slave.enterInitializationMode)
        else:
            self._call(slave.enterInitializationMode, **experiment)
        for name, value in given.items():
            self.set(name, value)

    def finish(self) -> None:
        """End the initialization; for errors see :meth:`initialise`."""
        self._call(self.slave.exitInitializationMode)

    def set(self, name: str, value: Any) -> None:
        """Set one variable."""
        variable, access = self._variable(name), self._version.access
        whole = ("Integer", "Int32", "UInt64", "Enumeration")
        if variable.type in whole and not (isinstance(value, int) and abs(value) < 2**31):
            raise FmuError(f"{self.path.name}: {name} must be a whole number within ±{2**31 - 1}, got {value!r}")
        if variable.type == next(iter(access)) and not isinstance(value, (int, float)):
            raise FmuError(f"{self.path.name}: {name} must be a number, got {value!r}")
        call, buffer = self._prepared("Set", [variable])
        buffer[:] = [value]
        self._call(call)

    def get(self, name: str) -> Any:
        """Return one variable; of an array a list."""
        values = self.reader([name])()
        return values if self.variables[name].shape else values[0]

    def real_stepper(self, names: Sequence[str]) -> Callable[[Sequence[float], float, float], None]:
        """Return a function of values, ``t`` and ``h`` that sets these real numbers, in one FMI call, and steps."""
        call, buffer = self._prepared("Set", list(map(self._variable, names)))
        do_step = self.slave.doStep

        def step(values: Sequence[float], t: float, h: float) -> None:
            buffer[:] = values
            call()
            do_step(t, h)

        return partial(self._call, step)

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """Return a function that gets these variables in one FMI call for each type, an array's one after the other."""
        of_type: dict[str, list[Any]] = {}
        for variable in map(self._variable, names):
            of_type.setdefault(self._version.access[variable.type], []).append(variable)
        prepared = [self._prepared("Get", variables) for variables in of_type.values()]
        got = [v.name for variables in of_type.values() for v in variables for _ in range(self._size(v))]
        places = [i for name in names for i, one in enumerate(got) if one == name]

        def read() -> list[Any]:
            for call, _ in prepared:
                call()
            values = [value for _, buffer in prepared for value in buffer]
            return [values[place] for place in places]

        return partial(self._call, read)

    def step(self, t: float, h: float) -> None:
        """Do one communication step from ``t`` by ``h`` seconds."""
        self._call(self.slave.doStep, t, h)

    def reset(self) -> None:
        """Return to the state after instantiation."""
        self._call(self.slave.reset)

    def save(self) -> bytes:
        """Return the whole state, serialised."""
        state = self._call_state("get")
        try:
            return bytes(self._call_state("serialize", state))
        finally:
            self._call_state("free", state)

    def restore(self, blob: bytes) -> None:
        """Take over a state that :meth:`save` returned, of this or another instance."""
        check_kind(bytes, blob=blob)
        state = self._call_state(self._version.deserialise, blob)
        try:
            self._call_state("set", state)
        finally:
            self._call_state("free", state)

    def _variable(self, name: str) -> Any:
        """Return a variable; FmuError if there is none, or one of a type that is not supported."""
        check_kind(str, name=name)
        if name not in self.variables:
            raise FmuError(f"{self.path.name} has no variable {name!r}")
        variable = self.variables[name]
        if variable.type not in self._version.access:
            raise FmuError(f"{self.path.name}: {name} is a {variable.type}, which is not supported here")
        return variable

    def _size(self, variable: Any) -> int:
        """Return the number of a variable's values, of an array as its structural parameters are now."""
        return prod(int(one.start) if one.start else self.get(one.variable.name) for one in variable.dimensions)

    def _prepared(self, verb: str, variables: Sequence[Any]) -> tuple[Callable[[], object], Any]:
        """Return an FMI call that gets or sets variables of one type, and the array of C that holds their values."""
        version, slave = self._version, self.slave
        kind = version.access[variables[0].type]
        n = sum(map(self._size, variables))
        references = (c_uint32 * len(variables))(*(variable.valueReference for variable in variables))
        values = (version.c_types[kind] * n)()
        arguments = (slave.component, references, len(variables), values, *((n,) if version.sized else ()))
        return partial(getattr(slave, f"{version.prefix}{verb}{kind}"), *arguments), values

    def _call_state(self, verb: str, *arguments: Any) -> Any:
        return self._call(getattr(self.slave, f"{verb}{self._version.state}"), *arguments)

    def _call(self, function: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
        """Call a function of the instance; FmuError if it is closed or refuses."""
        _ = self.slave  # raises if closed
        try:
            return function(*arguments, **keywords)
        except (FMICallException, ArgumentError, OSError) as error:  # OSError of Windows, not a signal
            raise FmuError(f"{self.path.name}: {error}{self._last_words()}") from error

    def _last_words(self) -> str:
        """Return the last message, without pythonfmu's frame around an exception."""
        if not self.log:
            return ""
        text = self.log[-1][1]
        framed = re.search(r"\w+Error\(([\"'])(.*)\1\)", text, re.DOTALL)
        return f": {' '.join((framed[2] if framed else text).split())[:1000]}"


def _instantiate(slave: Any, version: _Version, log: list[tuple[int, str]]) -> None:
    """Make the instance with logging on; ``log`` keeps the last messages, and holds on to no instance."""

    def keep(status: int, message: bytes | None) -> None:
        log.append((status, (message or b"").decode("utf-8", "replace")))
        del log[:-1000]

    if version.prefix == "fmi3":
        slave.instantiate(loggingOn=True, logMessage=lambda _environment, status, _category, text: keep(status, text))
        return
    functions = fmi2.fmi2CallbackFunctions()
    functions.logger = fmi2.fmi2CallbackLoggerTYPE(lambda _place, _name, status, _kind, text: keep(status, text))
    functions.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    functions.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    slave.instantiate(callbacks=functions, loggingOn=True)


def _release(slave: Any, folder: Path) -> None:
    """Free an instance, its library and its unpacked files."""
    try:
        with suppress(FMICallException):
            slave.terminate()
        slave.freeInstance()
    finally:
        _remove(folder)


def _remove(folder: Path) -> None:
    """Remove the unpacked files, from ``sys.path`` too, where pythonfmu puts the resources and leaves them."""
    shutil.rmtree(folder, ignore_errors=True)
    with suppress(ValueError):
        sys.path.remove((folder / "resources").as_posix())
