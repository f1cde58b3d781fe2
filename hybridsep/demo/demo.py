"""Demonstration: builds the FMUs, co-simulates the paper's cases, scores and draws them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from ..base.output import written_text
from ..fmi.archive import default_flavour
from ..fmi.flavours import FMI_VERSIONS, versions_of
from ..fmi.spec import fmu_names
from ..machines.machine import load_machine
from .cases import MACHINES, Summary, read_recorded, recorded_case, spiral_case, staircase_case
from .compensation import COMPENSATED
from .page import write_page
from .published import PRINTED

__all__ = ["demo", "demo_files", "processor_time"]

SEEDS = 10
"""Noise seeds that a full demonstration's staircase is averaged over."""

_PROCESSOR_TIME = {
    ("native", False): "10 seconds",
    ("native", True): "a minute",
    ("python", False): "2 minutes",
    ("python", True): "20 minutes",
}
"""Rough processor time of a demonstration, by flavour and whether it is a full one."""

Progress = Callable[[str, float], object]


def demo_files(
    out: str | Path, flavour: str, *, full: bool = False, emps: bool = False, fmi: str = FMI_VERSIONS[0]
) -> list[Path]:
    """Return all files that :func:`demo` writes, with or without the recorded axis; ParameterError as there."""
    out = Path(out)
    own = ["index.html", "summary.json", *(["spiral.png", "spiral_contour.png"] if full else [])]
    files = [out / name for name in (*own, *(["emps.png"] if emps else []))]
    for case, name in MACHINES.items() if full else [*MACHINES.items()][:1]:
        files += [out / f"{case}{what}{end}" for what in ("", "_compensated") for end in (".csv", ".png")]
        files.append(out / f"{name}.state")
        names = [fmu_names(load_machine(name), flavour, version) for version in versions_of(fmi, flavour)]
        for fmu, model in (item for of_version in names for item in of_version.items()):
            if model in ("HybridPredictor", "SepCompensator", "FeedDrive"):
                files.append(out / "fmus" / f"{fmu}.fmu")
            if model == "SepCompensator":
                files.append(out / "fmus" / "warm" / f"{fmu}.fmu")
    return files


def processor_time(flavour: str, full: bool = False) -> str:
    """Return roughly how much processor time a demonstration takes, in words."""
    return f"about {_PROCESSOR_TIME[flavour, full]}"


def demo(
    out: str | Path,
    *,
    full: bool = False,
    emps: str | Path | None = None,
    flavour: str | None = None,
    fmi: str = FMI_VERSIONS[0],
    progress: Progress = lambda message, fraction: None,
) -> Summary:
    """Build the FMUs, co-simulate the staircase, write figures, ``summary.json`` and ``index.html``.

    First the predictor beside the uncompensated drive, then the compensator in its place.

    Parameters
    ----------
    out : str or Path
        Folder for FMUs, figures, results and ``summary.json``; made if needed.
    full : bool
        Average the staircase over :data:`SEEDS` noise seeds instead of running the first one, and co-simulate the
        spiral's axes too.
    emps : str or Path, optional
        A ``DATA_EMPS.mat`` to replay too.
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
    seeds = SEEDS if full else 1
    cases = len(MACHINES) if full else 1
    total = seeds + 6 * full + cases * (1 + len(COMPENSATED)) + (recorded is not None)
    done = 0

    def advance(message: str) -> None:
        nonlocal done
        progress(message, done / total)
        done += 1

    summary: Summary = {"staircase": staircase_case(out, seeds, flavour, advance, fmi)}
    if full:
        summary |= spiral_case(out, flavour, advance, fmi)
    if recorded is not None:
        advance("EMPS, a recorded axis")
        summary["emps"] = recorded_case(recorded, out)
    for name, case in summary.items():
        case["printed"] = PRINTED[name]
    with written_text(out / "summary.json") as file:
        file.write(json.dumps(summary, indent=2) + "\n")
    write_page(out, summary, demo_files(out, flavour, full=full, emps=recorded is not None, fmi=fmi))
    progress("done", 1.0)
    return summary
