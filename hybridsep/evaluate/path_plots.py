"""Figures along a planar path, both axes together: prediction errors and contour errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from ..base.metrics import rms
from ..base.signals import Array
from ..cosim.run import Run
from .canvas import CASES, save_figure

__all__ = ["contour_figure", "spiral_figure"]


def spiral_figure(x: Run, y: Run, path: str | Path) -> None:
    """Draw each model's prediction error along the spiral, both axes together, to a PNG."""
    figure = Figure(figsize=(9.6, 4.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    figure.suptitle("Spiral: distance between the measured and the predicted point")
    errors = [1e6 * np.hypot(x.x_meas - getattr(x, name), y.x_meas - getattr(y, name)) for name in ("x_pb", "x_h")]
    limit = max(float(np.percentile(distance, 99)) for distance in errors)
    for axes, distance, label in zip(panels, errors, ("physics-based model", "linear hybrid model"), strict=True):
        points = _draw_path(axes, x, y, distance, limit, size=3)
        axes.set_title(f"{label}, RMS {rms(distance):.1f} µm", fontsize=10)
        axes.set_xlabel("X [mm]")
    panels[0].set_ylabel("Y [mm]")
    figure.colorbar(points, ax=panels, label="prediction error [µm]", extend="max")
    save_figure(figure, path)


def contour_figure(
    runs: Mapping[str, tuple[Run, Run]], errors: Mapping[str, Array], title: str, path: str | Path
) -> None:
    """Draw the contour error along a planar path, one panel for each compensated run, to a PNG.

    Parameters
    ----------
    runs : mapping
        Keys of :data:`~hybridsep.evaluate.canvas.CASES` → the runs of X and Y.
    errors : mapping
        The same keys → ``(n,)`` contour error, m; :func:`hybridsep.base.metrics.contour_error`.
    title : str
        Heading.
    path : str or Path
        The PNG.
    """
    rows = math.ceil(len(runs) / 2)
    figure = Figure(figsize=(8.8, 3.8 * rows + 0.5), layout="constrained")
    panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    figure.suptitle(title)
    limit = 1e6 * max(float(np.percentile(error, 98)) for key, error in errors.items() if key != "off")
    for axes, (key, (x, y)) in zip(panels.flat, runs.items(), strict=False):
        micro = 1e6 * errors[key]
        points = _draw_path(axes, x, y, micro, limit, size=5)
        axes.set_title(f"{CASES[key][0]}: {rms(micro):.0f} µm RMS", fontsize=11)
    for axes in panels[-1]:
        axes.set_xlabel("X [mm]")
    for axes in panels[:, 0]:
        axes.set_ylabel("Y [mm]")
    figure.colorbar(points, ax=panels, label="contour error [µm]", extend="max", shrink=0.7)
    save_figure(figure, path)


def _draw_path(axes: Axes, x: Run, y: Run, error: Array, limit: float, *, size: float) -> PathCollection:
    """Draw the commanded path, coloured by an error ``(n,)``, µm, from 0 to a limit."""
    axes.set_aspect("equal")
    return axes.scatter(
        1e3 * x.x_d, 1e3 * y.x_d, c=error, s=size, cmap="viridis", vmin=0.0, vmax=limit, rasterized=True
    )
