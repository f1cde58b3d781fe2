"""The paper's cases, predicted and compensated, FMU against FMU: what ``hybridsep demo`` runs, scores and draws.

``index.html`` shows the tables that the command prints, without a network.
"""

import json
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.files import write_whole
from ..base.metrics import shown_figure
from ..cosim.compensated import COMPENSATED, Advance, Runs, compensate, mean_summary
from ..cosim.contour import contours_of
from ..cosim.loop import cosimulate
from ..cosim.run import Run
from ..evaluate.figures import contour_figure, prediction_figure, tracking_figure
from ..evaluate.html_report import Report
from ..evaluate.verdict import verdict_of
from ..fmi.archive import build_here
from ..fmi.spec import fmu_name
from ..machines.machine import PAPER_SETTINGS, load_machine
from ..plants.trajectory import spiral, staircase

Summary = dict[str, dict[str, Any]]

MACHINES = {"staircase": "spring_mass_damper", "spiral_x": "als25010_x", "spiral_y": "als25010_y"}  # of each case

PRINTED = {
    "staircase": {"rms_pb_um": 33.7, "rms_h_um": 14.7, "reduction_percent": 56.4},
    "spiral_x": {"rms_pb_um": 22.0, "rms_h_um": 13.7, "reduction_percent": 38.0},
    "spiral_y": {"rms_pb_um": 130.2, "rms_h_um": 94.5, "reduction_percent": 27.0},
}
"""Printed figures of the paper for the demonstration's cases, RMS in µm against the measured position."""

_PAIR = ("HybridPredictor", "FeedDrive")  # FMUs of a prediction

SEEDS = 10  # noise seeds that a full demonstration's staircase is averaged over


def _staircase_case(out: Path, seeds: int, advance: Advance) -> dict[str, Any]:
    machine = load_machine(MACHINES["staircase"])
    command = staircase(machine.T_s)
    predictor, plant = (build_here(machine, one, out / "fmus") for one in _PAIR)
    runs = []
    for seed in range(seeds):
        advance(f"staircase, FMU against FMU, noise seed {seed}")
        values = PAPER_SETTINGS[machine.name]
        runs.append(cosimulate(predictor, plant, command, controller_values=values, plant_values={"seed": seed}))
    runs[0].save(out / "staircase.csv")
    title = "Staircase (cf. the paper's Fig. 4), FMU against FMU, noise seed 0"
    prediction_figure(runs[0], title, out / "staircase.png")
    compensated, compensation = compensate(machine, plant, command, out, "staircase", advance, range(seeds))
    compensated["hybrid_warm"].save(out / "staircase_compensated.csv")
    title = "Staircase, compensated: FMU against FMU, noise seed 0"
    tracking_figure(compensated, title, out / "staircase_compensated.png")
    return {
        **mean_summary([run.summary() for run in runs], spread="rms_h_um"),
        "n_seeds": seeds,
        **_worse(runs[0]),
        "verdict": str(verdict_of(runs[0])),
        "compensation": compensation,
    }


def spiral_case(out: Path, advance: Advance) -> Summary:
    """Predict and compensate on the spiral, both axes."""
    summary: Summary = {}
    axes: dict[str, Run] = {}
    compensated: dict[str, Runs] = {}
    for axis, command in zip(("x", "y"), spiral(), strict=True):
        machine, label = load_machine(MACHINES[f"spiral_{axis}"]), f"spiral, {axis.upper()} axis"
        predictor, plant = (build_here(machine, one, out / "fmus") for one in _PAIR)
        advance(label)
        values = PAPER_SETTINGS[machine.name]
        axes[axis] = run = cosimulate(predictor, plant, command, controller_values=values)
        case = summary[f"spiral_{axis}"] = {**run.summary(), **_worse(run)}
        case["verdict"] = str(verdict_of(run))
        for name, off in (("friction_alone", "kappa"), ("stiffness_alone", "f")):
            advance(f"{label}, {name.replace('_', ' ')}")
            without = cosimulate(predictor, plant, command, controller_values=values, plant_values={off: 0.0})
            case[name] = without.summary()
        run.save(out / f"spiral_{axis}.csv")
        title = f"Spiral, {axis.upper()} axis (cf. the paper's Fig. 8), FMU against FMU"
        prediction_figure(run, title, out / f"spiral_{axis}.png")
        compensated[axis], case["compensation"] = compensate(machine, plant, command, out, label, advance)
        compensated[axis]["hybrid_warm"].save(out / f"spiral_{axis}_compensated.csv")
        title = f"Spiral, {axis.upper()} axis, compensated: FMU against FMU"
        tracking_figure(compensated[axis], title, out / f"spiral_{axis}_compensated.png")
    contours = contours_of(compensated["x"], compensated["y"])
    contour_figure(contours, "Spiral, X and Y compensated", out / "spiral_contour.png")
    for case in summary.values():
        for kind, contour in contours.items():
            case["compensation"][kind] |= contour.figures()
    return summary


