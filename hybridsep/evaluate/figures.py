"""Figures of runs, drawn without a display and written as PNG, PDF or SVG.

Over time: prediction errors like the paper's Figs. 4 and 8, tracking errors and changes of the command. Along a planar
path, both axes together: prediction errors and contour errors.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch

from ..base.files import atomic_open
from ..base.metrics import rms
from ..cosim.contour import Contour
from ..cosim.run import Run
from ..logs.units import DisplayUnits, shown_in
from ..online.look_ahead import SepState
from .html_report import HOLD, HYBRID, PHYSICS

CASES = {
    "off": ("no compensation", HOLD),
    "physics": ("physics model", PHYSICS),
    "hybrid_cold": ("hybrid, cold", "#74b3e0"),
    "hybrid_warm": ("hybrid, warm", HYBRID),
    "hybrid": ("hybrid", HYBRID),
}
"""Compensated runs in the order of their expected error, largest first: key → label, colour."""

_SPANS = {
    SepState.OFF: ("not compensated", HOLD),
    SepState.PHYSICS: ("planned by the physics model", PHYSICS),
    SepState.TRIPPED: ("tripped", HOLD),
}
"""Shading of spans that a lesser model planned than others of the run."""


def _legend(place: Axes | Figure, handles: Sequence[Any], **where: Any) -> None:
    """Give a panel or a figure a legend in one row, without a frame."""
    place.legend(handles=handles, ncols=max(len(handles), 1), columnspacing=1.4, frameon=False, **where)


def _legend_above(axes: Axes, handles: Sequence[Any] | None = None) -> None:
    """Put a panel's legend above it, where it hides nothing; entries are the panel's if left out."""
    if handles is None:
        handles = axes.get_legend_handles_labels()[0]
    _legend(axes, handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)


def _finish_panels(panels: Sequence[Axes]) -> None:
    """Give panels over time a grid, and no frame above and on the right."""
    for axes in panels:
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a PNG, or to a PDF or SVG where the name ends so; the same figure gives the same bytes."""
    FigureCanvasAgg(figure)
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(w_pad=0.08, h_pad=0.08)  # room between panels, and at the edges, inches
    kind = Path(path).suffix.lower().removeprefix(".")
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    # pieces of a line, which may be of any length
    with atomic_open(path) as file, rc_context({"svg.hashsalt": "hybridsep", "agg.path.chunksize": 10_000}):
        figure.savefig(file, dpi=130, format=kind if metadata else "png", metadata=metadata)


def prediction_figure(run: Run, title: str, path: str | Path, shown: DisplayUnits | None = None) -> None:
    """Draw the command, the two models' prediction errors and the RMS of each window to a PNG, PDF or SVG.

    Positions are in the units ``shown``, mm and µm if left out.
    """
    shown = shown or shown_in("m")
    (factor, position), (scale, unit) = shown.position, shown.error(rms((run.x_meas - run.x_pb)[~np.isnan(run.x_meas)]))
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    command, error, windows = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 2.0, 1.4])
    figure.suptitle(title)
    t = run.t - run.t[0]
    command.plot(t, factor * run.x_d, linewidth=1.2, color="black")
    command.set_ylabel(f"commanded\nposition [{position}]")
    error.plot(t, scale * (run.x_meas - run.x_pb), linewidth=0.8, color=PHYSICS, label="physics-based model")
    label = f"linear hybrid model{'' if run.active.all() else ', after the warm-up'}"
    hybrid = np.where(run.active, scale * (run.x_meas - run.x_h), np.nan)
    error.plot(t, hybrid, linewidth=0.8, color=HYBRID, label=label)
    if not run.active.all():
        t_init = float(t[np.argmax(run.active)])
        for axes in (error, windows):
            axes.axvline(t_init, color="black", linewidth=0.8, linestyle=":")
        error.annotate(
            "t_init", (t_init, 0.02), xycoords=("data", "axes fraction"), xytext=(4, 0), textcoords="offset points"
        )
    error.set_ylabel(f"prediction error\nx − x̂ [{unit}]")
    _legend_above(error)
    _draw_windows(windows, run, scale, unit)
    windows.set_xlabel("time [s]")
    _finish_panels((command, error, windows))
    figure.align_ylabels()
    save_figure(figure, path)


