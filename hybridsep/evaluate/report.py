"""Report: one HTML file with text, tables and interactive charts, which needs nothing else, not even a network."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ..base.output import written_text
from .chart import BAND_OPACITY, Chart, Line, drawn_places
from .chart_pages import write_pages

__all__ = ["Report"]

_HEIGHT = 340
"""Height of a panel, px."""


@dataclass
class Report:
    """Report that is put together section by section.

    Attributes
    ----------
    title, subtitle : str
    charts : list of Chart
        Those added so far.
    """

    title: str
    subtitle: str
    charts: list[Chart] = field(default_factory=list)
    _parts: list[str] = field(default_factory=list)

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def paragraph(self, text: str, kind: str = "") -> None:
        """Add a paragraph; ``kind`` is ``verdict``, ``dim`` or empty."""
        self._parts.append(f'<p class="{kind}">{html.escape(text)}</p>' if kind else f"<p>{html.escape(text)}</p>")

    def bullets(self, items: Iterable[str]) -> None:
        """Add a list."""
        self._parts.append("<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>")

    def code(self, text: str) -> None:
        """Add text to be copied."""
        self._parts.append(f"<pre>{html.escape(text)}</pre>")

    def table(self, head: Sequence[str], rows: Iterable[Sequence[str]], words: int | None = None) -> None:
        """Add a table; ``words`` is the column, from 0, of running text."""
        cells = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
        lines = [f"<tr>{cells}</tr>"]
        for row in rows:
            marked = (
                f"<td{' class=words' if i == words else ''}>{html.escape(cell)}</td>" for i, cell in enumerate(row)
            )
            lines.append(f"<tr>{''.join(marked)}</tr>")
        self._parts.append(f'<div class="tables"><table>{"".join(lines)}</table></div>')

    def chart(self, chart: Chart) -> None:
        """Add a chart."""
        from plotly.io import to_html

        self.charts.append(chart)
        drawn = to_html(
            _figure(chart),
            include_plotlyjs=False,
            full_html=False,
            div_id=f"chart{len(self.charts)}",
            config={"responsive": True, "displayModeBar": False},
        )
        caption = f"<figcaption>{html.escape(chart.caption)}</figcaption>" if chart.caption else ""
        self._parts.append(f'<figure><div class="chart">{drawn}</div>{caption}</figure>')

    def write(self, path: str | Path, figures: str | Path | None = None) -> None:
        """Write the HTML file, and its charts to a PDF, a page each, for print.

        Parameters
        ----------
        path : str or Path
        figures : str or Path, optional
            The PDF.
        """
        from plotly.offline import get_plotlyjs

        template = (Path(__file__).parent / "templates" / "report.html").read_text(encoding="utf-8")
        values = {"title": html.escape(self.title), "subtitle": html.escape(self.subtitle)}
        page = Template(template).substitute(values, plotly=get_plotlyjs(), body="\n".join(self._parts))
        with written_text(path) as file:
            file.write(page)
        if figures is not None:
            write_pages(self.charts, figures)


def _figure(chart: Chart) -> Any:
    """Return plotly's figure of a chart."""
    from plotly.graph_objects import Figure
    from plotly.subplots import make_subplots

    n = len(chart.y_labels)
    figure: Figure = make_subplots(rows=n, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for line in chart.lines:
        for trace in _traces(line):
            figure.add_trace(trace, row=line.panel + 1, col=1)
    figure.update_xaxes(title_text=chart.x_label, row=n, col=1)
    for update, log in ((figure.update_xaxes, chart.x_log), (figure.update_yaxes, chart.y_log)):
        scale = {"type": "log", "dtick": 1} if log else {"type": "linear"}
        update(**scale, gridcolor="#e8ecf0", zeroline=False, automargin=True)
    for i, label in enumerate(chart.y_labels):
        figure.update_yaxes(title_text=label, row=i + 1, col=1)
    figure.update_layout(
        height=_HEIGHT * n if n == 1 else int(0.75 * _HEIGHT * n),
        margin={"l": 10, "r": 10, "t": 30, "b": 10},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.0, "x": 0.0},
        font={"family": "system-ui, sans-serif", "size": 13},
        plot_bgcolor="white",
        hovermode="x",
    )
    return figure


def _traces(line: Line) -> list[Mapping[str, Any]]:
    """Return plotly's traces of a line: two for a band."""
    lower = np.asarray(line.y, dtype=np.float64)
    places = drawn_places(lower)
    x, lower = np.asarray(line.x, dtype=np.float64)[places], lower[places]
    common = {"type": "scatter", "legendgroup": line.name, "name": line.name}
    if line.upper is None:
        mode = {"mode": "markers", "marker": {"color": line.colour, "size": 5}} if line.points else {"mode": "lines"}
        drawn = {} if line.points else {"line": {"color": line.colour, "width": 1.3}}
        return [{**common, **mode, **drawn, "x": x, "y": lower, "showlegend": bool(line.name)}]
    edge = {**common, "x": x, "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
    filled = {"fill": "tonexty", "fillcolor": _transparent(line.colour)}
    return [
        {**edge, "y": lower, "showlegend": False},
        {**edge, **filled, "y": np.asarray(line.upper, dtype=np.float64)[places], "showlegend": bool(line.name)},
    ]


def _transparent(colour: str) -> str:
    """Return the colour of a band's area."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {BAND_OPACITY:g})"
