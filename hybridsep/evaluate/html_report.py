"""Report: one HTML file with text, tables and interactive charts, which needs nothing else, not even a network."""

import html
from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.files import write_whole
from ..base.signals import Indices

PHYSICS, HOLD, HYBRID = "#d95f02", "#7f7f7f", "#1b6ca8"  # colours of the predictions, in all figures

_HEIGHT, _HEIGHT_OF_SEVERAL = 340, 255  # height of the only panel, and of one of several, px
_FONT_SIZE = 13  # size of all text of a chart, px

_AXES: dict[str, Any] = {"gridcolor": "#e8ecf0", "zeroline": False, "automargin": True}
_TITLE: dict[str, Any] = {"font": {"size": _FONT_SIZE}, "standoff": 8}
_LAYOUT: dict[str, Any] = {
    "margin": {"l": 10, "r": 10, "t": 30, "b": 10},
    # at the chart's top, not the panel's: a change of height, as for print, does not move it
    "legend": {"orientation": "h", "yref": "container", "yanchor": "top", "y": 1.0, "x": 0.0},
    "font": {"family": "system-ui, sans-serif", "size": _FONT_SIZE, "color": "#1d2733"},
    "hovermode": "x",
}

_SCRIPT = """\
<noscript><p class="dim">The charts need JavaScript.</p></noscript>
<script>
  // on paper charts are as wide as A4 and Letter both allow, and lower
  const charts = [...document.querySelectorAll(".js-plotly-plot")].map((chart) => [chart, chart.layout.height]);
  addEventListener("beforeprint", () => charts.forEach(([chart, height]) =>
    Plotly.relayout(chart, { width: 670, height: 0.58 * height })));
  addEventListener("afterprint", () => charts.forEach(([chart, height]) =>
    Plotly.relayout(chart, { autosize: true, width: null, height })));
</script>"""


def drawn_places(columns: int, *rows: ArrayLike) -> Indices:
    """Return the indices at which lines are drawn: the extremes in each column of pixels.

    ``columns``: columns of pixels that the lines take; ``*rows``: (n,): lines over one abscissa; unknown where NaN. A
    column without any known sample stays a gap. Returns (m,): ascending, the first and the last among them; all where
    there are at most two for each column.
    """
    lines = np.array(rows, dtype=np.float64)
    n = lines.shape[1]
    if n <= 2 * columns:
        return np.arange(n)
    begins = np.linspace(0, n, columns + 1).astype(np.intp)[:-1]
    lowest, highest = (np.where(np.isnan(lines), unknown, lines) for unknown in (np.inf, -np.inf))
    keep = [
        begin + extreme(part, axis=1)
        for values, extreme in ((lowest, np.argmin), (highest, np.argmax))
        for begin, part in zip(begins, np.split(values, begins[1:], axis=1), strict=True)
    ]
    return np.unique(np.concatenate(([0, n - 1], *keep)))


@dataclass(frozen=True)
class Line:
    """Line, band or row of points of a chart."""

    name: str  # in the legend; empty for none
    # (n,): of a long line the extremes of each stretch are drawn
    x: ArrayLike
    y: ArrayLike
    colour: str  # ``#rrggbb``
    upper: ArrayLike | None = None  # (n,): upper edge of a band, ``y`` being the lower one
    points: bool = False  # whether points are drawn instead of a line
    panel: int = 0  # panel, from 0, top first

    def cut(self, at: Sequence[int]) -> "list[Line]":
        """Return its pieces before and from the samples ``at`` on, between which nothing is drawn."""
        rows = (
            [None] * (len(at) + 1) if row is None else np.split(np.asarray(row), at)
            for row in (self.x, self.y, self.upper)
        )
        return [replace(self, x=x, y=y, upper=upper) for x, y, upper in zip(*rows, strict=True) if len(x)]

    def trace(self, *, is_named: bool) -> dict[str, Any]:
        """Return it for plotly.js; ``is_named``: whether it stands in the legend, as the first one of its name."""
        edges = (self.y,) if self.upper is None else (self.y, self.upper)
        places = drawn_places(600, *edges)  # the widest chart has 900 pixels
        x, y, *upper = (np.asarray(values, dtype=np.float64)[places] for values in (self.x, *edges))
        width = 1.3 if len(places) == np.size(self.y) else 1.0
        style: dict[str, Any] = {"mode": "lines", "line": {"color": self.colour, "width": width}}
        if self.points:
            style = {"mode": "markers", "marker": {"color": self.colour, "size": 5}}
        elif upper:
            edge, fill = (f"rgba{(*bytes.fromhex(self.colour[1:]), alpha)}" for alpha in (0.3, 0.18))
            style = {"mode": "lines", "line": {"color": edge, "width": 1}, "fill": "toself", "fillcolor": fill}
            ends = np.flatnonzero(np.diff(np.isfinite(y + upper[0]), prepend=False, append=False)).reshape(-1, 2)
            x, y = (  # a closed line around each stretch without a gap
                np.concatenate([[], *((*there[i:j], *back[i:j][::-1], np.nan) for i, j in ends)])
                for there, back in ((x, x), (y, upper[0]))
            )
        data = [{"dtype": "f8", "bdata": b64encode(one.astype("<f8").tobytes()).decode()} for one in (x, y)]
        style |= {"name": self.name, "legendgroup": self.name, "showlegend": is_named, "x": data[0], "y": data[1]}
        panel = str(self.panel + 1) if self.panel else ""
        return dict(sorted(style.items())) | {"type": "scatter", "xaxis": f"x{panel}", "yaxis": f"y{panel}"}


