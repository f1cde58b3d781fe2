"""Figure of a tuning: error over each parameter, and over the look-ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..evaluate.canvas import HOLD, HYBRID, PHYSICS, finish_panels, save_figure
from .grid import TUNED
from .joint import Tuning

__all__ = ["tuning_figure"]

_COLUMNS = 2

_VALUES_NAMED = 10
"""Values that are named below a panel, the first and the last among them."""

_SHOWN = 0.95
"""Share of the candidates that the span of the errors is chosen for; candidates beyond it are at its edge."""


def tuning_figure(
    tuning: Tuning,
    windows: Mapping[int, Tuning],
    values: Mapping[str, Sequence[Any]],
    title: str,
    path: str | Path,
) -> None:
    """Draw the error over each tuned parameter, and over the look-ahead, to a PNG, PDF or SVG.

    Parameters
    ----------
    tuning : Tuning
    windows : mapping
        Tunings of the chosen settings by ``Np``.
    values : mapping
        Values that were tried, by the fields of settings.
    title : str
        Heading.
    path : str or Path
        The file.
    """
    fields = [field for field in values if len({getattr(one, field) for one in tuning.candidates}) > 1]
    n_rows = -(-(len(fields) + 1) // _COLUMNS)
    figure = Figure(figsize=(9.0, 1.2 + 3.1 * n_rows), layout="constrained")
    panels = figure.subplots(n_rows, _COLUMNS, squeeze=False).ravel().tolist()
    settings = tuning.candidates[tuning.chosen]
    figure.suptitle(f"{title}\n{len(tuning.candidates)} candidates, Np = {settings.Np}")
    highest = _highest(tuning)
    for axes, field in zip(panels, fields, strict=False):
        _draw_parameter(axes, tuning, field, highest)
    _draw_windows(panels[len(fields)], windows, settings.Np)
    for axes in panels[len(fields) + 1 :]:
        axes.remove()
    for axes in panels[::_COLUMNS]:
        axes.set_ylabel("RMS error relative to hold")
    named = {}
    for axes in panels[: len(fields) + 1]:
        named.update(dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True)))
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=3, frameon=False)
    finish_panels(panels[: len(fields) + 1])
    save_figure(figure, path)


def _highest(tuning: Tuning) -> float:
    """Return the largest error that is shown, relative to hold; hold is, unless that would flatten the others."""
    finite = np.sort(tuning.ratio[np.isfinite(tuning.ratio)])
    shown = [*finite[: max(1, round(_SHOWN * len(finite)))], *tuning.ratio[[0, tuning.chosen]]]
    highest = max((float(value) for value in shown if value < np.inf), default=1.0)
    return 1.1 * (1.0 if 0.5 < highest < 1.0 else highest)


def _draw_parameter(axes: Axes, tuning: Tuning, field: str, highest: float) -> None:
    """Draw all candidates over one parameter, each value at its own place, and the best at each value."""
    own = [getattr(one, field) for one in tuning.candidates]
    values = sorted(set(own))
    place = np.array([values.index(value) for value in own])
    ratio = np.minimum(tuning.ratio, highest)
    best = [float(ratio[place == i].min()) for i in range(len(values))]
    axes.plot(place, ratio, ".", color=HYBRID, markersize=3, alpha=0.35, label="candidates", rasterized=True)
    axes.plot(range(len(values)), best, color=HYBRID, linewidth=1.6, label="best over the others")
    axes.plot(place[tuning.chosen], ratio[tuning.chosen], "*", color="black", markersize=11, label="chosen")
    axes.plot(place[0], ratio[0], "o", color="black", fillstyle="none", markersize=8, label="machine's own")
    for level, color in ((1.0, HOLD), (tuning.ratio_pb, PHYSICS)):
        if level < highest:
            axes.axhline(level, color=color, linewidth=1.2, linestyle="--")
    margin = 0.05 * max(highest - min(best), 0.1 * highest)
    axes.set_ylim(max(min(best) - margin, 0.0), highest + 0.2 * margin)
    shown = np.unique(np.linspace(0, len(values) - 1, min(len(values), _VALUES_NAMED)).round().astype(np.intp)).tolist()
    axes.set_xticks(shown, [f"{values[i]:g}" for i in shown], fontsize="small")
    unit = TUNED[field].unit
    name = "λ" if field == "lam" else field
    axes.set_xlabel(name if unit == "1" else f"{name} [{unit.replace('m2', 'm²')}]")


def _draw_windows(axes: Axes, windows: Mapping[int, Tuning], Np: int) -> None:
    """Draw the error of the chosen settings over the look-ahead."""
    sizes = sorted(windows)
    ratio = np.array([windows[size].ratio[0] for size in sizes])
    axes.plot(sizes, np.where(np.isfinite(ratio), ratio, np.nan), "o-", color=HYBRID, markersize=4)
    physics = [windows[size].ratio_pb for size in sizes]
    axes.plot(sizes, physics, color=PHYSICS, linewidth=1.2, linestyle="--", label="physics")
    axes.axhline(1.0, color=HOLD, linewidth=1.2, linestyle="--", label="hold")
    axes.axvline(Np, color="black", linewidth=0.8, linestyle=":")
    left = Np > 0.5 * (sizes[0] + sizes[-1])  # beside the line there is room to the inside
    axes.annotate(
        "the controller's",
        (Np, 0.02),
        xycoords=("data", "axes fraction"),
        fontsize="small",
        ha="right" if left else "left",
        xytext=(-4 if left else 4, 0),
        textcoords="offset points",
    )
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("look-ahead Np: given, no choice\n(with the chosen settings)")
