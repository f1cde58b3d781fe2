"""Figures of compensation, drawn without a display: tracking error, the command's change, contour error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..base.signals import Array
from ..compensate.compensator import SepState
from ..cosim.compensator_run import SepCoSimulation
from .plots import HOLD, HYBRID, PHYSICS, save_figure

__all__ = ["CASES", "contour_figure", "tracking_figure"]

CASES = {
    "none": ("no compensation", HOLD),
    "physics": ("physics model", PHYSICS),
    "hybrid_cold": ("hybrid, cold", "#74b3e0"),
    "hybrid_warm": ("hybrid, warm", HYBRID),
    "hybrid": ("hybrid", HYBRID),
}
"""Kinds of compensation in the order of what they are worth: key → label, colour."""

_SPANS = {SepState.OFF: ("not compensated", HOLD), SepState.PHYSICS: ("planned by the physics model", PHYSICS)}
"""How spans are shaded that a run's best model did not plan."""


def tracking_figure(runs: Mapping[str, SepCoSimulation], title: str, path: str | Path) -> None:
    """Draw command, tracking error and change of the command of one or several runs to a PNG.

    Parameters
    ----------
    runs : mapping
        Keys of :data:`CASES` → runs over the same command. Where it is one run only, the spans are shaded that its best
        model did not plan.
    title : str
        Heading.
    path : str or Path
        The PNG.
    """
    compensated = {key: run for key, run in runs.items() if key != "none"}
    enlarged = 0 < len(compensated) < len(runs)
    ratios = [1.0, 1.6, *([1.8] if enlarged else []), 1.5]
    figure = Figure(figsize=(9.0, 1.8 + 1.15 * sum(ratios)), layout="constrained")
    panels: Sequence[Axes] = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    figure.suptitle(title)
    first = next(iter(runs.values()))
    panels[0].plot(first.t - first.t[0], 1e3 * first.x_d, color="black", linewidth=1.2)
    panels[0].set_ylabel("commanded\nposition [mm]")
    _draw(panels[1], {key: run.error for key, run in runs.items()}, runs)
    panels[1].set_ylabel("tracking error\nx_d − x [µm]")
    if enlarged:
        _draw(panels[2], {key: run.error for key, run in compensated.items()}, runs)
        panels[2].set_ylabel("tracking error,\nenlarged [µm]")
    _draw(panels[-1], {key: run.change for key, run in (compensated or runs).items()}, runs)
    panels[-1].set_ylabel("change of command\nx_dm − x_d [µm]")
    panels[-1].set_xlabel("time [s]")
    handles = [*panels[1].get_lines(), *(_shade(panels[1:], first) if len(runs) == 1 else [])]
    figure.legend(
        handles=handles,
        title="RMS of the tracking error (true position)",
        loc="outside lower center",
        ncols=len(handles),
        columnspacing=1.4,
        frameon=False,
    )
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    figure.align_ylabels()
    save_figure(figure, path)


def _draw(axes: Axes, signals: Mapping[str, Array], runs: Mapping[str, SepCoSimulation]) -> None:
    """Draw one signal of each run in µm, labelled with the run's tracking error."""
    for key, signal in signals.items():
        label, color = CASES[key]
        run = runs[key]
        label = f"{label}: {1e6 * np.sqrt(np.mean(run.error**2)):.1f} µm"
        axes.plot(run.t - run.t[0], 1e6 * signal, color=color, linewidth=0.9, label=label)


def _shade(panels: Sequence[Axes], run: SepCoSimulation) -> list[Patch]:
    """Shade the spans that another model than the run's best one planned; return what the legend says of them."""
    patches = []
    edges_of_samples = np.append(run.t, run.t[-1] + run.T_s) - run.t[0]
    for state, (label, color) in _SPANS.items():
        inside = (run.state == state) & (state < run.state.max())
        edges = edges_of_samples[np.flatnonzero(np.diff(inside.astype(np.int8), prepend=0, append=0))]
        for begin, end in edges.reshape(-1, 2):
            for axes in panels:
                axes.axvspan(begin, end, color=color, alpha=0.2, linewidth=0)
        if len(edges):
            patches.append(Patch(color=color, alpha=0.2, linewidth=0, label=label))
    return patches


def contour_figure(
    runs: Mapping[str, tuple[SepCoSimulation, SepCoSimulation]],
    errors: Mapping[str, Array],
    title: str,
    path: str | Path,
) -> None:
    """Draw where along a planar path the contour is missed, one panel for each kind of compensation, to a PNG.

    Parameters
    ----------
    runs : mapping
        Keys of :data:`CASES` → the runs of X and Y.
    errors : mapping
        The same keys → ``(n,)`` contour error, m; :func:`hybridsep.closed_loop.contour_error`.
    title : str
        Heading.
    path : str or Path
        The PNG.
    """
    rows = math.ceil(len(runs) / 2)
    figure = Figure(figsize=(8.8, 3.8 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    figure.suptitle(title)
    limit = 1e6 * max(float(np.percentile(error, 98)) for key, error in errors.items() if key != "none")
    for axes, (key, (x, y)) in zip(panels.flat, runs.items(), strict=False):
        micro = 1e6 * errors[key]
        points = axes.scatter(
            1e3 * x.x_d, 1e3 * y.x_d, c=micro, s=5, cmap="viridis", vmin=0.0, vmax=limit, rasterized=True
        )
        axes.set_title(f"{CASES[key][0]}: {np.sqrt(np.mean(micro**2)):.0f} µm RMS", fontsize=11)
        axes.set_aspect("equal")
    for axes in panels[-1]:
        axes.set_xlabel("X [mm]")
    for axes in panels[:, 0]:
        axes.set_ylabel("Y [mm]")
    figure.colorbar(points, ax=panels, label="contour error [µm]", extend="max", shrink=0.7)
    save_figure(figure, path)
