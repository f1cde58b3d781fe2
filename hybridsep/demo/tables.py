"""Tables of the demonstration, as text: what the command prints and the index page shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..base.metrics import shown_figure
from .published import PRINTED

__all__ = ["Table", "compensation_table", "prediction_table"]

Summary = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Table:
    """A table of cases and their figures.

    Attributes
    ----------
    title, note : str
        Above it and below it.
    columns : tuple of str
        Heads of the figures' columns; the first column has the cases.
    rows : list of tuple of str
        Case and figures.
    """

    title: str
    note: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]


def compensation_table(summary: Summary) -> Table:
    """Return the tracking errors of the compensated runs: what the product is worth."""
    kinds = list(summary["staircase"]["compensation"])
    wanted = {name: (name, "tracking_rms_um") for name, case in summary.items() if "compensation" in case}
    if "spiral_x" in summary:
        wanted["spiral, contour"] = ("spiral_x", "contour_rms_um")
    rows = [
        (label, *(shown_figure(summary[name]["compensation"][kind][figure]) for kind in kinds))
        for label, (name, figure) in wanted.items()
    ]
    contour = "; contour: X and Y" if "spiral_x" in summary else ""
    return Table(
        "Compensation: tracking error, RMS in µm of the true position",
        f"off: not compensated; cold: learns in this run; warm: weights of an earlier run{contour}; {_seeds(summary)}",
        tuple(kind.replace("_", " ") for kind in kinds),
        rows,
    )


def prediction_table(summary: Summary) -> Table:
    """Return the prediction errors of the paper's model."""
    rows = []
    for name, case in summary.items():
        rows.append((name, *_figures(case), _printed(PRINTED[name])))
        rows += [
            (f" {part.replace('_', ' ')}", *_figures(case[part]), "")
            for part in ("friction_alone", "stiffness_alone")
            if part in case
        ]
    return Table(
        "The paper's model (trust = false): prediction error, RMS in µm",
        "against the measured position; × hold: relative to holding the last residual; paper: physics → hybrid, "
        f"reduction, as printed there; {_seeds(summary)}",
        ("physics", "hold", "hybrid", "reduction", "× hold", "paper"),
        rows,
    )


def _seeds(summary: Summary) -> str:
    n = summary["staircase"]["n_seeds"]
    return "noise seed 0" if n == 1 else f"staircase: mean of {n} noise seeds"


def _figures(case: Mapping[str, Any]) -> list[str]:
    """Return physics, hold, hybrid, reduction and ratio to hold of a case as text, a dash where there is no figure."""
    figures = [shown_figure(case.get(name)) for name in ("rms_pb_um", "rms_hold_um", "rms_h_um")]
    return [*figures, shown_figure(case.get("reduction_percent"), " %"), shown_figure(case.get("ratio_to_hold"))]


def _printed(case: Mapping[str, float]) -> str:
    """Return the paper's figures of a case as text, empty if there are none."""
    if not case:
        return ""
    return f"{case['rms_pb_um']:g}→{case['rms_h_um']:g}, {case['reduction_percent']:g} %"
