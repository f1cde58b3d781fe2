"""Page of a run, in a process of its own."""

from __future__ import annotations

import json
import os
import pickle
import queue
import secrets
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from ..base.errors import ParameterError
from ..logs.extras import library
from ..logs.units import Shown
from .core import Row
from .view import table

__all__ = ["Page"]

_CHILD = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from hybridsep.live.page_process import serve; serve()"
)

_FOREIGN = "BOKEH_"
"""Begin of variables that would let a page load its scripts from elsewhere, or take sessions from other origins."""

_WAITING_MAX = 1000
"""Most batches that wait for the page's process; beyond, the page misses some, and the core none."""

_LOOKED = 0.2
"""Time between two looks at the page's process, s."""

_FLUSHED = 5.0
"""Longest wait for the page's process, s."""


class Page:
    """Page that a browser of this machine shows, at :attr:`address` alone.

    Parameters
    ----------
    title : str
    shown : Shown
        Units.
    port : int
        0 for a free one.

    Attributes
    ----------
    address : str
        With the token, without which there is nothing to see.
    n_dropped : int
        Rows that the page missed, as its process was too slow.

    Raises
    ------
    LogError
        If Bokeh is not installed.
    ParameterError
        If the port is taken.
    """

    def __init__(self, title: str, shown: Shown, port: int = 0) -> None:
        library("the page (--no-page runs without it)", "bokeh", "live", "a Bokeh server")
        token = secrets.token_urlsafe(24)
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-c", _CHILD, json.dumps(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={name: value for name, value in os.environ.items() if not name.startswith(_FOREIGN)},
            start_new_session=True,  # a terminal's Ctrl-C ends this process, which ends it
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._told, self.n_dropped = self._process.stdin, 0
        with suppress(BrokenPipeError):
            pickle.dump((title, shown, port, token), self._told)
            self._told.flush()
        answer = json.loads(self._process.stdout.readline() or b'{"error": "its process ended"}')
        if "port" not in answer:
            self.close()
            raise ParameterError(
                f"the page cannot be served at port {port}: {answer['error']}; choose another (--port)"
            )
        self.port = int(answer["port"])
        self.address = f"http://127.0.0.1:{self.port}/?token={token}"
        self._queue: queue.Queue[tuple[str, tuple[Any, ...]] | None] = queue.Queue(_WAITING_MAX)
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()

    def begin(self, experts: tuple[str, ...], T_s: float, delay: int) -> None:
        """Tell what the first sample told."""
        self._queue.put(("begin", (experts, T_s, delay)))

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
        while self._process.poll() is None:
            time.sleep(_LOOKED)  # Windows has no signal for who waits for a process

    def close(self) -> None:
        """End the page's process."""
        with suppress(OSError):
            self._told.close()
        try:
            self._process.wait(_FLUSHED)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _write(self) -> None:
        """Tell the page's process, in a thread: its pipe may be full."""
        with suppress(OSError, ValueError):  # it has ended; the run goes on
            while (message := self._queue.get()) is not None:
                kind, arguments = message
                if kind == "take":
                    arguments = (table(arguments[0]), arguments[1])
                pickle.dump((kind, arguments), self._told, protocol=5)
                self._told.flush()
