"""Bokeh server of the page, for this machine alone and for who knows the token."""

from __future__ import annotations

import asyncio
import hmac
import logging
import secrets
from collections.abc import Callable
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.auth_provider import AuthProvider
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import bind_sockets
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.web import HTTPError

__all__ = ["HOST", "PageServer"]

HOST = "127.0.0.1"

_FAREWELL = 0.3
"""Time that pages have to be told the end, s: several frames."""

_DAY = 86_400
"""Time for which a page that is open may connect again, s."""


class _Token(AuthProvider):
    """Admission by a token in the address, before any handler of a page, a session or its data runs."""

    def __init__(self, token: str) -> None:
        self._token = token.encode()
        super().__init__()

    @property
    def login_url(self) -> str:
        """Address of a log-in page; nobody is sent there."""
        return "/"

    @property
    def get_user_async(self) -> Callable[[Any], Any]:
        """Function that admits a request or refuses it."""
        return self._admit

    async def _admit(self, handler: Any) -> str:
        handler.set_header("Referrer-Policy", "no-referrer")
        handler.set_header("X-Frame-Options", "DENY")
        handler.set_header("Cache-Control", "no-store")
        given = handler.get_query_argument("token", "").encode()
        if not hmac.compare_digest(given, self._token):
            raise HTTPError(403, reason="the address must have the token that hybridsep live printed")
        return "reader"


class _Tornado(BokehTornado):
    """Application whose page loads of BokehJS what it needs, a third of all."""

    def resources(self, absolute_url: str | bool | None = None) -> Any:
        """Return the resources of the page: the server's own."""
        found = super().resources(absolute_url)
        found.components = ["bokeh"]
        return found


class PageServer:
    """Server of a page.

    Parameters
    ----------
    fill : callable
        Fills the document of a session.
    port : int
        0 for a free one.
    token : str

    Attributes
    ----------
    port : int

    Raises
    ------
    OSError
        If the port is taken.
    """

    def __init__(self, fill: Callable[[Document], None], port: int, token: str) -> None:
        for name in ("bokeh", "tornado.access", "tornado.general"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # whom the server refuses is its answer's to say
        asyncio.set_event_loop(asyncio.new_event_loop())
        sockets, self.port = bind_sockets(HOST, port)
        application = _Tornado(
            {"/": Application(FunctionHandler(fill))},
            extra_websocket_origins=[f"{HOST}:{self.port}", f"localhost:{self.port}"],
            use_index=False,
            auth_provider=_Token(token),
            # A session's own token is signed, so that none can be made up
            secret_key=secrets.token_bytes(32),
            sign_sessions=True,
            session_token_expiration=_DAY,
            exclude_headers=["Cookie"],
        )
        http = HTTPServer(application)
        http.add_sockets(sockets)
        self.loop = IOLoop.current()
        self._server = BaseServer(self.loop, application, http)

    def run(self) -> None:
        """Serve until :meth:`stop_later` is called."""
        self._server.start()
        self.loop.start()
        self._server.stop(wait=False)

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function between two requests; from any thread."""
        self.loop.add_callback(function, *arguments)

    def stop_later(self) -> None:
        """Stop serving once pages that are open have been told why."""
        self.loop.call_later(_FAREWELL, self.loop.stop)
