"""Work of a fleet in the place of fits, and rows in the place of results."""

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from hybridsep.base.errors import LogError
from hybridsep_fleet.engine import Done, attempt


class Here:
    """Engine that works in this process."""

    words = "this process"

    def run(self, work: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Done]:
        for task in tasks:
            yield Done(task, *attempt(work, task))


def squared(task: tuple[int, str]) -> tuple[int, int]:
    """Return the square of a number and the process; end the process where the file is not there or is ``always``."""
    number, deadly = task
    if deadly == "raise":
        raise LogError("no log")
    if deadly == "unexpected":
        raise KeyError("inside")
    if deadly and not (Path(deadly).exists() and Path(deadly).name != "always"):
        Path(deadly).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2, os.getpid()


def row(machine: str, day: str, **figures: Any) -> dict[str, Any]:
    """Return a row of results."""
    return {
        "key": f"{machine}{day}",
        "url": f"/logs/{machine}/{day}.csv",
        "size": 1,
        "stamp": "1",
        "log": "a",
        "machine": machine,
        "axis": "X",
        "axes": '["X"]',
        "settings": "s",
        "recorded": day,
        "run": "2026-01-01",
        "version": "0.1.0",
        "status": "done",
        "message": "",
        "unit": "m",
        "best": "hold",
        "ratio": 0.5,
        "rms_h": 1e-6,
        "friction": 1e-6,
        "modes": '[{"f_n": 20.0}]',
        "findings": "[]",
        "folder": "",
        **figures,
    }
