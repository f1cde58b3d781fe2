"""Figure of an identification: errors over time and by structure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from ..base.signals import Array
from ..evaluate.figures import draw_line, finish_panels, legend_above, save_figure
from ..evaluate.report import HOLD, HYBRID, PHYSICS
from ..logs.units import DisplayUnits, shown_in
from .model import IdentifiedModel

__all__ = ["operation_figure"]


def operation_figure(
    found: IdentifiedModel,
    recordings: Sequence[tuple[Array, Array]],
    title: str,
    path: str | Path,
    shown: DisplayUnits | None = None,
) -> None:
    """Draw servo error, residual and the structures' errors to a PNG.

    Parameters
    ----------
    found : IdentifiedModel
    recordings : sequence of pairs ``(x_d, x)`` of (n,) arrays, m or rad
        What it was identified from; they are drawn one after the other.
    title : str
        Heading.
    path : str or Path
        The PNG.
    shown : DisplayUnits, optional
        Units in which errors are drawn; the model's if left out.
    """
    scale, unit = (shown or shown_in(found.unit)).error(found.rms)
    figure = Figure(figsize=(9.0, 8.5), layout="constrained")
    servo, residual, structures = figure.subplots(3, 1, height_ratios=[1.2, 1.2, 1.4])
    figure.suptitle(title)
    discrete = found.model.discretise(found.T_s, found.input_hold)
    start = 0.0
    for x_d, x in recordings:
        x_pb = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0] + x_d[0]
        t = start + np.arange(len(x)) * found.T_s
        draw_line(servo, t, scale * (x_d - x), 2.5, color=HOLD, alpha=0.6, label="measured")
        draw_line(servo, t, scale * (x_d - x_pb), 0.8, color=PHYSICS, label=found.structure)
        draw_line(residual, t, scale * (x - x_pb), 0.8, color=PHYSICS)
        start = float(t[-1]) + found.T_s
    servo.set_ylabel(f"servo error [{unit}]")
    legend_above(servo, servo.get_lines()[:2])
    residual.set_ylabel(f"measured −\nmodelled [{unit}]")
    residual.set_xlabel("time [s]")
    servo.sharex(residual)
    servo.tick_params(labelbottom=False)
    _draw_structures(structures, found, scale, unit)
    finish_panels((servo, residual, structures))
    save_figure(figure, path)


def _draw_structures(axes: Axes, found: IdentifiedModel, scale: float, unit: str) -> None:
    """Draw fitted and held-out error of each structure, pale where there is an objection."""
    for i, other in enumerate(found.alternatives):
        alpha = 0.35 if other.objection else 1.0
        axes.plot(scale * other.rms_fitted, i, "o", color=HOLD, alpha=alpha, label="fitted part")
        axes.plot(scale * other.rms_held_out, i, "D", color=HYBRID, alpha=alpha, label="held-out part")
        if other.name == found.structure:
            axes.axhspan(i - 0.4, i + 0.4, color=HYBRID, alpha=0.12, linewidth=0)
    axes.set_yticks(range(len(found.alternatives)), [other.name for other in found.alternatives], fontsize="small")
    axes.invert_yaxis()
    if found.alternatives:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.5)))
        legend_above(axes, axes.get_lines()[:2])
    axes.set_xlabel(f"RMS error of the simulated position [{unit}]; pale: not to be chosen")