def _draw_windows(axes: Axes, run: Run, scale: float, unit: str) -> None:
    """Draw the RMS error of each window and mark the windows where the hybrid is worse than the physics model."""
    errors = {name: scale * values for name, values in run.batch_rms().items()}
    edges = np.append(np.arange(len(errors["x_pb"])) * run.Np, len(run.t)) * run.T_s
    for name, color, label in (("x_pb", PHYSICS, "physics"), ("x_hold", HOLD, "hold"), ("x_h", HYBRID, "hybrid")):
        axes.stairs(errors[name], edges, baseline=None, color=color, linewidth=1.2, label=label)
    worse = errors["x_h"] > errors["x_pb"]
    for begin, end in zip(edges[:-1][worse], edges[1:][worse], strict=True):
        axes.axvspan(begin, end, color=PHYSICS, alpha=0.15, linewidth=0)
    axes.set_ylim(0.0, 1.05 * max(float(np.nan_to_num(values).max()) for values in errors.values()))
    axes.set_ylabel(f"RMS of each\nwindow [{unit}]")
    handles = axes.get_legend_handles_labels()[0]
    if worse.any():
        handles.append(Patch(color=PHYSICS, alpha=0.15, linewidth=0, label="hybrid worse than physics"))
    _legend_above(axes, handles)


def tracking_figure(runs: Mapping[str, Run], title: str, path: str | Path, shown: DisplayUnits | None = None) -> None:
    """Draw command, tracking error and change of the command of runs over the same command to a PNG.

    They are by the keys of :data:`CASES`; others are left out. Of a single run, the spans are shaded that a lesser
    model planned. Positions are in the units ``shown``, mm and µm if left out.
    """
    shown, runs = shown or shown_in("m"), {key: run for key, run in runs.items() if key in CASES}
    factor, position = shown.position
    compensated = {key: run for key, run in runs.items() if key != "off"}
    enlarged = 0 < len(compensated) < len(runs)
    ratios = [1.0, 1.6, *([1.8] if enlarged else []), 1.5]
    figure = Figure(figsize=(9.0, 1.8 + 1.15 * sum(ratios)), layout="constrained")
    panels: Sequence[Axes] = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    figure.suptitle(title)
    first = next(iter(runs.values()))
    panels[0].plot(first.t - first.t[0], factor * first.x_d, linewidth=1.2, color="black")
    panels[0].set_ylabel(f"commanded\nposition [{position}]")
    _draw_runs(panels[1], runs, "error", shown.small, "tracking error\nx_d − x")
    if enlarged:
        _draw_runs(panels[2], compensated, "error", shown.small, "tracking error,\nenlarged")
    _draw_runs(panels[-1], compensated or runs, "change", shown.small, "change of command\nx_dm − x_d")
    panels[-1].set_xlabel("time [s]")
    handles = [*panels[1].get_lines(), *(_shade(panels[1:], first) if len(runs) == 1 else [])]
    _legend(figure, handles, loc="outside lower center", title="RMS of the tracking error (true position)")
    _finish_panels(panels)
    figure.align_ylabels()
    save_figure(figure, path)


def _draw_runs(axes: Axes, runs: Mapping[str, Run], signal: str, shown: tuple[float, str], what: str) -> None:
    """Draw a signal of each run in a unit, ``shown``: scale and name, labelled with its tracking error."""
    scale, unit = shown
    for key, run in runs.items():
        label, color = CASES[key]
        label = f"{label}: {scale * rms(run.error):.1f} {unit}"
        axes.plot(run.t - run.t[0], scale * getattr(run, signal), linewidth=0.9, color=color, label=label)
    axes.set_ylabel(f"{what} [{unit}]")


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


