"""Figures, drawn without a display: prediction errors like the paper's Figs. 4 and 8, and batch by batch."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..base.output import written_whole
from ..base.signals import Array

__all__ = ["HOLD", "HYBRID", "PHYSICS", "Replay", "prediction_figure", "save_figure", "spiral_figure"]

PHYSICS, HOLD, HYBRID = "#d95f02", "#7f7f7f", "#1b6ca8"


class Replay(Protocol):
    """What a co-simulation or a backtest offers for plotting; arrays ``(n,)``, s and m."""

    @property
    def t(self) -> Array: ...  # noqa: D102
    @property
    def x_d(self) -> Array: ...  # noqa: D102
    @property
    def x_meas(self) -> Array: ...  # noqa: D102
    @property
    def x_pb(self) -> Array: ...  # noqa: D102
    @property
    def x_hold(self) -> Array: ...  # noqa: D102
    @property
    def x_h(self) -> Array: ...  # noqa: D102
    @property
    def active(self) -> NDArray[np.bool_]: ...  # noqa: D102
    @property
    def Np(self) -> int: ...  # noqa: D102

    def batch_rms(self) -> dict[str, Array]: ...  # noqa: D102


def prediction_figure(replay: Replay, title: str, path: str | Path) -> None:
    """Draw the command, the two models' prediction errors and the RMS of each batch to a PNG.

    Parameters
    ----------
    replay : Replay
        A co-simulation or a backtest.
    title : str
        Heading.
    path : str or Path
        The PNG.
    """
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    command, error, batches = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 2.0, 1.4])
    figure.suptitle(title)
    t = replay.t - replay.t[0]
    command.plot(t, 1e3 * replay.x_d, color="black", linewidth=1.2)
    command.set_ylabel("commanded\nposition [mm]")
    error.plot(t, 1e6 * (replay.x_meas - replay.x_pb), color=PHYSICS, linewidth=0.8, label="physics-based model")
    hybrid = np.where(replay.active, 1e6 * (replay.x_meas - replay.x_h), np.nan)
    error.plot(t, hybrid, color=HYBRID, linewidth=0.8, label="linear hybrid model, after the warm-up")
    if not replay.active.all():
        t_init = float(t[np.argmax(replay.active)])
        for axes in (error, batches):
            axes.axvline(t_init, color="black", linewidth=0.8, linestyle=":")
        error.annotate(
            "t_init", (t_init, 0.02), xycoords=("data", "axes fraction"), xytext=(4, 0), textcoords="offset points"
        )
    error.set_ylabel("prediction error\nx − x̂ [µm]")
    error.margins(y=0.15)
    error.legend(loc="upper right", ncols=2, frameon=False)
    _draw_batches(batches, replay)
    batches.set_xlabel("time [s]")
    for axes in (command, error, batches):
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, path)


def _draw_batches(axes: Axes, replay: Replay) -> None:
    """Draw the RMS error of each batch and mark the batches where the hybrid is worse than the physics model."""
    rms = {name: 1e6 * values for name, values in replay.batch_rms().items()}
    T_s = float(replay.t[1] - replay.t[0])
    edges = np.append(np.arange(len(rms["x_pb"])) * replay.Np, len(replay.t)) * T_s
    for name, color, label in (
        ("x_pb", PHYSICS, "physics"),
        ("x_hold", HOLD, "hold"),
        ("x_h", HYBRID, "hybrid"),
    ):
        axes.stairs(rms[name], edges, baseline=None, color=color, linewidth=1.2, label=label)
    worse = rms["x_h"] > rms["x_pb"]
    for begin, end in zip(edges[:-1][worse], edges[1:][worse], strict=True):
        axes.axvspan(begin, end, color=PHYSICS, alpha=0.15, linewidth=0)
    axes.set_ylim(0.0, 1.35 * max(float(values.max()) for values in rms.values()))
    axes.set_ylabel("RMS of each\nbatch [µm]")
    axes.legend(loc="upper right", ncols=3, frameon=False, title="shaded: hybrid worse than physics", title_fontsize=8)


def spiral_figure(x: Replay, y: Replay, path: str | Path) -> None:
    """Draw the spiral's path and where along it each model errs, both axes together, to a PNG."""
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    figure.suptitle("Spiral: distance between the measured and the predicted point")
    limit = 0.0
    errors = []
    for name in ("x_pb", "x_h"):
        distance = 1e6 * np.hypot(x.x_meas - getattr(x, name), y.x_meas - getattr(y, name))
        errors.append(distance)
        limit = max(limit, float(np.percentile(distance, 99)))
    for axes, distance, label in zip(panels, errors, ("physics-based model", "linear hybrid model"), strict=True):
        points = axes.scatter(
            1e3 * x.x_d, 1e3 * y.x_d, c=distance, s=3, cmap="viridis", vmin=0.0, vmax=limit, rasterized=True
        )
        axes.set_title(f"{label}, RMS {np.sqrt(np.mean(distance**2)):.1f} µm", fontsize=10)
        axes.set_aspect("equal")
        axes.set_xlabel("X [mm]")
    panels[0].set_ylabel("Y [mm]")
    figure.colorbar(points, ax=panels, label="prediction error [µm]")
    save_figure(figure, path)


def save_figure(figure: Figure, path: str | Path, dpi: int = 130) -> None:
    """Write a figure to a PNG."""
    FigureCanvasAgg(figure)
    with written_whole(path) as file:
        figure.savefig(file, dpi=dpi, format="png")
