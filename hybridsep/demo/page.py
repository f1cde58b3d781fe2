"""Tables of the demonstration, as the command prints them, and the index page of its folder, which needs no network."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..base.metrics import shown_figure
from ..evaluate.html_report import Report

PRINTED = {
    "staircase": {"rms_pb_um": 33.7, "rms_h_um": 14.7, "reduction_percent": 56.4},
    "spiral_x": {"rms_pb_um": 22.0, "rms_h_um": 13.7, "reduction_percent": 38.0},
    "spiral_y": {"rms_pb_um": 130.2, "rms_h_um": 94.5, "reduction_percent": 27.0},
}
"""Printed figures of the paper for the demonstration's cases, RMS in µm against the measured position."""

Summary = Mapping[str, Mapping[str, Any]]


class Table(NamedTuple):
    """A table of cases: title above it, note below it, heads of the figures' columns, rows of case and figures."""

    title: str
    note: str
    columns: tuple[str, ...]
    rows: list[tuple[str, ...]]


def compensation_table(summary: Summary) -> Table:
    """Return the tracking errors of the compensated runs: what the product is worth."""
    kinds = list(summary["staircase"]["compensation"])
    wanted = {name: (name, "tracking_rms_um") for name in summary}
    if "spiral_x" in summary:
        wanted["spiral, contour"] = ("spiral_x", "contour_rms_um")
    rows = [
        (text, *(shown_figure(summary[name]["compensation"][kind][one]) for kind in kinds))
        for label, (name, figure) in wanted.items()
        for text, one in ((label, figure), (" largest", figure.replace("rms", "max")))
    ]
    contour = "; contour: X and Y" if "spiral_x" in summary else ""
    return Table(
        "Compensation: tracking error, RMS and largest in µm of the true position",
        f"off: not compensated; cold: learns in this run; warm: weights of an earlier run; fir inverse: a filter "
        f"of the command, fitted to the run off{contour}; {_seeds(summary)}",
        tuple(kind.replace("_", " ") for kind in kinds),
        rows,
    )


def prediction_table(summary: Summary) -> Table:
    """Return the prediction errors of the paper's model."""
    rows = []
    for name, case in summary.items():
        paper = PRINTED[name]
        printed = f"{paper['rms_pb_um']:g}→{paper['rms_h_um']:g}, {paper['reduction_percent']:g} %"
        rows.append((name, *_figures(case), printed))
        rows.append((" largest", *_sizes(case, "max"), "", "", ""))
        rows += [
            (f" {part.replace('_', ' ')}", *_figures(case[part]), "")
            for part in ("friction_alone", "stiffness_alone")
            if part in case
        ]
    return Table(
        "The paper's model (averaging = false): prediction error, RMS and largest in µm",
        "against the measured position; × hold: relative to holding the last residual; paper: physics → hybrid, "
        f"reduction, as printed there; {_seeds(summary)}",
        ("physics", "hold", "hybrid", "reduction", "× hold", "paper"),
        rows,
    )


def _seeds(summary: Summary) -> str:
    n = summary["staircase"]["n_seeds"]
    return "noise seed 0" if n == 1 else f"staircase: mean of {n} noise seeds"


def _sizes(case: Mapping[str, Any], size: str) -> list[str]:
    """Return the errors of physics, hold and hybrid as text, ``rms`` or ``max``."""
    return [shown_figure(case[f"{size}_{name}_um"]) for name in ("pb", "hold", "h")]


def _figures(case: Mapping[str, Any]) -> list[str]:
    """Return physics, hold, hybrid, reduction and ratio to hold of a case as text."""
    return [*_sizes(case, "rms"), shown_figure(case["reduction_percent"], " %"), shown_figure(case["ratio_to_hold"])]


_PICTURES = {
    "staircase_compensated.png": "Staircase: tracking error, not compensated and with both models",
    "spiral_contour.png": "Spiral: contour error of both axes together",
    "spiral_x_compensated.png": "Spiral, X axis: tracking error",
    "spiral_y_compensated.png": "Spiral, Y axis: tracking error",
    "staircase.png": "Staircase: prediction error of the paper's model",
    "spiral_x.png": "Spiral, X axis: prediction error of the paper's model",
    "spiral_y.png": "Spiral, Y axis: prediction error of the paper's model",
}
"""What pictures show, in the order of the page; the first ones are of what compensation is worth."""


def write_page(out: Path, summary: Summary, files: Sequence[Path]) -> None:
    """Write ``index.html`` about a demonstration, with links to all ``files``, the page among them."""
    names = sorted(path.relative_to(out).as_posix() for path in files if path.name != "index.html")
    about = (
        "FMUs of a predictor, a compensator and a drive, co-simulated over the paper's trajectories, simulated drives"
    )
    page = Report("hybridsep demo", about)
    for table in (compensation_table(summary), prediction_table(summary)):
        page.heading(table.title)
        page.table(("case", *table.columns), table.rows)
        page.paragraph(table.note, "dim")
    for name, case in summary.items():
        page.paragraph(f"{name}: {case['verdict']}")
    page.heading("Pictures")
    for name, words in _PICTURES.items():
        if name in names:
            page.picture(name, words)
    page.heading("Files")
    page.links(name for name in names if name not in _PICTURES)
    page.write(out / "index.html")
