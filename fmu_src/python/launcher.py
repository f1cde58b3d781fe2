"""Load the slave beside this file, and refuse instances if that fails, as without SciPy, with the reason and a way out.

With the importer's logging off pythonfmu passes on no message; the reason goes to stderr, too.
"""

from __future__ import annotations

import atexit
import ctypes
import logging
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
        """Slave that refuses to be made."""

        def __init__(self, **kwargs: Any) -> None:
            logging.getLogger("hybridsep.fmu").error("%s: %s", kwargs.get("instance_name"), REASON)
            raise RuntimeError(REASON)

        def do_step(self, current_time: float, step_size: float) -> bool:
            """Never be called."""
            return False
