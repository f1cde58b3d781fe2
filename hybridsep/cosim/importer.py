"""Instance of an FMI 2.0 or 3.0 co-simulation FMU with access by variable name, a thin layer over fmpy."""

from __future__ import annotations

import logging
import os
import re
import shutil
import sys
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import lru_cache, partial
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import Any

import fmpy
from fmpy.fmi1 import FMICallException

from ..base.errors import FmuError, first_line, listed
from ..base.output import named_errors
from .driver import DRIVERS, Driver

__all__ = ["FmuInstance", "read_description"]


def read_description(path: str | Path) -> Any:
    """Return fmpy's model description of an FMI 2.0 or 3.0 co-simulation FMU, which callers share: change none.

    Raises
    ------
    FmuError
        If there is none at ``path``.
    """
    path = Path(path)
    if not path.is_file():
        raise FmuError(f"no FMU at {path}; build it first (hybridsep build)")
    status = path.stat()
    return _description(path.absolute(), status.st_ino, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _description(path: Path, *_file: int) -> Any:
    """Return the same; a file is read again when it is another one or has changed."""
    try:
        with path.open("rb") as archive:  # fmpy leaves one open that it has opened and refused
            description = fmpy.read_model_description(archive)
    except Exception as error:  # fmpy raises bare Exceptions here, of several lines
        raise FmuError(f"{path.name} is not a readable FMU: {first_line(' '.join(str(error).split()))}") from error
    if description.coSimulation is None or description.fmiVersion[0] not in DRIVERS:
        kind = "one for model exchange" if description.coSimulation is None else f"FMI {description.fmiVersion}"
        raise FmuError(f"{path.name} must be an FMI 2.0 or 3.0 co-simulation FMU, got {kind}")
    return description


_WORDS_MAX = 1000
"""Most characters of an FMU's message in an error."""

logging.getLogger("hybridsep.fmu").addHandler(logging.NullHandler())  # our FMUs' refusals are part of our errors

_LOADING = threading.Lock()


@contextmanager
def _working_directory() -> Iterator[Path]:
    """Give the process's working directory to one thread at a time, and restore it.

    fmpy changes it, for the whole process, while it loads a library, and leaves it changed if that fails.
    """
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
        fmpy's variables by name.
    log : list of (status, message)
        Messages of the FMU's logger; at most the last 1000.

    Raises
    ------
    FmuError
        If the archive cannot be read, is no FMI 2.0 or 3.0 co-simulation FMU, has no library for this platform, or
        refuses to be instantiated. A library's code runs in this process, and may end it.
    """

    def __init__(self, path: str | Path, instance_name: str | None = None) -> None:
        self.path = Path(path)
        self.log: list[tuple[int, str]] = []
        with _working_directory() as folder:
            archive = folder / self.path
        self.description = read_description(archive)
        self.variables: dict[str, Any] = {v.name: v for v in self.description.modelVariables}
        self._release: weakref.finalize[..., FmuInstance] | None = None
        folder = Path(mkdtemp())
        try:
            self._instantiate(archive, folder, instance_name or self.path.stem)
        except BaseException:
            self.close()
            _remove(folder)
            raise

    def _instantiate(self, archive: Path, folder: Path, instance_name: str) -> None:
        """Unpack the archive, load its library and make the instance."""
        try:
            with named_errors(gettempdir()):
                fmpy.extract(str(archive), folder, include=_serves_a_run)
        except OSError:  # the disk's, with a name
            raise
        except Exception as error:  # fmpy raises bare Exceptions here
            raise FmuError(f"{self.path.name} cannot be loaded: {first_line(error)}") from error
        made = DRIVERS[self.description.fmiVersion[0]]
        try:
            self._check_library(folder, f"binaries/{made.platform}")
            with _working_directory():
                driver = made(folder, self.description, instance_name)
        except Exception as error:  # fmpy raises bare Exceptions here
            reason = error if isinstance(error, FmuError) else first_line(error)
            raise FmuError(f"{self.path.name} cannot be loaded: {reason}") from error
        try:
            driver.instantiate(_keeper(self.log))
        except Exception as error:
            driver.slave.freeLibrary()
            raise FmuError(f"{self.path.name} cannot be instantiated: {error}{self._last_words()}") from error
        self._driver = driver
        # Also for an instance that nobody closes: pythonfmu 0.7 corrupts the heap where the process exits before
        self._release = weakref.finalize(self, _release, driver.slave, folder)

    def _check_library(self, folder: Path, binaries: str) -> None:
        """Raise FmuError if there is no library for this platform."""
        place = f"{binaries}/{self.description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
        if not (folder / place).is_file():
            there = sorted(path.name for path in (folder / "binaries").glob("*") if path.is_dir())
            raise FmuError(f"{place} is missing, there are binaries for {listed(there, str)}")

    @property
    def slave(self) -> Any:
        """The instance as fmpy's slave, for FMI calls that have no method here.

        Raises
        ------
        FmuError
            If the instance is closed.
        """
        return self._open.slave

    @property
    def _open(self) -> Driver:
        self._check_open()
        return self._driver

    def _check_open(self) -> None:
        if self._release is None or not self._release.alive:
            raise FmuError(f"{self.path.name}: the instance is closed; make a new FmuInstance")

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and its unpacked files; closing again does nothing."""
        if self._release is not None:
            self._release()

    def initialise(self, values: Mapping[str, Any] | None = None, *, start_time: float = 0.0) -> None:
        """Set parameters and start values and run through the initialization.

        Raises
        ------
        FmuError
            If the FMU refuses; its own message is part of the error.
        """
        self.begin(values, start_time=start_time)
        self.finish()

    def begin(
        self, values: Mapping[str, Any] | None = None, *, start_time: float = 0.0, stop_time: float | None = None
    ) -> None:
        """Enter Initialization Mode and set parameters and start values; for errors see :meth:`initialise`."""
        self._call(self._open.begin, start_time, stop_time)
        for name, value in (values or {}).items():
            self.set(name, value)

    def finish(self) -> None:
        """End the initialization; for errors see :meth:`initialise`."""
        self._call(self.slave.exitInitializationMode)

    def set(self, name: str, value: Any) -> None:
        """Set one variable."""
        driver, variable = self._open, self._variable(name)
        if variable.type in ("Integer", "Int32", "Enumeration") and not (isinstance(value, int) and abs(value) < 2**31):
            raise FmuError(f"{self.path.name}: {name} must be a whole number within ±{2**31 - 1}, got {value!r}")
        if variable.type == driver.real and not isinstance(value, (int, float)):
            raise FmuError(f"{self.path.name}: {name} must be a number, got {value!r}")
        self._check_type(variable)
        self._call(driver.writer([variable]), [value])

    def get(self, name: str) -> Any:
        """Return one variable; of an array a list."""
        driver, variable = self._open, self._variable(name)
        self._check_type(variable)
        values = self._call(driver.reader([variable]))
        return values if variable.shape else values[0]

    def real_stepper(self, names: Sequence[str]) -> Callable[[Sequence[float], float, float], None]:
        """Return a function of values, ``t`` and ``h`` that sets these real numbers, in one FMI call, and steps."""
        write = self._open.writer([self._variable(name) for name in names])
        do_step = self.slave.doStep

        def step(values: Sequence[float], t: float, h: float) -> None:
            write(values)
            do_step(t, h)

        return partial(self._call_open, step)

    def real_writer(self, names: Sequence[str]) -> Callable[[Sequence[float]], None]:
        """Return a function that sets these real numbers in one FMI call."""
        return partial(self._call_open, self._open.writer([self._variable(name) for name in names]))

    def real_reader(self, names: Sequence[str]) -> Callable[[], list[float]]:
        """Return a function that gets these real numbers in one FMI call, an array's one after the other."""
        return partial(self._call_open, self._open.reader([self._variable(name) for name in names]))

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """Return a function that gets these variables, none of them an array, in one FMI call for each type."""
        of_type: dict[str, list[Any]] = {}
        for name in names:
            variable = self._variable(name)
            self._check_type(variable)
            of_type.setdefault(self._open.access[variable.type], []).append(variable)
        reads = [self._open.reader(variables) for variables in of_type.values()]
        got = [variable.name for variables in of_type.values() for variable in variables]
        places = [got.index(name) for name in names]

        def read() -> list[Any]:
            values = [value for read_type in reads for value in read_type()]
            return [values[place] for place in places]

        return partial(self._call_open, read)

    def step(self, t: float, h: float) -> None:
        """Do one communication step from ``t`` by ``h`` seconds."""
        self._call(self.slave.doStep, t, h)

    def reset(self) -> None:
        """Return to the state after instantiation."""
        self._call(self.slave.reset)

    def save(self) -> bytes:
        """Return the whole state, serialised."""
        return bytes(self._call(self._open.save))

    def restore(self, blob: bytes) -> None:
        """Take over a state that :meth:`save` returned, of this or another instance."""
        self._call(self._open.restore, blob)

    def _check_type(self, variable: Any) -> None:
        """Raise FmuError for a variable of a type that is not supported."""
        if variable.type not in self._open.access:
            raise FmuError(f"{self.path.name}: {variable.name} is a {variable.type}, which is not supported here")

    def _variable(self, name: str) -> Any:
        if name not in self.variables:
            raise FmuError(f"{self.path.name} has no variable {name!r}")
        return self.variables[name]

    def _call_open(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function that was made for this instance, if it is still open."""
        self._check_open()
        return self._call(function, *arguments)

    def _call(self, function: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
        try:
            return function(*arguments, **keywords)
        except (FMICallException, OSError) as error:  # on Windows ctypes raises OSError where others have a signal
            raise FmuError(f"{self.path.name}: {error}{self._last_words()}") from error

    def _last_words(self) -> str:
        """Return the last message, without pythonfmu's frame around an exception."""
        if not self.log:
            return ""
        text = self.log[-1][1]
        framed = re.search(r"\w+Error\(([\"'])(.*)\1\)", text, re.DOTALL)
        return f": {' '.join((framed[2] if framed else text).split())[:_WORDS_MAX]}"


def _serves_a_run(name: str) -> bool:
    """Return whether a file of an archive can serve a run; sources and documentation are most files and never do."""
    return not name.startswith(("sources/", "documentation/"))


def _keeper(log: list[tuple[int, str]]) -> Callable[[int, str], None]:
    """Return a function that puts an FMU's messages into ``log``, of which it keeps the last."""

    def keep(status: int, message: str) -> None:
        log.append((status, message))
        del log[:-1000]

    return keep


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
