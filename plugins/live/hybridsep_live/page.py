"""Page of a run, in a process of its own: the core's must not wait for a browser."""

import multiprocessing
import os
import queue
import secrets
import signal
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from hybridsep.base.errors import ParameterError
from hybridsep.logs.units import DisplayUnits

from .core import Row
from .state import State, table

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

_FOREIGN = "BOKEH_"
"""Begin of variables that would let a page load its scripts from elsewhere, or take sessions from other origins."""

_WAITING_MAX = 1000  # most batches that wait for the page's process; beyond, the page misses some, and the core none
_LOOKED = 0.2  # time between two looks at the page's process, s: Windows has no signal for who waits for one
_FLUSHED = 5.0  # longest wait for the page's process, s


class Page:
    """Page that a browser of this machine shows, only at :attr:`address`.

    ``shown``: units; ``port``: 0 for a free one. ``address``: with the token, without which there is nothing to see;
    ``n_dropped``: rows that the page missed, as its process was too slow. ParameterError if the port is taken.
    """

    def __init__(self, title: str, shown: DisplayUnits, port: int = 0) -> None:
        token, self.n_dropped = secrets.token_urlsafe(24), 0
        context = multiprocessing.get_context("spawn")
        self._told, own = context.Pipe()
        self._process = context.Process(target=_serve, args=(own, title, shown, port, token), daemon=True)
        self._process.start()
        own.close()
        try:
            answer = self._told.recv()
        except EOFError:
            answer = "its process ended"
        if isinstance(answer, str):
            self.close()
            raise ParameterError(f"the page cannot be served at port {port}: {answer}; choose another (--port)")
        self.port = int(answer)
        self.address = f"http://127.0.0.1:{self.port}/?token={token}"
        self._queue: queue.Queue[tuple[str, tuple[Any, ...]] | None] = queue.Queue(_WAITING_MAX)
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()

    def begin(self, T_s: float, delay: int) -> None:
        """Tell what the first sample told."""
        self._queue.put(("begin", (T_s, delay)))

    def take(self, rows: Sequence[Row], status: Mapping[str, Any]) -> None:
        """Show rows; this does not wait."""
        try:
            self._queue.put_nowait(("take", (list(rows), dict(status))))
        except queue.Full:
            self.n_dropped += len(rows)

    def end(self, message: str) -> None:
        """Show that the run is over, and wait until the page knows it."""
        with suppress(queue.Full):
            self._queue.put(("end", (message,)), timeout=_FLUSHED)
            self._queue.put(None, timeout=_FLUSHED)
        self._writer.join(_FLUSHED)

    def wait(self) -> None:
        """Wait until the page's process ends, which it does not by itself."""
        while self._process.is_alive():
            self._process.join(_LOOKED)

    def close(self) -> None:
        """End the page's process."""
        self._told.close()
        self._process.join(_FLUSHED)
        self._process.kill()  # if it has not ended
        self._process.join()

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _write(self) -> None:
        """Tell the page's process, in a thread: its pipe may be full."""
        with suppress(OSError, ValueError):  # it has ended; the run goes on
            while (message := self._queue.get()) is not None:
                kind, arguments = message
                self._told.send((kind, (table(arguments[0]), arguments[1]) if kind == "take" else arguments))


def _serve(told: "Connection", title: str, shown: DisplayUnits, port: int, token: str) -> None:
    """Serve the page of a run until its process ends; what it was bound to, or why not, is told first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run
    for name in [name for name in os.environ if name.startswith(_FOREIGN)]:
        del os.environ[name]
    from .page_server import PageServer, fill

    state = State(title, shown)
    try:
        server = PageServer(partial(fill, state=state), port, token)
    except OSError as error:
        told.send(error.strerror or str(error))
        return
    told.send(server.port)
    threading.Thread(target=_follow, args=(told, state, server), daemon=True).start()
    server.run()


def _follow(told: "Connection", state: State, server: Any) -> None:
    """Hand on what the run's process sends."""
    handlers = {"begin": state.begin, "take": state.take, "end": state.end}
    with suppress(EOFError, OSError):  # the run's process is over, in whatever way
        while True:
            kind, arguments = told.recv()
            server.call(handlers[kind], *arguments)
    if not state.is_over:
        server.call(state.end, "its process ended")
    server.call(server.stop_later)
