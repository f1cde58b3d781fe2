"""Demonstration: builds the FMUs, co-simulates the paper's cases, scores and draws them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from ..base.output import written_text
from ..fmi.archive import fmu_names
from ..fmi.builds import default_flavour
from ..fmi.flavours import FMI_VERSIONS, versions_of
from ..machines.machine import load_machine
from .cases import MACHINES, Summary, read_recorded, recorded_case, spiral_case, staircase_case
from .compensation import COMPENSATED
from .published import PRINTED

__all__ = ["demo", "demo_files", "processor_time"]

SEEDS = 10

_PROCESSOR_TIME = {"native": (100.0, 2.0), "python": (1000.0, 20.0)}
"""Processor time of a demonstration without any noise seed and for each, s, by flavour.

Native took 112 s with one seed and 114 s with ten; Python's FMUs take about ten times as long.
"""

Progress = Callable[[str, float], object]


def demo_files(out: str | Path, flavour: str, *, emps: bool, fmi: str = FMI_VERSIONS[0]) -> list[Path]:
    """Return all files that :func:`demo` writes, with or without the recorded axis; ParameterError as there."""
    out = Path(out)
    files = [
        out / name for name in ("summary.json", "spiral.png", "spiral_contour.png", *(["emps.png"] if emps else []))
    ]
    for case, name in MACHINES.items():
        files += [out / f"{case}{what}{end}" for what in ("", "_compensated") for end in (".csv", ".png")]
        files.append(out / f"{name}.state")
        names = [fmu_names(load_machine(name), flavour, version) for version in versions_of(fmi, flavour)]
        for fmu, model in (item for of_version in names for item in of_version.items()):
            if model in ("HybridPredictor", "SepCompensator", "FeedDrive"):
                files.append(out / "fmus" / f"{fmu}.fmu")
            if model == "SepCompensator":
                files.append(out / "fmus" / "warm" / f"{fmu}.fmu")
    return files


def processor_time(seeds: int, flavour: str) -> str:
    """Return roughly how much processor time a demonstration takes, in words."""
    fixed, each = _PROCESSOR_TIME[flavour]
    minutes = (fixed + each * seeds) / 60.0
    return f"about {minutes:.0f} minutes" if minutes > 1.5 else "about a minute"


def demo(
    out: str | Path,
    *,
    emps: str | Path | None = None,
    seeds: int = SEEDS,
    flavour: str | None = None,
    fmi: str = FMI_VERSIONS[0],
    progress: Progress = lambda message, fraction: None,
) -> Summary:
    """Build the FMUs, co-simulate the staircase and the spiral, write figures and ``summary.json``.

    First the predictor beside the uncompensated drive, then the compensator in its place.

    Parameters
    ----------
    out : str or Path
        Folder for FMUs, figures, results and ``summary.json``; made if needed.
    emps : str or Path, optional
        A ``DATA_EMPS.mat`` to replay too.
    seeds : int
        Noise seeds the staircase is averaged over, ≥ 1.
    flavour : {"native", "python"}, optional
        Flavour of the FMUs; native where their libraries are there, if left out.
    fmi : str
        Version of FMI, one of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`; of both FMUs are written, and 2.0's are run.
    progress : callable
        Called with a message and the fraction done.

    Returns
    -------
    dict
        As written to ``summary.json``: for each case ``rms_pb_um``, ``rms_hold_um``, ``rms_h_um``,
        ``reduction_percent``, ``printed`` and more; RMS in µm against the measured position. ``compensation`` says for
        ``off``, ``physics``, ``hybrid_cold`` and ``hybrid_warm`` what
        :func:`hybridsep.demo.compensation.compensate` found, for the spiral's axes with the contour error of both
        together, ``contour_rms_um`` and ``contour_max_um``.

    Raises
    ------
    LogError
        If ``emps`` cannot be read; nothing has been done then.
    ParameterError
        If ``fmi`` is another word, or a version that the flavour has not.
    """
    flavour = flavour or default_flavour()
    versions_of(fmi, flavour)
    recorded = None if emps is None else read_recorded(emps)  # first: a refusal must not come after minutes of work
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    total = seeds + 7 + 3 * len(COMPENSATED) + (recorded is not None)
    done = 0

    def advance(message: str) -> None:
        nonlocal done
        progress(message, done / total)
        done += 1

    advance("build the staircase's FMUs")
    summary: Summary = {
        "staircase": staircase_case(out, seeds, flavour, advance, fmi),
        **spiral_case(out, flavour, advance, fmi),
    }
    if recorded is not None:
        advance("EMPS, a recorded axis")
        summary["emps"] = recorded_case(recorded, out)
    for name, case in summary.items():
        case["printed"] = PRINTED[name]
    with written_text(out / "summary.json") as file:
        file.write(json.dumps(summary, indent=2) + "\n")
    progress("done", 1.0)
    return summary
