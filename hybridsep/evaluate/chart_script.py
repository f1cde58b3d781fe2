"""Charts for a page: data and layout as plotly.js takes them, in JSON."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np

from ..base.signals import Array
from .chart import BAND_OPACITY, Chart, Line
from .decimation import drawn_places

__all__ = ["DIGITS", "chart_script", "packed"]

_HEIGHT, _HEIGHT_OF_SEVERAL = 340, 255
"""Height of the only panel, and of one of several, px."""

_COLUMNS = 600
"""Columns of a chart, each with its extremes; the widest has 900 pixels, and the page is to stay below 2 MB."""

_GAP = 0.08
"""Gap between panels, as a share of the height."""

_FONT_SIZE = 13
"""Size of all text of a chart, px."""

_TEXT, _GRID = "#1d2733", "#e8ecf0"


_LESS_THAN = (b"<", b",")
"""Digit of base 85 that a page must not have in a script, and what stands for it."""

DIGITS = b"".join(base64.b85encode(bytes((0, 0, 0, i)))[-1:] for i in range(85)).replace(*_LESS_THAN).decode("ascii")
"""Digits of :func:`packed`, in their order."""


def packed(scripts: Iterable[str]) -> tuple[str, int]:
    """Return plotly.js and scripts that use it as a text for a page, and the bytes it stands for.

    They are compressed (zlib), filled up to whole words of four bytes, and written in base 85, five of
    :data:`DIGITS` a word: plotly.js alone has 4.8 MB.
    """
    deflate, words, begun, n = _library()
    deflate = deflate.copy()
    rest = begun + deflate.compress("".join(f"\n{script}" for script in scripts).encode("utf-8")) + deflate.flush()
    return words + _in_base_85(rest + bytes(-len(rest) % 4)), n + len(rest)


@cache
def _library() -> tuple[Any, str, bytes, int]:
    """Return a compressor that has taken plotly.js in, the whole words of its output, what is over, and their length.

    Compressing it takes a quarter of a second, and a fleet writes a page an axis.
    """
    from plotly.offline import get_plotlyjs

    deflate = zlib.compressobj(9)
    compressed = deflate.compress(get_plotlyjs().encode("utf-8"))
    n = len(compressed) // 4 * 4
    return deflate, _in_base_85(compressed[:n]), compressed[n:], n


def _in_base_85(words: bytes) -> str:
    return base64.b85encode(words).replace(*_LESS_THAN).decode("ascii")


def chart_script(chart: Chart, name: str) -> str:
    """Return the statement that draws a chart into the page's element of a name."""
    data = [trace for line in chart.lines for trace in _traces(line)]
    given = (name, data, _layout(chart), {"responsive": True, "displayModeBar": False})
    arguments = ", ".join(json.dumps(one, separators=(",", ":"), allow_nan=False) for one in given)
    return f"Plotly.newPlot({arguments});"


def _layout(chart: Chart) -> dict[str, Any]:
    n = len(chart.y_labels)
    common = {"gridcolor": _GRID, "zeroline": False, "automargin": True}
    layout: dict[str, Any] = {
        "height": _HEIGHT if n == 1 else n * _HEIGHT_OF_SEVERAL,
        "margin": {"l": 10, "r": 10, "t": 30, "b": 10},
        # at the chart's top, not the panel's: a change of height, as for print, does not move it
        "legend": {"orientation": "h", "yref": "container", "yanchor": "top", "y": 1.0, "x": 0.0},
        "font": {"family": "system-ui, sans-serif", "size": _FONT_SIZE, "color": _TEXT},
        "hovermode": "x",
        "xaxis": {**common, **_scale(chart.x_log), "title": _title(chart.x_label), "anchor": _axis("y", n - 1)},
    }
    height = (1.0 - _GAP * (n - 1)) / n
    for i, label in enumerate(chart.y_labels):
        top = 1.0 - i * (height + _GAP)
        domain = [max(top - height, 0.0), top]
        layout[_axis("yaxis", i)] = {**common, **_scale(chart.y_log), "title": _title(label), "domain": domain}
    return layout


def _axis(name: str, panel: int) -> str:
    return name if panel == 0 else f"{name}{panel + 1}"


def _title(text: str) -> dict[str, Any]:
    return {"text": text, "font": {"size": _FONT_SIZE}, "standoff": 8}


def _scale(log: bool) -> dict[str, Any]:
    return {"type": "log", "dtick": 1} if log else {"type": "linear"}


def _traces(line: Line) -> list[Mapping[str, Any]]:
    """Return plotly's traces of a line: two for a band."""
    y = np.asarray(line.y, dtype=np.float64)
    edges = [y] if line.upper is None else [y, np.asarray(line.upper, dtype=np.float64)]
    places = drawn_places(_COLUMNS, *edges)
    x, *drawn = (_packed(np.asarray(values, dtype=np.float64)[places]) for values in (line.x, *edges))
    common = {"type": "scatter", "name": line.name, "legendgroup": line.name, "x": x, "yaxis": _axis("y", line.panel)}
    if line.upper is None:
        width = 1.3 if len(places) == len(y) else 1.0
        style = (
            {"mode": "markers", "marker": {"color": line.colour, "size": 5}}
            if line.points
            else {"mode": "lines", "line": {"color": line.colour, "width": width}}
        )
        return [{**common, **style, "y": drawn[0], "showlegend": bool(line.name)}]
    edge = {**common, "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
    filled = {"fill": "tonexty", "fillcolor": _transparent(line.colour)}
    return [
        {**edge, "y": drawn[0], "showlegend": False},
        {**edge, **filled, "y": drawn[1], "showlegend": bool(line.name)},
    ]


def _packed(values: Array) -> dict[str, str]:
    """Return values as plotly.js takes binary data, with half the digits where a chart needs no more."""
    known = values[np.isfinite(values)]
    halved = known.astype(np.float32)
    fine = len(known) == 0 or np.abs(halved - known).max() <= 1e-5 * np.ptp(known)
    dtype = "<f4" if fine else "<f8"
    return {"dtype": dtype[1:], "bdata": base64.b64encode(values.astype(dtype).tobytes()).decode("ascii")}


def _transparent(colour: str) -> str:
    """Return the colour of a band's area."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {BAND_OPACITY:g})"
