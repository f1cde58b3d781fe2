"""Figures of an identification: errors over time and by structure, or frequency response with its fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..base.signals import Array
from ..evaluate.canvas import HOLD, HYBRID, PHYSICS, finish_panels, save_figure
from .frequency_response import IdentifiedResponse
from .model import IdentifiedModel

__all__ = ["operation_figure", "response_figure"]


def operation_figure(
    found: IdentifiedModel, recordings: Sequence[tuple[Array, Array]], title: str, path: str | Path
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
    """
    figure = Figure(figsize=(9.0, 8.5), layout="constrained")
    servo, residual, structures = figure.subplots(3, 1, height_ratios=[1.2, 1.2, 1.4])
    figure.suptitle(title)
    discrete = found.model.discretise(found.T_s, found.input_hold)
    start = 0.0
    for x_d, x in recordings:
        x_pb = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0] + x_d[0]
        t = start + np.arange(len(x)) * found.T_s
        servo.plot(t, 1e6 * (x_d - x), color=HOLD, linewidth=2.5, alpha=0.6)
        servo.plot(t, 1e6 * (x_d - x_pb), color=PHYSICS, linewidth=0.8)
        residual.plot(t, 1e6 * (x - x_pb), color=PHYSICS, linewidth=0.8)
        start = float(t[-1]) + found.T_s
    micro = f"µ{found.unit}"
    servo.set_ylabel(f"servo error [{micro}]")
    servo.legend(["measured", found.structure], frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    residual.set_ylabel(f"measured −\nmodelled [{micro}]")
    residual.set_xlabel("time [s]")
    servo.sharex(residual)
    _draw_structures(structures, found, micro)
    finish_panels((servo, residual, structures))
    save_figure(figure, path)


def _draw_structures(axes: Axes, found: IdentifiedModel, micro: str) -> None:
    """Draw fitted and held-out error of each structure, those with an objection pale."""
    for i, other in enumerate(found.alternatives):
        alpha = 0.35 if other.objection else 1.0
        axes.plot(1e6 * other.rms_fitted, i, "o", color=HOLD, alpha=alpha, label="fitted part")
        axes.plot(1e6 * other.rms_held_out, i, "D", color=HYBRID, alpha=alpha, label="held-out part")
        if other.name == found.structure:
            axes.axhspan(i - 0.4, i + 0.4, color=HYBRID, alpha=0.12, linewidth=0)
    axes.set_yticks(range(len(found.alternatives)), [other.name for other in found.alternatives], fontsize="small")
    axes.invert_yaxis()
    if found.alternatives:
        axes.set_xscale("log")
        handles, labels = axes.get_legend_handles_labels()
        axes.legend(handles[:2], labels[:2], frameon=False, loc="lower right")
    axes.set_xlabel(f"RMS error of the simulated position [{micro}]; pale: not to be chosen")


def response_figure(found: IdentifiedResponse, title: str, path: str | Path) -> None:
    """Draw magnitude, phase and error of a frequency response and its fit to a PNG.

    Parameters
    ----------
    found : IdentifiedResponse
    title : str
        Heading.
    path : str or Path
        The PNG.
    """
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    magnitude, phase, error = figure.subplots(3, 1, sharex=True, height_ratios=[1.6, 1.2, 1.0])
    figure.suptitle(title)
    f = found.frequency
    for values, color, width in ((found.response, HOLD, 4.0), (found.fitted, PHYSICS, 1.2)):
        alpha = 0.6 if width > 2 else 1.0
        magnitude.plot(f, 20 * np.log10(np.abs(values)), color=color, linewidth=width, alpha=alpha)
        phase.plot(f, np.rad2deg(np.unwrap(np.angle(values))), color=color, linewidth=width, alpha=alpha)
    magnitude.set_ylabel("magnitude [dB]")
    n = len(found.model.modes)
    magnitude.legend(["measured", f"{n} mode{'s' if n > 1 else ''}"], frameon=False, loc="lower left")
    phase.set_ylabel("phase [°]")
    relative = np.maximum(np.abs(found.fitted / found.response - 1), 1e-16)
    error.plot(f, 100 * relative, ".", color=PHYSICS, markersize=2)
    error.set_yscale("log")
    error.set_ylabel("error [%]")
    error.set_xlabel("frequency [Hz]")
    for mode in found.model.modes:
        if f[0] <= mode.f_n <= f[-1]:
            for axes in (magnitude, phase, error):
                axes.axvline(mode.f_n, color="black", linewidth=0.7, linestyle=":")
    finish_panels((magnitude, phase, error))
    save_figure(figure, path)
