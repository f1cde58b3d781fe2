"""Process of the page: the core's process must not wait for a browser."""

from __future__ import annotations

import json
import os
import pickle
import sys
import threading
from functools import partial
from typing import IO, Any

from .state import State

__all__ = ["serve"]


def serve() -> None:
    """Serve the page of a run, which arrives on standard input, until it ends; what it was bound to is printed."""
    with os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8") as answer:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        title, shown, port, token = pickle.load(sys.stdin.buffer)
        from .document import fill
        from .server import PageServer

        state = State(title, shown)
        try:
            server = PageServer(partial(fill, state=state), port, token)
        except OSError as error:
            print(json.dumps({"error": error.strerror or str(error)}), file=answer)
            return
        print(json.dumps({"port": server.port}), file=answer, flush=True)
    threading.Thread(target=_follow, args=(sys.stdin.buffer, state, server), daemon=True).start()
    server.run()


def _follow(told: IO[bytes], state: State, server: Any) -> None:
    """Hand on what the run's process sends."""
    handlers = {"begin": state.begin, "take": state.take, "end": state.end}
    try:
        while True:
            kind, arguments = pickle.load(told)
            server.call(handlers[kind], *arguments)
    except (EOFError, pickle.UnpicklingError):  # the run's process is over, in whatever way
        if not state.is_over:
            server.call(state.end, "its process ended")
        server.call(server.stop_later)
