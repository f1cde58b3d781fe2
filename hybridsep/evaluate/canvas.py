"""Canvas and colours of the figures, drawn without a display and written as PNG, PDF or SVG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..base.output import written_whole

__all__ = ["CASES", "CREATOR", "HOLD", "HYBRID", "PHYSICS", "finish_panels", "save_figure"]

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


def finish_panels(panels: Iterable[Axes]) -> None:
    """Give panels over time a grid, and no frame above and on the right."""
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)


def save_figure(figure: Figure, path: str | Path, dpi: int = 130) -> None:
    """Write a figure to a PNG, or to a PDF or SVG where the name ends so; the same figure gives the same bytes."""
    FigureCanvasAgg(figure)
    kind = Path(path).suffix.lower().removeprefix(".")
    metadata = {"pdf": {"Creator": CREATOR, "CreationDate": None}, "svg": {"Creator": CREATOR, "Date": None}}.get(kind)
    with written_whole(path) as file, rc_context({"svg.hashsalt": CREATOR}):
        figure.savefig(file, dpi=dpi, format=kind if metadata else "png", metadata=metadata)
