"""Deferral of Ctrl-C to the end of an FMI call, at most one step, or of the import of a library.

Inside a pythonfmu FMU an exception becomes ``fmi2Fatal``, inside a callback it is lost, and fmpy would leave the
working directory changed. While a library is imported, one Ctrl-C in a hundred is lost, becomes another exception or
ends Python: importlib has callbacks, and extension modules raise their own. A second Ctrl-C does not wait.

The exception may be lost elsewhere, too: Python handles signals while it makes the message of an error, which then
takes the place of the exception and is handled by the library that has expected it. An exception that is gone while
its context lasts, and that nobody has :func:`taken`, is raised again.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType
from typing import Any, ParamSpec, TypeVar

__all__ = ["interrupts_between_calls", "starting_processes", "taken", "uninterrupted"]

P = ParamSpec("P")
Result = TypeVar("Result")

_AGAIN = 0.01
"""Time between two signals while Ctrl-C is to be raised, s."""


class _Calls(threading.local):
    """Nesting depth of FMI calls per thread, and the exception pending after them.

    Signals are handled in the main thread, so an exception is never pending in another one.
    """

    depth = 0
    pending: type[BaseException] | None = None
    taken: BaseException | None = None


_calls = _Calls()


class _Pressed(KeyboardInterrupt):
    """KeyboardInterrupt whose end can be watched."""


_Pressed.__name__ = _Pressed.__qualname__ = "KeyboardInterrupt"
_Pressed.__module__ = "builtins"


def taken(error: BaseException) -> None:
    """Say that Ctrl-C is dealt with, where its context goes on."""
    _calls.taken = error


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
    waits = is_own = False  # Ctrl-C is to be raised, or raised again; the last signal was sent by repeat
    raised: list[weakref.ref[BaseException]] = []
    kind = _Pressed if stop is KeyboardInterrupt else stop

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

    def watched() -> BaseException:
        error = kind()
        raised[:] = [weakref.ref(error, lambda _: wait())]
        return error

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal waits, is_own
        is_second, is_own = waits and not is_own, False
        if _calls.depth == 0 and _imports(frame) > imports_outside and not is_second:
            wait()
            return
        waits = False
        if _calls.depth > 0 and _calls.pending is None:
            _calls.pending = kind
            return
        _calls.pending = None
        raise watched()  # no variable here may have it: the traceback has this frame

    def unraisable(what: Any) -> None:
        if what.exc_type is not kind:  # lost in a callback; it is raised again
            hook(what)

    signal.signal(signal.SIGINT, interrupt)
    sys.unraisablehook = unraisable
    try:
        yield
    except Exception as error:
        if _has_come_of(error, kind):
            raise kind from error
        raise
    finally:
        raised.clear()
        _calls.taken = None
        sys.unraisablehook = hook
        with lock:
            still_waits, waits = waits, False
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if still_waits:
            raise kind


def _has_come_of(error: BaseException | None, kind: type[BaseException]) -> bool:
    """Return whether a library has made an exception of another kind's."""
    while error is not None:
        if isinstance(error, kind):
            return True
        error = error.__cause__ or error.__context__
    return False


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
