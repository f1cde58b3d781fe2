"""Commands that run side by side as child processes, and end together."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

__all__ = ["run_together"]

_PAUSE = 0.02
"""Time between two looks for commands that have ended, s."""


def run_together(
    commands: Sequence[tuple[Sequence[str], Path]],
    on_start: Callable[[int], object] = lambda _i: None,
    on_success: Callable[[int], object] = lambda _i: None,
) -> dict[int, tuple[int, str]]:
    """Run commands, each in its folder, always as many as there are processors.

    Parameters
    ----------
    commands : sequence of pairs
    on_start : callable, optional
        Called with the number of each command, from 0, before it starts.
    on_success : callable, optional
        Called with the number of each command that has ended with status 0.

    Returns
    -------
    dict of int to (int, str)
        Number of each command → its exit status and standard error, in the order in which they ended, up to the first
        that fails; then, as at Ctrl-C, the others are ended.
    """
    at_a_time, results = os.cpu_count() or 1, {}
    running: dict[int, tuple[subprocess.Popen[bytes], IO[bytes]]] = {}
    waiting = list(range(len(commands)))
    try:
        while waiting or running:
            while waiting and len(running) < at_a_time:
                i = waiting.pop(0)
                on_start(i)
                _start(i, *commands[i], running)
            ended = [i for i, (process, _) in running.items() if process.poll() is not None]
            for i in ended:
                results[i] = _taken(*running.pop(i))
                if results[i][0] != 0:
                    return results
                on_success(i)
            if not ended:
                time.sleep(_PAUSE)
        return results
    finally:
        for process, complaints in running.values():
            _end(process)
            complaints.close()


def _start(
    i: int, command: Sequence[str], folder: Path, running: dict[int, tuple[subprocess.Popen[bytes], IO[bytes]]]
) -> None:
    """Start a process and add it to the running ones."""
    complaints = TemporaryFile()  # noqa: SIM115, a file rather than a pipe: nobody has to read it meanwhile
    running[i] = (
        subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=complaints,
            start_new_session=True,  # a compiler has children of its own, which end with the group
        ),
        complaints,
    )


def _taken(process: subprocess.Popen[bytes], complaints: IO[bytes]) -> tuple[int, str]:
    """Return exit status and standard error of a process that has ended."""
    with complaints:
        complaints.seek(0)
        return process.returncode, complaints.read().decode(errors="replace")


def _end(process: subprocess.Popen[bytes]) -> None:
    if sys.platform == "win32":
        process.terminate()
    else:
        with suppress(ProcessLookupError):  # it has just ended
            os.killpg(process.pid, signal.SIGTERM)
    process.wait()
