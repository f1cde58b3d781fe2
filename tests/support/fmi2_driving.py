"""Components of a native FMU, driven by FMI calls."""

from __future__ import annotations

import math
from pathlib import Path

from fmi2_library import OK, Library

STATES = ("instantiated", "Initialization Mode", "stepping", "terminated")


def library_of(folder: Path) -> Library:
    """Return the functions of an unpacked FMU."""
    (path,) = (folder / "binaries" / "linux64").iterdir()
    return Library(path, folder / "modelDescription.xml")


def component_in(fmu: Library, state: str) -> int:
    """Return a new component, brought into a state by legal calls."""
    component = fmu.instantiate()
    assert component is not None
    calls = ("EnterInitializationMode", "ExitInitializationMode", "Terminate")
    for name in calls[: STATES.index(state)]:
        assert getattr(fmu, name)(component) == OK
    return component


def steps(fmu: Library, component: int, first: int, last: int, start: float = 0.0) -> None:
    """Step through samples ``first … last - 1`` of a made-up motion."""
    for k in range(first, last):
        assert fmu.set(component, "x_d_ahead", 1e-3 * math.sin(0.02 * k)) == OK
        assert fmu.set(component, "x_meas", 1e-3 * math.sin(0.02 * k - 2.1) + 1e-5 * math.cos(0.3 * k)) == OK
        assert fmu.DoStep(component, start + k * 1e-3, 1e-3, 1) == OK