@dataclass(frozen=True)
class Chart:
    """Chart of one or more panels over a common abscissa."""

    x_label: str
    y_labels: tuple[str, ...]  # one a panel
    lines: Sequence[Line]
    caption: str = ""
    # whether an axis is logarithmic
    x_log: bool = False
    y_log: bool = False

    def figure(self) -> dict[str, Any]:
        """Return it for plotly.js, at once: by plotly's figures it takes ten times as long."""
        n, names, spacing = len(self.y_labels), [line.name for line in self.lines], 0.08
        layout: dict[str, Any] = {"template": {"data": {"scatter": [{"type": "scatter"}]}}}
        height = (1.0 - spacing * (n - 1)) / n
        for i, label in enumerate(self.y_labels):
            panel, low = str(i + 1) if i else "", (n - 1 - i) * (height + spacing)
            below = {} if i == n - 1 else {"matches": f"x{n}", "showticklabels": False}
            for name, anchor, domain, more, text, log in (
                ("x", "y", [0.0, 1.0], below, {} if below else {"text": self.x_label}, self.x_log),
                ("y", "x", [low, low + height], {}, {"text": label}, self.y_log),
            ):
                axis = {"anchor": f"{anchor}{panel}", "domain": domain, **more, "title": _TITLE | text, **_AXES}
                layout[f"{name}axis{panel}"] = axis | ({"type": "log", "dtick": 1} if log else {})
        data = [line.trace(is_named=line.name not in ("", *names[:i])) for i, line in enumerate(self.lines)]
        return {"data": data, "layout": layout | _LAYOUT | {"height": _HEIGHT if n == 1 else n * _HEIGHT_OF_SEVERAL}}


@dataclass
class Report:
    """Report that is put together section by section."""

    title: str
    subtitle: str
    _parts: list[str] = field(default_factory=list, init=False)
    _n_charts: int = field(default=0, init=False)

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def paragraph(self, text: str, kind: str = "") -> None:
        """Add a paragraph; ``kind`` is ``verdict``, ``dim`` or empty."""
        self._parts.append(f'<p class="{kind}">{html.escape(text)}</p>' if kind else f"<p>{html.escape(text)}</p>")

    def bullets(self, items: Iterable[str]) -> None:
        """Add a list."""
        self._parts.append("<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>")

    def links(self, names: Iterable[str]) -> None:
        """Add a list of files beside the page."""
        items = (f'<li><a href="{html.escape(name)}">{html.escape(name)}</a></li>' for name in names)
        self._parts.append(f"<ul>{''.join(items)}</ul>")

    def picture(self, name: str, caption: str) -> None:
        """Add a picture in a file beside the page."""
        words = html.escape(caption)
        self._parts.append(f'<figure><img src="{name}" alt="{words}"><figcaption>{words}</figcaption></figure>')

    def code(self, text: str) -> None:
        """Add text to be copied."""
        self._parts.append(f"<pre>{html.escape(text)}</pre>")

    def table(self, head: Sequence[str], rows: Iterable[Sequence[str]], words: int | None = None) -> None:
        """Add a table; ``words`` is the column, from 0, of running text."""

        def line(tag: str, cells: Sequence[str]) -> str:
            marks = (f"{tag} class=words" if i == words else tag for i in range(len(cells)))
            marked = (f"<{mark}>{html.escape(cell)}</{tag}>" for mark, cell in zip(marks, cells, strict=True))
            return f"<tr>{''.join(marked)}</tr>"

        body = "".join(line("td", row) for row in rows)
        table = f"<table><thead>{line('th', head)}</thead><tbody>{body}</tbody></table>"
        self._parts.append(f'<div class="tables">{table}</div>')

    def chart(self, chart: Chart) -> None:
        """Add a chart."""
        from plotly.io import to_html

        self._n_charts += 1
        look, is_first = {"responsive": True, "displayModeBar": False}, self._n_charts == 1
        div_id = f"chart{self._n_charts}"
        drawn = to_html(chart.figure(), look, full_html=False, include_plotlyjs=is_first, div_id=div_id, validate=False)
        caption = f"<figcaption>{html.escape(chart.caption)}</figcaption>" if chart.caption else ""
        self._parts.append(f"<figure>{drawn}{caption}</figure>")

    def write(self, path: str | Path) -> None:
        """Write the HTML file."""
        template = (Path(__file__).parent / "templates" / "report.html").read_text(encoding="utf-8")
        body = "\n".join([*self._parts, *([_SCRIPT] if self._n_charts else [])])
        title, subtitle = map(html.escape, (self.title, self.subtitle))
        write_whole(path, Template(template).substitute(title=title, subtitle=subtitle, body=body))
