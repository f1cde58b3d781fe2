"""Deferral of Ctrl-C to the end of an FMI call, at most one step.

Inside a pythonfmu FMU an exception becomes ``fmi2Fatal``, inside a callback it is lost, and fmpy would leave the
working directory changed. A second Ctrl-C does not wait. An exception that was lost all the same, in a finalizer or
in a callback of another library, is raised again.
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

_REPEAT = 0.5
"""Time after which an exception that did not end the work is raised again, s."""


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
    """Raise ``stop`` on Ctrl-C, deferred to the end of an :func:`uninterrupted` function; again where it is lost.

    Does nothing outside the main thread, or where Ctrl-C is handled in another way already.
    """
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    sending, ended, again = threading.Lock(), threading.Event(), threading.Event()

    def repeat() -> None:
        while not ended.wait(_REPEAT):
            with sending:
                if not ended.is_set():
                    again.set()
                    _thread.interrupt_main()

    def interrupt(number: int, frame: FrameType | None) -> None:
        if again.is_set():
            again.clear()
            if ended.is_set() or _calls.depth > 0 or isinstance(sys.exc_info()[1], stop):  # on its way
                return
            raise stop
        threading.Thread(target=repeat, daemon=True).start()
        if _calls.depth == 0 or _calls.pending is not None:
            _calls.pending = None
            raise stop
        _calls.pending = stop

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        try:
            with sending:
                ended.set()
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def starting_processes() -> Iterator[None]:
    """Let processes that are started ignore a terminal's Ctrl-C, which ends this one and with it them.

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
