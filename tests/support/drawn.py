"""Figures as they are drawn: what is cut off, and which legends hide something."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text


@contextmanager
def figures_drawn() -> Iterator[list[Figure]]:
    """Collect the figures that are written, laid out as in their files; the files are not written."""
    drawn: list[Figure] = []

    def lay_out(figure: Figure, *_arguments: Any, dpi: float = 100.0, **_options: Any) -> None:
        figure.set_dpi(dpi)
        FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]
        drawn.append(figure)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", lay_out)
        yield drawn


def cut_off(figure: Figure) -> list[str]:
    """Return the texts of a figure that reach beyond its edges; of ticks the axis' name."""
    axis = [one for axes in figure.axes if axes.get_visible() for one in (axes.xaxis, axes.yaxis)]
    ticks = {id(text) for one in axis for text in one.get_ticklabels(which="both")}  # also those that are not drawn
    boxes = [(one.get_label_text(), one.get_tightbbox()) for one in axis]
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if id(text) not in ticks and text.get_visible() and text.get_text().strip():
            boxes.append((text.get_text(), text.get_window_extent()))
    width, height = figure.bbox.size
    return [name for name, b in boxes if b is not None and (b.x0 < 0 or b.y0 < 0 or b.x1 > width or b.y1 > height)]


def hiding_legends(figure: Figure) -> int:
    """Return the number of legends that cover a part of a panel."""
    legends = [axes.get_legend() for axes in figure.axes] + list(figure.legends)
    boxes = [legend.get_window_extent().padded(-2.0) for legend in legends if legend is not None]
    return sum(any(box.overlaps(axes.bbox) for axes in figure.axes) for box in boxes)
