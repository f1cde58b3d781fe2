"""A native FMU run from its own content, before it is an archive: the model of its reference results.

It calls the functions of FMI 2.0, which the library of an FMI 3.0 FMU has as well.
"""

from __future__ import annotations

import _ctypes
import ctypes
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..base.errors import FmuError
from .compiler import TARGETS, host_target
from .fmu_table import FmuTable
from .libraries import libraries
from .table_file import TABLE_FILE, table_file

__all__ = ["HostFmu", "host_fmu"]

_CO_SIMULATION = 1
_OK = 0
_KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
"""Kind of a variable → the FMI functions' name of it."""


class _Values:
    """Room for the values of variables of one kind, which one call gets.

    Parameters
    ----------
    kind : str
        Of the values of ``_KINDS``.
    references : sequence of int
    """

    def __init__(self, kind: str, references: Sequence[int]) -> None:
        number = ctypes.c_double if kind == "Real" else ctypes.c_int
        self.kind, self.n = kind, ctypes.c_size_t(len(references))
        self.references = (ctypes.c_uint * len(references))(*references)
        self.values = (number * len(references))()


class HostFmu:
    """An instance of a native FMU with its start values, sample by sample.

    Parameters
    ----------
    library : ctypes.CDLL
        Of its kind.
    table : FmuTable
    guid : str
    resources : Path
    T_s : float, s
    """

    def __init__(self, library: ctypes.CDLL, table: FmuTable, guid: str, resources: Path, T_s: float) -> None:
        variables = list(enumerate(table.variables))
        self._inputs = [i for i, variable in variables if variable.causality == "input"]
        outputs = [(i, _KINDS[variable.kind]) for i, variable in variables if variable.causality == "output"]
        self._outputs = [_Values(kind, [i for i, _ in same]) for kind, same in groupby(outputs, lambda each: each[1])]
        self._library, self._T_s, self._k = library, T_s, 0
        library.fmi2Instantiate.restype = ctypes.c_void_p
        text = [table.name.encode(), guid.encode(), resources.as_uri().encode()]
        self._component = ctypes.c_void_p(
            library.fmi2Instantiate(text[0], _CO_SIMULATION, text[1], text[2], None, 0, 0)
        )
        if not self._component:
            raise FmuError(f"{table.name}: the FMU that is being built cannot be instantiated")
        self._call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(0.0), 0, ctypes.c_double(0.0))
        self._call("EnterInitializationMode")
        self._call("ExitInitializationMode")

    def outputs(self) -> list[float]:
        """Return all outputs, in the order of the table."""
        for outputs in self._outputs:
            self._call(f"Get{outputs.kind}", outputs.references, outputs.n, outputs.values)
        return [float(value) for outputs in self._outputs for value in outputs.values]

    def sample(self, *inputs: float) -> None:
        """Do one step of T_s, with all inputs in the order of the table."""
        n = len(self._inputs)
        self._call("SetReal", (ctypes.c_uint * n)(*self._inputs), ctypes.c_size_t(n), (ctypes.c_double * n)(*inputs))
        self._call("DoStep", ctypes.c_double(self._k * self._T_s), ctypes.c_double(self._T_s), 1)
        self._k += 1

    def close(self) -> None:
        """End the instance."""
        self._library.fmi2FreeInstance(self._component)

    def _call(self, name: str, *arguments: Any) -> None:
        if getattr(self._library, f"fmi2{name}")(self._component, *arguments) != _OK:
            raise FmuError(f"fmi2{name} was refused by the FMU that is being built")


@contextmanager
def host_fmu(table: FmuTable, guid: str, resources: Mapping[str, bytes], T_s: float) -> Iterator[HostFmu | None]:
    """Run an FMU on this machine; None where no library of its kind can be loaded here.

    Parameters
    ----------
    table : FmuTable
    guid : str
    resources : mapping
        Content of its resources by file name; the table is added.
    T_s : float, s
    """
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        library = _loaded(table.kind, Path(place))
        if library is None:
            yield None
            return
        for file, content in {**resources, TABLE_FILE: table_file(table, guid)}.items():
            (Path(place) / file).write_bytes(content)
        try:
            fmu = HostFmu(library, table, guid, Path(place), T_s)
            try:
                yield fmu
            finally:
                fmu.close()
        finally:
            _unload(library)


def _loaded(kind: str, folder: Path) -> ctypes.CDLL | None:
    """Return a copy of the kind's library for this machine, loaded from a folder."""
    try:
        target = host_target()
        file = folder / f"{kind}{TARGETS[target].suffix}"
        file.write_bytes(libraries(kind, (target,))[target])
        return ctypes.CDLL(str(file))
    except (FmuError, OSError):  # another platform or C library; a folder from which nothing may be loaded
        return None


def _unload(library: ctypes.CDLL) -> None:
    """Let go of a library, whose file Windows keeps as long as it is loaded."""
    release = "FreeLibrary" if sys.platform == "win32" else "dlclose"
    getattr(_ctypes, release)(library._handle)
