"""Deferral of Ctrl-C to the end of an FMI call, at most one step, or of the import of a library.

Inside a pythonfmu FMU an exception becomes ``fmi2Fatal``, inside a callback it is lost, and fmpy would leave the
working directory changed. While a library is imported, one Ctrl-C in a hundred is lost, becomes another exception or
ends Python: importlib has callbacks, and extension modules raise their own. A second Ctrl-C does not wait.
"""

from __future__ import annotations

import _thread
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType
from typing import Any, ParamSpec, TypeVar

__all__ = ["interrupts_between_calls", "starting_processes", "uninterrupted"]

P = ParamSpec("P")
Result = TypeVar("Result")

_AGAIN = 0.01
"""Time between two signals while Ctrl-C waits for the end of an import, s."""

_REPLACED = 1.0
"""Time after Ctrl-C within which another exception has come of it, s."""


class _Calls(threading.local):
    """Nesting depth of FMI calls per thread, and the exception pending after them.

    Signals are handled in the main thread, so an exception is never pending in another one.
    """

    depth = 0
    pending: type[BaseException] | None = None


_calls = _Calls()


def uninterrupted(function: Callable[P, Result]) -> Callable[P, Result]:
    """Decorate a function: within :func:`interrupts_between_calls`, Ctrl-C during a call is raised at its end."""

    @wraps(function)
    def call(*arguments: P.args, **keywords: P.kwargs) -> Result:
        _calls.depth += 1
        try:
            return function(*arguments, **keywords)
        finally:
            _calls.depth -= 1
            if _calls.pending is not None and _calls.depth == 0:
                stop, _calls.pending = _calls.pending, None
                raise stop

    return call


@contextmanager
def interrupts_between_calls(stop: type[BaseException] = KeyboardInterrupt) -> Iterator[None]:
    """Raise ``stop`` on Ctrl-C, deferred to the end of an :func:`uninterrupted` function or of an import.

    Does nothing outside the main thread, or where Ctrl-C is handled in another way already.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    imports_outside, hook, lock = _imports(sys._getframe()), sys.unraisablehook, _thread.allocate_lock()
    waits = is_own = False  # Ctrl-C for the end of an import; the last signal was sent by repeat
    raised = -math.inf

    def repeat() -> None:
        nonlocal is_own
        while waits:
            time.sleep(_AGAIN)
            with lock:
                if waits:
                    is_own = True
                    _send()

    def wait() -> None:
        nonlocal waits
        if not waits:
            waits = True
            _thread.start_new_thread(repeat, ())  # threading's takes locks that what is interrupted may hold

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal waits, is_own, raised
        is_second, is_own = waits and not is_own, False
        if _calls.depth == 0 and _imports(frame) > imports_outside and not is_second:
            wait()
            return
        waits = False
        if _calls.depth == 0 or _calls.pending is not None:
            _calls.pending, raised = None, time.monotonic()
            raise stop
        _calls.pending = stop

    def unraisable(what: Any) -> None:
        if what.exc_type is stop:  # lost in a callback
            wait()
        else:
            hook(what)

    signal.signal(signal.SIGINT, interrupt)
    sys.unraisablehook = unraisable
    try:
        yield
    except Exception as error:
        if time.monotonic() - raised < _REPLACED and not isinstance(error, OSError):
            raise stop from error  # of which an extension module has made another one
        raise
    finally:
        sys.unraisablehook = hook
        with lock:
            still_waits, waits = waits, False
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if still_waits:
            raise stop


def _imports(frame: FrameType | None) -> int:
    """Return how many frames of the import system a frame is called from, itself included."""
    n = 0
    while frame is not None:
        n += frame.f_code.co_filename == "<frozen importlib._bootstrap>"
        frame = frame.f_back
    return n


def _send() -> None:
    """Send Ctrl-C to the main thread, also where it waits for something; on Windows to this process."""
    main_thread = threading.main_thread().ident
    if sys.platform == "win32" or main_thread is None:
        signal.raise_signal(signal.SIGINT)
    else:
        signal.pthread_kill(main_thread, signal.SIGINT)


@contextmanager
def starting_processes() -> Iterator[None]:
    """Let processes that are started ignore a terminal's Ctrl-C: it ends this process, which ends them.

    Meanwhile it is ignored here, too. Does nothing outside the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # inherited, also by a new program
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
