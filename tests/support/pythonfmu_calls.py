"""Calls that no FMU expects, made to pythonfmu's binary.

Run as a program: ``python tests/support/pythonfmu_calls.py FOLDER CASE``, the folder of an unpacked FeedDrivePy.

Some of them end the process, so each has one of its own.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from ctypes import byref, c_double, c_uint, c_void_p, create_string_buffer
from pathlib import Path
from typing import Any

from fmi_library import DISCARD, FATAL, OK, Library


class Importer(Library):
    """An importer that may do anything, with one unpacked FMU."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.resources = folder / "resources"

    def made(self, **changes: Any) -> int | None:
        return self.instantiate(**{"resources": f"file://{self.resources}", "logging_on": True, **changes})

    def initialised(self, **changes: Any) -> int:
        instance = self.made(**changes)
        assert instance is not None, self.messages
        assert self.begin(instance) == self.ExitInitializationMode(instance) == OK
        return instance

    @property
    def said(self) -> str:
        return self.messages[-1][2]


def foreign_guid(importer: Importer) -> None:
    assert importer.made(guid="{nonsense}")
    assert importer.made(kind=0)


def freed_and_damaged_states(importer: Importer) -> None:
    """pythonfmu takes any bytes for a state; they are refused when it is set, and the instance goes on."""
    instance, state = importer.initialised(), c_void_p()
    assert importer.GetFMUstate(instance, byref(state)) == importer.FreeFMUstate(instance, byref(state)) == OK
    assert state.value
    garbage = create_string_buffer(b"garbage")
    assert importer.DeSerializeFMUstate(instance, garbage, 7, byref(state)) == OK
    assert importer.SetFMUstate(instance, state) == FATAL
    assert "saved state" in importer.said
    assert importer.do_step(instance, 0.0, 1e-3) == OK


def unknown_reference(importer: Importer) -> None:
    instance, value = importer.initialised(), c_double()
    for call in (importer.GetReal, importer.SetReal):
        assert call(instance, (c_uint * 1)(9999), 1, byref(value)) == FATAL
        assert "value reference must be 0 … " in importer.said
        assert "got 9999" in importer.said
    assert importer.GetReal(instance, (c_uint * 1)(0), 1, byref(value)) == OK


def refused_experiments(importer: Importer) -> None:
    instance = importer.made()
    for start, stop, message in (
        (float("nan"), None, "the start time must be finite, got nan s"),
        (float("-inf"), None, "the start time must be finite, got -inf s"),
        (1.0, 0.5, "the stop time must be ≥ the start time 1 s, got 0.5 s"),
        (0.0, float("nan"), "the stop time must be ≥ the start time 0 s, got nan s"),
    ):
        assert importer.SetupExperiment(instance, 0, 0.0, start, stop is not None, stop or 0.0) == FATAL
        assert message in importer.said
    assert importer.begin(instance, 2.0, 3.0) == importer.ExitInitializationMode(instance) == OK
    assert importer.do_step(instance, 2.0, 1e-3) == OK
    importer.FreeInstance(instance)


def lost_description(importer: Importer) -> None:
    """Before the instance is made, and before it is made again at a reset."""
    instance = importer.initialised()
    (importer.resources / "machine.json").unlink()
    for _ in range(3):
        assert importer.Reset(instance) == importer.begin(instance) == importer.ExitInitializationMode(instance) == OK
    assert importer.do_step(instance, 0.0, 1e-3) == OK
    importer.FreeInstance(instance)
    other = importer.resources.parent / "other"
    shutil.copytree(importer.resources, other)
    for content in (None, "{"):
        if content:
            (other / "machine.json").write_text(content)
        assert importer.made(resources=f"file://{other}") is None
        assert f"{other}/machine.json cannot be read, unpack the whole archive again" in importer.said


def interrupted_steps(importer: Importer) -> None:
    """Ctrl-C inside a step, which is no Exception: the instance lives on, as after any other refusal."""
    instance = importer.initialised()
    (slave,) = (module for name, module in sys.modules.items() if name.startswith("feed_drive_"))
    advance = slave.FeedDrivePy.advance

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    for _ in range(50):
        slave.FeedDrivePy.advance = interrupt
        assert importer.do_step(instance, 0.0, 1e-3) == FATAL
        assert "KeyboardInterrupt" in importer.said
        slave.FeedDrivePy.advance = advance
    assert importer.do_step(instance, 0.0, 1e-3) == OK
    assert importer.do_step(instance, 0.0, float("nan")) == DISCARD
    importer.FreeInstance(instance)


def missing_library(importer: Importer) -> None:
    """Without SciPy the slave cannot be loaded: no instance, but a reason."""
    sys.modules["scipy"] = None  # type: ignore[assignment]  # importing it fails
    for _ in range(3):
        assert importer.made() is None
        assert "'scipy'" in importer.said
        assert "needs a Python with NumPy and SciPy" in importer.said


def lost_slave(importer: Importer) -> None:
    (slave,) = importer.resources.glob("feed_drive_*.py")
    slave.unlink()
    assert importer.made() is None
    assert f"No module named '{slave.stem}'" in importer.said


def refusals_with_logging_off(importer: Importer) -> None:
    """They have no message, so their text goes to stderr."""
    instance = importer.initialised(logging_on=False)
    before = len(importer.messages)
    assert importer.do_step(instance, 0.0, float("nan")) == DISCARD
    assert importer.SetupExperiment(instance, 0, 0.0, float("nan"), 0, 0.0) == FATAL
    assert not [message for _, _, message in importer.messages[before:] if message]
    importer.FreeInstance(instance)


CAUGHT: dict[str, Callable[[Importer], None]] = {
    function.__name__: function
    for function in (
        *(foreign_guid, freed_and_damaged_states, unknown_reference, refused_experiments, lost_description),
        *(interrupted_steps, missing_library, lost_slave, refusals_with_logging_off),
    )
}


if __name__ == "__main__":
    _, folder, case = sys.argv
    CAUGHT[case](Importer(Path(folder)))
    print("survived", flush=True)
