"""Results at a Python prompt and in a notebook: one line, a table, a plot."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from .signals import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["html_table", "line_plot", "one_line"]


def one_line(name: str, figures: Mapping[str, Any]) -> str:
    """Return ``Name(a = 1, b = 2.5)``."""
    return f"{name}({', '.join(f'{key} = {_shown(value)}' for key, value in figures.items())})"


def html_table(title: str, figures: Mapping[str, Any]) -> str:
    """Return a table for a notebook."""
    rows = "".join(f"<tr><td>{escape(key)}</td><td>{_shown(value)}</td></tr>" for key, value in figures.items())
    return f"<table><caption>{escape(title)}</caption>{rows}</table>"


def line_plot(x: Array, lines: Mapping[str, Array], x_label: str, y_label: str) -> Figure:
    """Return a figure of lines over ``x``."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.5), layout="constrained")
    axes = figure.subplots()
    for name, y in lines.items():
        axes.plot(x, y, label=name, linewidth=1.0)
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.legend()
    axes.grid(alpha=0.3)
    return figure


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
