"""Document of the page: its plots, and what a session of a browser has of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from bokeh.document import Document
from bokeh.events import DocumentReady, RangesUpdate
from bokeh.models import ColumnDataSource, CustomJS, Range1d
from bokeh.plotting import figure
from jinja2 import Template

from .state import State

__all__ = ["fill"]

FRAME = 50
"""Time between two frames, ms."""

SPANS = (2, 10, 60)
"""Spans that can be chosen, s."""

_LOST = 1.0
"""Time after which a frame counts as painted, s: a browser paints none behind another window."""

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
    ]
    if state.experts:
        plots.append(_shares(session, state.experts))
    plots.append(_plot(session, "step", "step [µs]", ["step"], None, 130))
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
    return {**texts, "heading": state.title, "spans": SPANS, "experts": state.experts, "span": SPANS[1]}


def _figure(session: _Session, name: str, label: str, height: int) -> Any:
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
    return plot


def _plot(
    session: _Session, name: str, label: str, lines: Sequence[str], band: tuple[str, str] | None, height: int
) -> Any:
    plot = _figure(session, name, label, height)
    if band is not None:
        plot.varea(x="t", y1=band[0], y2=band[1], source=session.lines, name="band", fill_alpha=0.22)
    for column in lines:
        plot.line(x="t", y=column, source=session.lines, name=column.split("_", 1)[-1], line_width=1)
    return plot


def _shares(session: _Session, experts: Sequence[str]) -> Any:
    plot = _figure(session, "shares", "share", 150)
    plot.y_range = Range1d(0.0, 1.0)
    for i in reversed(range(len(experts))):
        lower: Any = f"share{i - 1}" if i else 0.0
        plot.varea(x="t", y1=lower, y2=f"share{i}", source=session.lines, name=f"share{i}", fill_alpha=0.8)
    return plot
