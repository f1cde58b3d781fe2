"""Canvas and colours of the figures, drawn without a display and written as PNG, PDF or SVG."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import ArrayLike

from ..base.output import written_whole
from .decimation import drawn_places

__all__ = ["CASES", "CREATOR", "HOLD", "HYBRID", "PHYSICS", "draw_line", "finish_panels", "legend_above", "save_figure"]

CREATOR = "hybridsep"
"""Creator that a PDF or SVG names, by which it is known as ours."""

PHYSICS, HOLD, HYBRID = "#d95f02", "#7f7f7f", "#1b6ca8"

CASES = {
    "off": ("no compensation", HOLD),
    "physics": ("physics model", PHYSICS),
    "hybrid_cold": ("hybrid, cold", "#74b3e0"),
    "hybrid_warm": ("hybrid, warm", HYBRID),
    "hybrid": ("hybrid", HYBRID),
}
"""Compensated runs in the order of their expected error, largest first: key → label, colour."""


_COLUMNS = 1000
"""Columns of pixels of a panel as wide as the figure."""

_THIN = 10
"""Samples in a column of pixels above which a line is drawn thinner."""

_PAD = 0.08
"""Room between panels, and at the edges, inches."""


def draw_line(axes: Axes, x: ArrayLike, y: ArrayLike, linewidth: float = 0.9, **style: Any) -> None:
    """Draw a line; of a long one the extremes of each column of pixels, of a very long one thinner."""
    x, y = np.asarray(x), np.asarray(y)
    places = drawn_places(_COLUMNS, y)
    axes.plot(x[places], y[places], linewidth=linewidth if len(y) <= _THIN * _COLUMNS else 0.6 * linewidth, **style)


def legend_above(axes: Axes, handles: Sequence[Any] | None = None) -> None:
    """Put a panel's legend above it, where it hides nothing; entries are the panel's if left out."""
    if handles is None:
        handles = axes.get_legend_handles_labels()[0]
    axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.1,
        ncols=max(len(handles), 1),
        columnspacing=1.4,
        frameon=False,
    )


def finish_panels(panels: Iterable[Axes]) -> None:
    """Give panels over time a grid, and no frame above and on the right."""
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)


def save_figure(figure: Figure, path: str | Path, dpi: int = 130) -> None:
    """Write a figure to a PNG, or to a PDF or SVG where the name ends so; the same figure gives the same bytes."""
    FigureCanvasAgg(figure)
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(w_pad=_PAD, h_pad=_PAD)
    kind = Path(path).suffix.lower().removeprefix(".")
    metadata = {"pdf": {"Creator": CREATOR, "CreationDate": None}, "svg": {"Creator": CREATOR, "Date": None}}.get(kind)
    with written_whole(path) as file, rc_context({"svg.hashsalt": CREATOR}):
        figure.savefig(file, dpi=dpi, format=kind if metadata else "png", metadata=metadata)
