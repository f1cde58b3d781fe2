"""Deferral of Ctrl-C to the end of an FMI call, at most one step, or of the import of a library.

Inside a pythonfmu FMU an exception becomes ``fmi2Fatal``, inside a callback it is lost, and fmpy would leave the
working directory changed; a second Ctrl-C does not wait. While a library is imported, one Ctrl-C in a hundred is
lost, becomes another exception or ends Python: importlib has callbacks, and extension modules raise their own.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType
from typing import ParamSpec, TypeVar

__all__ = ["interrupts_between_calls", "starting_processes", "uninterrupted"]

P = ParamSpec("P")
Result = TypeVar("Result")


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
    imports_outside = _imports(sys._getframe())
    raised = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal raised
        if _calls.depth == 0 and _imports(frame) > imports_outside:
            threading.Timer(0.01, _send).start()
        elif _calls.depth == 0 or _calls.pending is not None:
            _calls.pending, raised = None, True
            raise stop
        else:
            _calls.pending = stop

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except Exception as error:
        if raised:  # an extension module has made another exception of it
            raise stop from error
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _imports(frame: FrameType | None) -> int:
    """Return how many frames of the import system a frame is called from, itself included."""
    n = 0
    while frame is not None:
        n += frame.f_code.co_filename == "<frozen importlib._bootstrap>"
        frame = frame.f_back
    return n


def _send() -> None:
    """Send Ctrl-C to the main thread, also if it waits for something."""
    main_thread = threading.main_thread().ident
    if sys.platform == "win32" or main_thread is None:
        _thread.interrupt_main()
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
