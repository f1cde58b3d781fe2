"""Charts as data: what is drawn, for a page of a report and for print."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

__all__ = ["BAND_OPACITY", "Chart", "Line"]

BAND_OPACITY = 0.18
"""Opacity of a band's area."""


@dataclass(frozen=True)
class Line:
    """Line, band or row of points of a chart.

    Attributes
    ----------
    name : str
        In the legend; empty for none.
    x, y : (n,) array_like
        Of a long line the extremes of each stretch are drawn.
    colour : str
        ``#rrggbb``.
    upper : (n,) array_like, optional
        Upper edge of a band, ``y`` being the lower one.
    points : bool
        Whether points are drawn instead of a line.
    panel : int
        Panel, from 0, top first.
    """

    name: str
    x: ArrayLike
    y: ArrayLike
    colour: str
    upper: ArrayLike | None = None
    points: bool = False
    panel: int = 0


@dataclass(frozen=True)
class Chart:
    """Chart of one or more panels over a common abscissa.

    Attributes
    ----------
    x_label : str
    y_labels : tuple of str
        One a panel.
    lines : sequence of Line
    caption : str
    x_log, y_log : bool
        Whether an axis is logarithmic.
    """

    x_label: str
    y_labels: tuple[str, ...]
    lines: Sequence[Line]
    caption: str = ""
    x_log: bool = False
    y_log: bool = False
