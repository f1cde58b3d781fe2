"""Page of a run: its document, and the Bokeh server that gives it to who knows the token, only on this machine."""

import asyncio
import hmac
import logging
import math
import secrets
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.events import DocumentReady, RangesUpdate
from bokeh.models import ColumnDataSource, CustomJS, Range1d
from bokeh.plotting import figure
from bokeh.server.auth_provider import AuthProvider
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import bind_sockets
from jinja2 import Template
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.web import HTTPError

from .state import State

HOST = "127.0.0.1"

_FAREWELL = 0.3  # time that pages have to be told the end, s: several frames
_DAY = 86_400  # time for which a page that is open may connect again, s
FRAME = 50  # time between two frames, ms
SPANS = (2, 10, 60)  # spans that can be chosen, s
_LOST = 1.0  # time after which a frame counts as painted, s: a browser paints none behind another window

_TEMPLATES = Path(__file__).parent / "templates"

_Line = tuple[str, str]
_TOOLS = "xpan,xwheel_zoom,box_zoom"


class _Session:
    """Session of a browser: what it follows, and whether it is paused."""

    def __init__(self, state: State) -> None:
        self._state = state
        self._drawn, self._words, self._unseen = -1, "", -_LOST
        data, start, end = state.latest(SPANS[1])
        self.lines = ColumnDataSource(data=data, name="lines")
        self.status = ColumnDataSource(data={"json": [state.words()]}, name="status")
        self.control = ColumnDataSource(
            data={"paused": [0], "span": [SPANS[1]], "start": [math.nan], "end": [math.nan]}, name="control"
        )
        self.seen = ColumnDataSource(data={"n": [0]}, name="seen")
        self.range = Range1d(start, end)
        self.control.on_change("data", self._controlled)
        self.seen.on_change("data", self._painted)

    def frame(self) -> None:
        """Send what has changed, once the browser has painted the frame before."""
        if monotonic() - self._unseen < _LOST and not self._state.is_over:
            return
        words = self._state.words()
        if words != self._words:
            self._words = words
            self.status.data = {"json": [words]}
        if self._state.n != self._drawn and not self._of("paused"):
            self._drawn, self._unseen = self._state.n, monotonic()
            self.lines.data, start, end = self._state.latest(self._of("span"))
            self.range.update(start=start, end=end)

    def _painted(self, attribute: str, before: Any, after: Any) -> None:
        due = 1e3 * (monotonic() - self._unseen) >= FRAME
        self._unseen = -_LOST
        if due:  # a slow browser gets the next frame at once
            self.frame()

    def _controlled(self, attribute: str, before: Any, after: Any) -> None:
        """Follow what the page asks for: another span, a pause, or more of what it has zoomed in on."""
        start, end = self._of("start"), self._of("end")
        self._drawn = -1
        if self._of("paused") and start < end:
            self.lines.data = self._state.between(start, end)

    def _of(self, name: str) -> float:
        """Return what the page asks for; nothing that it sends must stop the session."""
        try:
            value = float(self.control.data[name][0])
        except (KeyError, IndexError, TypeError, ValueError):
            return 0.0
        return value if name != "span" or value in SPANS else float(SPANS[1])


def fill(document: Document, state: State) -> None:
    """Fill the document of a new session."""
    session = _Session(state)
    small, position = state.shown.small[1], state.shown.position[1]
    plots = [
        _plot(session, "error", f"error [{small}]", ["e_meas", "e_pb", "e_h"], ("e_low", "e_high"), 260),
        _plot(session, "residual", f"residual [{small}]", ["r_pb", "r_h"], ("r_low", "r_high"), 220),
        _plot(session, "position", f"position [{position}]", ["x_d", "x_meas"], None, 160),
        _plot(session, "step", "step [µs]", ["step"], None, 130),
    ]
    plots[0].tags = [session.status, session.control, session.seen]  # with a plot they are part of the document
    plots[-1].xaxis.axis_label = "time [s]"
    for plot in plots:
        plot.js_on_event(RangesUpdate, CustomJS(code="window.live.zoomed()"))
        document.add_root(plot)
    session.status.js_on_change("data", CustomJS(args={"status": session.status}, code="window.live.tell(status)"))
    session.lines.js_on_change("data", CustomJS(code="window.live.frame()"))
    models = {"plots": plots, **{name: getattr(session, name) for name in ("control", "status", "seen", "range")}}
    document.js_on_event(DocumentReady, CustomJS(args={"models": models}, code="window.live.start(models)"))
    # The page itself says that nothing comes any more
    document.config.notify_connection_status = document.config.reconnect_session = False
    document.title = f"{state.title} – hybridsep live"
    document.template = Template((_TEMPLATES / "page.html").read_text(encoding="utf-8"))
    document.template_variables.update(_variables(state))
    document.add_periodic_callback(session.frame, FRAME)


def _variables(state: State) -> Mapping[str, Any]:
    texts = {name: (_TEMPLATES / f"page.{name}").read_text(encoding="utf-8") for name in ("css", "js")}
    return {**texts, "heading": state.title, "spans": SPANS, "span": SPANS[1]}


def _plot(
    session: _Session, name: str, label: str, lines: Sequence[str], band: tuple[str, str] | None, height: int
) -> Any:
    """Return an empty plot; the page's script gives it the colours of its theme."""
    plot = figure(
        name=name,
        height=height,
        sizing_mode="stretch_width",
        x_range=session.range,
        y_axis_label=label,
        tools=_TOOLS,
        active_drag="xpan",
        active_scroll="xwheel_zoom",
        toolbar_location=None,
        output_backend="canvas",
        background_fill_alpha=0.0,
        border_fill_alpha=0.0,
        min_border_left=70,
        min_border_right=8,
        outline_line_color=None,
    )
    plot.y_range.only_visible = True
    plot.xaxis.ticker.desired_num_ticks = plot.yaxis.ticker.desired_num_ticks = 5
    if band is not None:
        plot.varea(x="t", y1=band[0], y2=band[1], source=session.lines, name="band", fill_alpha=0.22)
    for column in lines:
        plot.line(x="t", y=column, source=session.lines, name=column.split("_", 1)[-1], line_width=1)
    return plot


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
    """Server of a page that ``fill`` fills for each session, on ``port``, 0 for a free one; OSError if it is taken."""

    def __init__(self, fill: Callable[[Document], None], port: int, token: str) -> None:
        _log_without(token)
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


class _WithoutToken(logging.Formatter):
    """Formatter of messages, tracebacks with them, that leaves the token out: a request's address has it."""

    def __init__(self, token: str) -> None:
        super().__init__()
        self._token = token

    def format(self, record: logging.LogRecord) -> str:
        """Return the text of a record."""
        return super().format(record).replace(self._token, "…")


def _log_without(token: str) -> None:
    """Log errors of this process to standard error, without the token."""
    handler = logging.StreamHandler()
    handler.setFormatter(_WithoutToken(token))
    logging.basicConfig(handlers=[handler], level=logging.ERROR, force=True)
    for name in ("tornado.access", "tornado.general", "bokeh.server.views"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # whom the server refuses is its answer's to say
