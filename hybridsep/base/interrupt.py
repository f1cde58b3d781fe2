"""Deferral of Ctrl-C to the end of an FMI call, at most one step.

Inside a pythonfmu FMU an exception becomes ``fmi2Fatal``, inside a callback it is lost, and fmpy would leave the
working directory changed. A second Ctrl-C does not wait.
"""

from __future__ import annotations

import signal
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
    """Raise ``stop`` on Ctrl-C, deferred to the end of an :func:`uninterrupted` function.

    Does nothing outside the main thread, or where Ctrl-C is handled in another way already.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _calls.depth == 0 or _calls.pending is not None:
            _calls.pending = None
            raise stop
        _calls.pending = stop

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


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
