"""Child processes of several threads, terminated together when one fails or the user interrupts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

__all__ = ["Processes"]


class Processes:
    """Runs commands for several threads at once; :meth:`stop` ends those that run and lets no other begin."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[str]] = set()
        self._stopped = False

    def run(self, command: Sequence[str], folder: Path) -> tuple[int, str]:
        """Run a command in a folder; return its exit status and its standard error."""
        with self._lock:
            if self._stopped:
                raise InterruptedError("stopped before it began")
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                start_new_session=True,  # a compiler has children of its own, which end with the group
            )
            self._running.add(process)
        _, complaint = process.communicate()
        with self._lock:
            self._running.discard(process)
        return process.returncode, complaint

    def stop(self) -> None:
        """End the processes that run; each :meth:`run` then returns."""
        with self._lock:
            self._stopped = True
            for process in self._running:
                if process.poll() is None:
                    _terminate(process)


def _terminate(process: subprocess.Popen[str]) -> None:
    if sys.platform == "win32":
        process.terminate()
    else:
        with suppress(ProcessLookupError):  # it has just ended
            os.killpg(process.pid, signal.SIGTERM)
