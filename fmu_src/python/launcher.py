"""Load the slave beside this file, with what pythonfmu's binary needs to begin and end well."""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from pythonfmu import Fmi2Slave

# The binary runs this file for each instance, and gives up a reference to its names that it does not hold.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

# On Linux it gives up the interpreter in a destructor of C++ and again in one of the library, which counts down in
# memory that is free by then: the importer's heap is corrupted at its exit. What was given up before, both leave alone.
if sys.platform == "linux":
    for binary in (Path(__file__).parents[1] / "binaries" / "linux64").glob("*.so"):
        with suppress(OSError):  # the importer has loaded a copy from elsewhere
            library = ctypes.CDLL(str(binary), mode=os.RTLD_NOW | os.RTLD_NOLOAD)
            atexit.register(library.finalizePythonInterpreter)

try:
    import scipy.linalg  # noqa: F401 - the library loads it where it computes: too late to refuse
    from slave_module import *  # type: ignore[import-not-found]  # noqa: F403 - its class is found by its bases
except Exception as error:  # whatever a library that does not fit this Python raises
    REASON = f"{error}; the FMU needs a Python with NumPy and SciPy in the importing tool's process, and all its files"

    class UnusableSlave(Fmi2Slave):  # type: ignore[misc]
        """Slave that refuses to be made, where the error alone would end the importer's process."""

        def __init__(self, **_: Any) -> None:
            raise RuntimeError(REASON)

        def do_step(self, current_time: float, step_size: float) -> bool:
            """Never be called."""
            return False
