"""Run of a function in a process of its own, which foreign machine code may end.

A damaged or faulty FMU ends the process that has loaded it, and a damaged file can crash the library that reads it.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Any, TypeVar

__all__ = ["run_apart", "serve"]

Result = TypeVar("Result")

_CHILD = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from hybridsep.base.apart import serve; serve()"


def run_apart(
    ended: Callable[[str], Exception],
    function: Callable[..., Result],
    *arguments: Any,
    progress: Callable[..., object] | None = None,
    quiet: bool = False,
    **keywords: Any,
) -> Result:
    """Call a function in a new process; return its result, or raise its exception.

    Parameters
    ----------
    ended : callable
        How the process ended before the function did → what is raised then.
    function : callable
        It, its arguments and its result can be pickled.
    *arguments, **keywords
    progress : callable, optional
        Called here with what the function gives its own argument ``progress``.
    quiet : bool
        Whether what the process prints is dropped; otherwise it goes to standard error.
    """
    # The folder is here, so that what a killed process had unpacked is removed
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, "-I", "-c", _CHILD, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if quiet else None,
            start_new_session=True,
        )
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            with suppress(BrokenPipeError), process.stdin as job:
                pickle.dump((folder, function, arguments, keywords, progress is not None), job)
            while True:
                kind, content = pickle.load(process.stdout)
                if kind == "error":
                    error, stack = content
                    raise error from RuntimeError(stack)
                if kind == "result":
                    return content  # type: ignore[no-any-return]
                if progress is not None:
                    progress(*content)
        except (EOFError, pickle.UnpicklingError) as error:
            raise ended(_ending(process.wait())) from error
        finally:
            process.kill()
            process.wait()
            process.stdout.close()


def serve() -> None:
    """Do in the new process what its standard input says; what else is printed goes to standard error."""
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as answers:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        folder, function, arguments, keywords, reports = pickle.load(sys.stdin.buffer)
        tempfile.tempdir = folder
        if reports:
            keywords = {**keywords, "progress": lambda *done: _send(answers, "progress", done)}
        try:
            result = function(*arguments, **keywords)
        except Exception as error:
            _send(answers, "error", (error, traceback.format_exc()))
        else:
            _send(answers, "result", result)


def _send(answers: IO[bytes], kind: str, content: object) -> None:
    pickle.dump((kind, content), answers)
    answers.flush()


def _ending(status: int) -> str:
    """Return how a process ended: the signal's name, or the status."""
    return f"with {signal.Signals(-status).name}" if status < 0 else f"with status {status}"
