"""Figures over time: prediction errors like the paper's Figs. 4 and 8, tracking errors and changes of the command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..base.metrics import rms
from ..base.signals import Array
from ..compensate.planning import SepState
from ..cosim.run import Run
from ..logs.units import Shown, shown_in
from .canvas import CASES, HOLD, HYBRID, PHYSICS, draw_line, finish_panels, legend_above, save_figure

__all__ = ["prediction_figure", "tracking_figure"]

_SPANS = {SepState.OFF: ("not compensated", HOLD), SepState.PHYSICS: ("planned by the physics model", PHYSICS)}
"""Shading of spans that a lesser model planned than others of the run."""


def prediction_figure(run: Run, title: str, path: str | Path, shown: Shown | None = None) -> None:
    """Draw the command, the two models' prediction errors and the RMS of each window to a PNG, PDF or SVG.

    Parameters
    ----------
    run : Run
        Of a predictor, or the replay of a log.
    title : str
        Heading.
    path : str or Path
        The file.
    shown : Shown, optional
        Units in which positions are shown; mm and µm if left out.
    """
    shown = shown or shown_in("m")
    (factor, position), (scale, unit) = shown.position, shown.error(rms((run.x_meas - run.x_pb)[~np.isnan(run.x_meas)]))
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    command, error, windows = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 2.0, 1.4])
    figure.suptitle(title)
    t = run.t - run.t[0]
    draw_line(command, t, factor * run.x_d, 1.2, color="black")
    command.set_ylabel(f"commanded\nposition [{position}]")
    draw_line(error, t, scale * (run.x_meas - run.x_pb), 0.8, color=PHYSICS, label="physics-based model")
    label = f"linear hybrid model{'' if run.active.all() else ', after the warm-up'}"
    hybrid = np.where(run.active, scale * (run.x_meas - run.x_h), np.nan)
    draw_line(error, t, hybrid, 0.8, color=HYBRID, label=label)
    if not run.active.all():
        t_init = float(t[np.argmax(run.active)])
        for axes in (error, windows):
            axes.axvline(t_init, color="black", linewidth=0.8, linestyle=":")
        error.annotate(
            "t_init", (t_init, 0.02), xycoords=("data", "axes fraction"), xytext=(4, 0), textcoords="offset points"
        )
    error.set_ylabel(f"prediction error\nx − x̂ [{unit}]")
    legend_above(error)
    _draw_windows(windows, run, scale, unit)
    windows.set_xlabel("time [s]")
    finish_panels((command, error, windows))
    figure.align_ylabels()
    save_figure(figure, path)


def _draw_windows(axes: Axes, run: Run, scale: float, unit: str) -> None:
    """Draw the RMS error of each window and mark the windows where the hybrid is worse than the physics model."""
    errors = {name: scale * values for name, values in run.batch_rms().items()}
    edges = np.append(np.arange(len(errors["x_pb"])) * run.Np, len(run.t)) * run.T_s
    for name, color, label in (
        ("x_pb", PHYSICS, "physics"),
        ("x_hold", HOLD, "hold"),
        ("x_h", HYBRID, "hybrid"),
    ):
        axes.stairs(errors[name], edges, baseline=None, color=color, linewidth=1.2, label=label)
    worse = errors["x_h"] > errors["x_pb"]
    for begin, end in zip(edges[:-1][worse], edges[1:][worse], strict=True):
        axes.axvspan(begin, end, color=PHYSICS, alpha=0.15, linewidth=0)
    axes.set_ylim(0.0, 1.05 * max(float(np.nan_to_num(values).max()) for values in errors.values()))
    axes.set_ylabel(f"RMS of each\nwindow [{unit}]")
    handles = axes.get_legend_handles_labels()[0]
    if worse.any():
        handles.append(Patch(color=PHYSICS, alpha=0.15, linewidth=0, label="hybrid worse than physics"))
    legend_above(axes, handles)


def tracking_figure(runs: Mapping[str, Run], title: str, path: str | Path) -> None:
    """Draw command, tracking error and change of the command of one or several runs to a PNG.

    Parameters
    ----------
    runs : mapping
        Keys of :data:`~hybridsep.evaluate.canvas.CASES` → runs over the same command. Of one run alone,
        the spans are shaded that a lesser model planned.
    title : str
        Heading.
    path : str or Path
        The PNG.
    """
    compensated = {key: run for key, run in runs.items() if key != "off"}
    enlarged = 0 < len(compensated) < len(runs)
    ratios = [1.0, 1.6, *([1.8] if enlarged else []), 1.5]
    figure = Figure(figsize=(9.0, 1.8 + 1.15 * sum(ratios)), layout="constrained")
    panels: Sequence[Axes] = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    figure.suptitle(title)
    first = next(iter(runs.values()))
    draw_line(panels[0], first.t - first.t[0], 1e3 * first.x_d, 1.2, color="black")
    panels[0].set_ylabel("commanded\nposition [mm]")
    _draw_signals(panels[1], {key: run.error for key, run in runs.items()}, runs)
    panels[1].set_ylabel("tracking error\nx_d − x [µm]")
    if enlarged:
        _draw_signals(panels[2], {key: run.error for key, run in compensated.items()}, runs)
        panels[2].set_ylabel("tracking error,\nenlarged [µm]")
    _draw_signals(panels[-1], {key: run.change for key, run in (compensated or runs).items()}, runs)
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
    finish_panels(panels)
    figure.align_ylabels()
    save_figure(figure, path)


def _draw_signals(axes: Axes, signals: Mapping[str, Array], runs: Mapping[str, Run]) -> None:
    """Draw one signal of each run in µm, labelled with the run's tracking error."""
    for key, signal in signals.items():
        label, color = CASES[key]
        run = runs[key]
        label = f"{label}: {1e6 * rms(run.error):.1f} µm"
        draw_line(axes, run.t - run.t[0], 1e6 * signal, color=color, label=label)


def _shade(panels: Sequence[Axes], run: Run) -> list[Patch]:
    """Shade the spans that a lesser model planned than others of the run; return their legend entries."""
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
