"""Commands that run side by side as child processes, and end together."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from ..base.interrupt import uninterrupted

__all__ = ["run_together"]


def run_together(
    commands: Sequence[tuple[Sequence[str], Path]], on_start: Callable[[int], object] = lambda _i: None
) -> list[tuple[int, str]]:
    """Run commands, each in its folder, as many at a time as there are processors.

    Parameters
    ----------
    commands : sequence of pairs
    on_start : callable, optional
        Called with the number of each command, from 0, before it starts.

    Returns
    -------
    list of (int, str)
        Exit status and standard error of each, up to the first that fails; then, as at Ctrl-C, the others are ended.
    """
    at_a_time, results = os.cpu_count() or 1, []
    running: list[subprocess.Popen[str]] = []
    try:
        for i in range(0, len(commands), at_a_time):
            for j, (command, folder) in enumerate(commands[i : i + at_a_time], i):
                on_start(j)
                _start(command, folder, running)
            for process in running[i:]:
                _, complaint = process.communicate()
                results.append((process.returncode, complaint))
                if process.returncode != 0:
                    return results
        return results
    finally:
        for process in running:
            if process.poll() is None:
                _end(process)


@uninterrupted
def _start(command: Sequence[str], folder: Path, running: list[subprocess.Popen[str]]) -> None:
    """Start a process and add it to those that run."""
    running.append(
        subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,  # a compiler has children of its own, which end with the group
        )
    )


def _end(process: subprocess.Popen[str]) -> None:
    if sys.platform == "win32":
        process.terminate()
    else:
        with suppress(ProcessLookupError):  # it has just ended
            os.killpg(process.pid, signal.SIGTERM)
    process.communicate()
