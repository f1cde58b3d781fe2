"""Figure of a frequency response, its fit and the error of the fit."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hybridsep.base.files import atomic_open

from .frequency_response import IdentifiedResponse

_MEASURED, _FITTED = {"color": "#7f7f7f", "linewidth": 4.0, "alpha": 0.6}, {"color": "#d95f02", "linewidth": 1.2}


def response_figure(found: IdentifiedResponse, title: str, path: Path) -> None:
    """Draw magnitude, phase, if one was measured, and error to a PNG under this title."""
    ratios = [1.6, 1.2, 1.0] if found.phase_measured else [1.6, 1.0]
    figure = Figure(figsize=(9.0, 2.0 + 1.6 * sum(ratios)), layout="constrained")
    panels = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    magnitude, error = panels[0], panels[-1]
    figure.suptitle(title)
    f, modes = found.frequency, found.model.modes
    labels = ("measured", f"{len(modes)} mode{'s' if len(modes) > 1 else ''}")
    for values, label, style in zip((found.response, found.fitted), labels, (_MEASURED, _FITTED), strict=True):
        magnitude.plot(f, 20 * np.log10(np.abs(values)), label=label, **style)
        if found.phase_measured:
            panels[1].plot(f, np.rad2deg(np.unwrap(np.angle(values))), **style)
            panels[1].set_ylabel("phase [°]")
    magnitude.set_ylabel("magnitude [dB]")
    relative = found.fitted / found.response if found.phase_measured else np.abs(found.fitted) / np.abs(found.response)
    error.plot(f, 100 * np.maximum(np.abs(relative - 1), 1e-16), ".", color="#d95f02", markersize=2)
    error.set_yscale("log")
    error.set_ylabel("error [%]" if found.phase_measured else "error of the\nmagnitude [%]")
    error.set_xlabel("frequency [Hz]")
    for axes in panels:
        axes.grid(alpha=0.3)
        for mode in modes:
            if f[0] <= mode.f_n <= f[-1]:
                axes.axvline(mode.f_n, color="black", linewidth=0.7, linestyle=":")
    magnitude.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False)
    with atomic_open(path) as file:
        figure.savefig(file, dpi=130, format="png")