def _worse(run: Run) -> dict[str, Any]:
    """Return in how many windows the hybrid is worse than the physics model, and than hold, of how many."""
    errors, peers = run.batch_rms(), {"physics": "x_pb", "hold": "x_hold"}
    worse = {name: int(np.count_nonzero(errors["x_h"] > errors[peer])) for name, peer in peers.items()}
    return {"n_batches": len(errors["x_h"]), **{f"n_batches_worse_than_{name}": n for name, n in worse.items()}}


def demo_files(out: str | Path, *, full: bool = False) -> list[Path]:
    """Return all files that :func:`demo` writes."""
    out = Path(out)
    files = [out / name for name in ("index.html", "summary.json", *(["spiral_contour.png"] * full))]
    for case, name in list(MACHINES.items())[: len(MACHINES) if full else 1]:
        files += [out / f"{case}{what}{end}" for what in ("", "_compensated") for end in (".csv", ".png")]
        fmus = [f"{fmu_name(model, name)}.fmu" for model in ("HybridPredictor", "SepCompensator", "FeedDrive")]
        files += [out / f"{name}.state", *(out / "fmus" / one for one in fmus), out / "fmus" / "warm" / fmus[1]]
    return files


def demo(
    out: str | Path, *, full: bool = False, progress: Callable[[str, float], object] = lambda message, fraction: None
) -> Summary:
    """Build the FMUs, co-simulate the staircase, write figures, ``summary.json`` and ``index.html``.

    First the predictor beside the uncompensated drive, then the compensator in its place.

    ``out``: folder for FMUs, figures, results and ``summary.json``; made if needed; ``full``: average the staircase
    over :data:`SEEDS` noise seeds instead of running the first one, and co-simulate the spiral's axes too;
    ``progress``: called with a message and the fraction done. Returns as written to ``summary.json``: for each case
    ``rms_pb_um``, ``rms_hold_um``, ``rms_h_um``, ``reduction_percent``, ``printed`` and more; RMS in µm against the
    measured position. ``compensation`` says for ``off``, ``physics``, ``hybrid_cold``, ``hybrid_warm`` and
    ``fir_inverse`` what :func:`hybridsep.cosim.compensated.compensate` found, for the spiral's axes with the contour
    error of both together, :meth:`hybridsep.cosim.contour.Contour.figures`.
    """
    out = Path(out)
    seeds = SEEDS if full else 1
    total, done = seeds + 6 * full + (len(MACHINES) if full else 1) * (2 + len(COMPENSATED)), count()

    def advance(message: str) -> None:
        progress(message, next(done) / total)

    summary: Summary = {"staircase": _staircase_case(out, seeds, advance)}
    if full:
        summary |= spiral_case(out, advance)
    for name, case in summary.items():
        case["printed"] = PRINTED[name]
    write_whole(out / "summary.json", json.dumps(summary, indent=2) + "\n")
    write_page(out, summary, demo_files(out, full=full))
    progress("done", 1.0)
    return summary


# Page -----------------------------------------------------------------------------------------------------------------


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
        f"off: not compensated; cold: learns in this run; warm: weights of an earlier run; FIR inverse: a filter "
        f"of the command, fitted to the run off{contour}; {_seeds(summary)}",
        tuple(kind.replace("fir_", "FIR ").replace("_", " ") for kind in kinds),
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


def _sizes(case: dict[str, Any], size: str) -> list[str]:
    """Return the errors of physics, hold and hybrid as text, ``rms`` or ``max``."""
    return [shown_figure(case[f"{size}_{name}_um"]) for name in ("pb", "hold", "h")]


def _figures(case: dict[str, Any]) -> list[str]:
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
    about = "FMUs of predictor, compensator and drive, co-simulated over the paper's trajectories, simulated drives"
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
