"""Calls that no FMU expects, made to pythonfmu's binary.

Run as a program: ``python tests/support/pythonfmu_calls.py FOLDER CASE``, the folder of an unpacked FeedDrivePy.

Some of them end the process, so each has one of its own; nothing is imported here that the FMU does not need.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from ctypes import byref, c_double, c_uint, c_void_p
from pathlib import Path
from typing import Any

from fmi2_library import DISCARD, FATAL, OK, Library


class Importer:
    """An importer that may do anything, with one unpacked FMU."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.resources = folder / "resources"
        (binary,) = (folder / "binaries" / "linux64").iterdir()
        self.library = Library(binary, folder / "modelDescription.xml")

    def instantiate(self, **changes: Any) -> int:
        arguments: dict[str, Any] = {"resources": f"file://{self.resources}", "logging_on": True} | changes
        component = self.library.instantiate(**arguments)
        assert component is not None, self.library.messages
        return component

    def initialised(self, **changes: Any) -> int:
        component = self.instantiate(**changes)
        assert self.library.SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0) == OK
        assert self.library.EnterInitializationMode(component) == OK
        assert self.library.ExitInitializationMode(component) == OK
        return component


def foreign_guid(importer: Importer) -> None:
    assert importer.instantiate(guid="{nonsense}")
    assert importer.instantiate(kind=0)


def freed_state(importer: Importer) -> None:
    component, state = importer.initialised(), c_void_p()
    assert importer.library.GetFMUstate(component, byref(state)) == OK
    assert importer.library.FreeFMUstate(component, byref(state)) == OK
    assert state.value


def damaged_state(importer: Importer) -> None:
    """pythonfmu takes any bytes for a state; they are refused when it is set, and the instance goes on."""
    component, state = importer.initialised(), c_void_p()
    assert importer.library.DeSerializeFMUstate(component, b"garbage", 7, byref(state)) == OK
    assert importer.library.SetFMUstate(component, state) == FATAL
    assert "saved state" in importer.library.messages[-1][2]
    assert importer.library.DoStep(component, 0.0, 1e-3, 1) == OK


def unknown_reference(importer: Importer) -> None:
    component, value = importer.initialised(), c_double()
    assert importer.library.GetReal(component, (c_uint * 1)(9999), 1, byref(value)) == FATAL
    said = importer.library.messages[-1][2]
    assert "value reference must be 0 … " in said
    assert "got 9999" in said
    assert importer.library.SetReal(component, (c_uint * 1)(9999), 1, byref(value)) == FATAL
    assert "got 9999" in importer.library.messages[-1][2]
    assert importer.library.GetReal(component, (c_uint * 1)(0), 1, byref(value)) == OK


def refused_experiments(importer: Importer) -> None:
    component = importer.instantiate()
    for start, stop, message in (
        (float("nan"), None, "the start time must be finite, got nan s"),
        (float("-inf"), None, "the start time must be finite, got -inf s"),
        (1.0, 0.5, "the stop time must be ≥ the start time 1 s, got 0.5 s"),
        (0.0, float("nan"), "the stop time must be ≥ the start time 0 s, got nan s"),
    ):
        status = importer.library.SetupExperiment(component, 0, 0.0, start, stop is not None, stop or 0.0)
        assert status == FATAL
        assert message in importer.library.messages[-1][2]
    assert importer.library.SetupExperiment(component, 0, 0.0, 2.0, 1, 3.0) == OK
    importer.library.EnterInitializationMode(component)
    importer.library.ExitInitializationMode(component)
    assert importer.library.DoStep(component, 2.0, 1e-3, 1) == OK
    importer.library.FreeInstance(component)


def lost_description(importer: Importer) -> None:
    """Before the instance is made, and before it is made again at a reset."""
    component = importer.initialised()
    file = importer.resources / "machine.json"
    file.unlink()
    for _ in range(3):
        assert importer.library.Reset(component) == OK
        assert importer.library.SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0) == OK
        assert importer.library.EnterInitializationMode(component) == OK
        assert importer.library.ExitInitializationMode(component) == OK
    assert importer.library.DoStep(component, 0.0, 1e-3, 1) == OK
    importer.library.FreeInstance(component)
    other = importer.resources.parent / "other"
    shutil.copytree(importer.resources, other)
    for content in (None, "{"):
        if content:
            (other / "machine.json").write_text(content)
        assert importer.library.instantiate(resources=f"file://{other}", logging_on=True) is None
        assert (
            f"{other}/machine.json cannot be read, unpack the whole archive again" in importer.library.messages[-1][2]
        )


def interrupted_steps(importer: Importer) -> None:
    """Ctrl-C inside a step, which is no Exception: the instance lives on, as after any other refusal."""
    component = importer.initialised()
    (slave,) = (module for name, module in sys.modules.items() if name.startswith("feed_drive_"))
    advance = slave.FeedDrivePy.advance

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    for _ in range(50):
        slave.FeedDrivePy.advance = interrupt
        assert importer.library.DoStep(component, 0.0, 1e-3, 1) == FATAL
        assert "KeyboardInterrupt" in importer.library.messages[-1][2]
        slave.FeedDrivePy.advance = advance
    assert importer.library.DoStep(component, 0.0, 1e-3, 1) == OK
    assert importer.library.DoStep(component, 0.0, float("nan"), 1) == DISCARD
    importer.library.FreeInstance(component)


def missing_library(importer: Importer) -> None:
    """Without SciPy the slave cannot be loaded: no instance, but a reason."""
    sys.modules["scipy"] = None  # type: ignore[assignment]  # importing it fails
    for _ in range(3):
        assert importer.library.instantiate(resources=f"file://{importer.resources}", logging_on=True) is None
        message = importer.library.messages[-1][2]
        assert "'scipy'" in message
        assert "needs a Python with NumPy and SciPy" in message


def lost_slave(importer: Importer) -> None:
    (slave,) = importer.resources.glob("feed_drive_*.py")
    slave.unlink()
    assert importer.library.instantiate(resources=f"file://{importer.resources}", logging_on=True) is None
    assert f"No module named '{slave.stem}'" in importer.library.messages[-1][2]


def refusals_with_logging_off(importer: Importer) -> None:
    """They have no message, so their text goes to stderr."""
    component = importer.initialised(logging_on=False)
    before = len(importer.library.messages)
    assert importer.library.DoStep(component, 0.0, float("nan"), 1) == DISCARD
    assert importer.library.SetupExperiment(component, 0, 0.0, float("nan"), 0, 0.0) == FATAL
    assert not [message for _, _, message in importer.library.messages[before:] if message]
    importer.library.FreeInstance(component)


CAUGHT: dict[str, Callable[[Importer], object]] = {
    function.__name__: function
    for function in (
        *(
            foreign_guid,
            freed_state,
            damaged_state,
            unknown_reference,
            refused_experiments,
            lost_description,
            interrupted_steps,
        ),
        *(missing_library, lost_slave, refusals_with_logging_off),
    )
}


if __name__ == "__main__":
    _, folder, case = sys.argv
    CAUGHT[case](Importer(Path(folder)))
    print("survived", flush=True)
