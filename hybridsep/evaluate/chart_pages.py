"""Charts for print: a PDF with a page a chart, as wide as one column of a journal."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import FigureCanvasPdf, PdfPages
from matplotlib.figure import Figure

from ..base.output import written_whole
from .canvas import CREATOR, finish_panels
from .chart import BAND_OPACITY, Chart, Line
from .decimation import drawn_places

__all__ = ["COLUMN_WIDTH", "write_pages"]

COLUMN_WIDTH = 88.0
"""Width of one column, mm."""

_HEIGHT = 58.0
"""Height of a chart of one panel, mm; each further panel is another 60 % of it."""

_COLUMNS = 600
"""Columns of pixels across a chart, at the resolution of a printer for pictures."""

_WIDTH, _WIDTH_OF_LONG = 0.8, 0.5
"""Width of a line, and of one of which the extremes are drawn, pt."""

_NAMES_A_ROW = 3
"""Names in one row of a legend; of more there are two in each."""


def write_pages(charts: Iterable[Chart], path: str | Path) -> None:
    """Write charts to a PDF, vector graphics; the same charts give the same bytes."""
    with (
        rc_context({"font.size": 8.0, "axes.linewidth": 0.6, "lines.markersize": 3.0}),
        written_whole(path) as file,
        PdfPages(file, metadata={"Creator": CREATOR, "CreationDate": None}) as pages,
    ):
        for chart in charts:
            pages.savefig(_drawn(chart))


def _drawn(chart: Chart) -> Figure:
    n = len(chart.y_labels)
    size = (COLUMN_WIDTH / 25.4, _HEIGHT * (1.0 + 0.6 * (n - 1)) / 25.4)
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasPdf(figure)
    panels = figure.subplots(n, 1, sharex=True, squeeze=False)[:, 0]
    for axes, label, i in zip(panels, chart.y_labels, range(n), strict=True):
        axes.set_ylabel(label)
        axes.set_xscale("log" if chart.x_log else "linear")
        axes.set_yscale("log" if chart.y_log else "linear")
        for line in chart.lines:
            if line.panel == i:
                _draw(axes, line)
    panels[-1].set_xlabel(chart.x_label)
    finish_panels(panels)
    n_named = sum(bool(line.name) for line in chart.lines)
    if n_named:
        columns = n_named if n_named <= _NAMES_A_ROW else 2
        figure.legend(loc="outside upper center", ncols=columns, frameon=False, fontsize=7.0, columnspacing=1.2)
    return figure


def _draw(axes: Axes, line: Line) -> None:
    edges = [np.asarray(edge, dtype=np.float64) for edge in (line.y, *([] if line.upper is None else [line.upper]))]
    places = drawn_places(_COLUMNS, *edges)
    x, y = np.asarray(line.x, dtype=np.float64)[places], edges[0][places]
    label = line.name or "_"
    if line.upper is not None:
        axes.fill_between(x, y, edges[1][places], color=line.colour, alpha=BAND_OPACITY, linewidth=0.0, label=label)
    else:
        width = _WIDTH if len(places) == len(edges[0]) else _WIDTH_OF_LONG
        axes.plot(x, y, "o" if line.points else "-", color=line.colour, linewidth=width, label=label)