def contour_figure(contours: Mapping[str, Contour], title: str, path: str | Path) -> None:
    """Draw runs along a planar path to a PNG: the path with the error magnified, and the error over time.

    Where the path has full circles it is their radial error over the angle, as a ballbar draws it. The motions along
    one path, four at most, are by the keys of :data:`CASES`; others are left out.
    """
    contours = {key: contour for key, contour in contours.items() if key in CASES}
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    figure.suptitle(title)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.0, 1.0, 1.1))
    planes = [figure.add_subplot(grid[i // 2, i % 2], aspect="equal") for i in range(len(contours))]
    path_mm = 1e3 * next(iter(contours.values())).path.points
    extent = max(np.ptp(path_mm.real), np.ptp(path_mm.imag))
    worst = 1e3 * max(float(np.quantile(np.abs(one.error), 0.99)) for one in contours.values())
    factor = float(f"{0.15 * extent / max(worst, 1e-9):.0e}")
    for plane, (key, one) in zip(planes, contours.items(), strict=True):
        label, color = CASES[key]
        drawn = 1e3 * (one.nearest + factor * (one.reached - one.nearest))
        drawn[np.flatnonzero(np.abs(np.diff(drawn)) > 0.2 * extent)] = np.nan  # the nearest point went round a corner
        plane.plot(path_mm.real, path_mm.imag, color="black", linewidth=0.6)
        plane.plot(drawn.real, drawn.imag, color=color, linewidth=0.8)
        found = one.figures()
        words = f"RMS {found['contour_rms_um']:.1f}, largest {found['contour_max_um']:.0f} µm"
        plane.set_title(f"{label}: {words}", fontsize=9)
        for part, set_range in ((path_mm.real, plane.set_xlim), (path_mm.imag, plane.set_ylim)):
            set_range(part.min() - 0.2 * extent, part.max() + 0.2 * extent)
        plane.tick_params(labelsize=8)
    planes[0].set_ylabel(f"Y [mm], error × {factor:g}")
    planes[-1].set_xlabel("X [mm]")
    best = min(contours, key=lambda key: rms(contours[key].error))
    _draw_errors(figure, grid[0, 2], contours, "")
    _draw_errors(figure, grid[1, 2], {best: contours[best]}, f", {CASES[best][0]}")
    save_figure(figure, path)


def _draw_errors(figure: Figure, place: SubplotSpec, contours: Mapping[str, Contour], whose: str) -> None:
    """Draw contour errors over time, µm, or where the path has full circles radial errors over the angle."""
    if np.isnan(next(iter(contours.values())).path.centre).all():
        axes = figure.add_subplot(place, xlabel="time [s]", ylabel="[µm]")
        for key, one in contours.items():
            axes.plot(one.T_s * np.arange(len(one.error)), 1e6 * one.error, linewidth=0.8, color=CASES[key][1])
        _finish_panels([axes])
        title = f"contour error{whose}"
    else:
        axes = figure.add_subplot(place, projection="polar")
        peak = 1e-3
        for key, one in contours.items():
            commanded = one.path.points - one.path.centre
            radial = 1e6 * (np.abs(one.reached - one.path.centre) - np.abs(commanded))
            axes.plot(np.angle(commanded), radial, color=CASES[key][1], linewidth=0.7)
            peak = max(peak, float(np.nanmax(np.abs(radial))))
        axes.plot(np.linspace(0.0, 2 * np.pi, 361), np.zeros(361), color="black", linewidth=0.6)
        ring = float(f"{0.6 * peak:.0e}")
        axes.set_ylim(-1.6 * peak, 1.05 * peak)
        axes.set_yticks((-ring, ring), ("", ""))
        axes.set_xticks(np.arange(0.0, 2 * np.pi, np.pi / 2))
        title = f"radial error{whose}; rings at ±{ring:g} µm"
    axes.tick_params(labelsize=8)
    axes.set_title(title, fontsize=9)
