"""The main job, end to end: build the FMUs, co-simulate the paper's cases, score them, draw them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.output import written_text
from ..base.signals import Array
from ..cosim.predictor_run import CoSimulation, cosimulate
from ..evaluate import plots, sep_plots
from ..evaluate.backtest import Backtest, backtest
from ..fmi.archive import fmu_names
from ..fmi.compiler import can_compile
from ..logs import Log, read_log
from ..machine import Machine, load_machine
from ..plants.trajectory import spiral, staircase
from .sep_demo import KINDS, Runs, build_for_host, compensate, contour_errors, mean_summary

__all__ = ["MACHINES", "PRINTED", "RecordedReplay", "Summary", "default_backend", "demo", "demo_files"]

PRINTED = {
    "staircase": {"rms_pb_um": 33.7, "rms_h_um": 14.7, "reduction_percent": 56.4},
    "spiral_x": {"rms_pb_um": 22.0, "rms_h_um": 13.7, "reduction_percent": 38.0},
    "spiral_y": {"rms_pb_um": 130.2, "rms_h_um": 94.5, "reduction_percent": 27.0},
    "emps": {},
}
"""What the paper prints for each case."""

MACHINES = {"staircase": "spring_mass_damper", "spiral_x": "als25010_x", "spiral_y": "als25010_y"}
"""The machine of each case."""

SEEDS = 10

Progress = Callable[[str, float], object]
Summary = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class RecordedReplay:
    """A backtest with its log, as :mod:`hybridsep.plots` wants it; arrays ``(n,)``, s and m."""

    log: Log
    result: Backtest
    Np: int

    @property
    def t(self) -> Array:
        """Time, s."""
        return np.asarray(np.arange(len(self.log.x)) * self.log.T_s, dtype=np.float64)

    @property
    def x_d(self) -> Array:
        """Commanded position, m."""
        return self.log.x_d

    @property
    def x_meas(self) -> Array:
        """Measured position, m."""
        return self.log.x

    @property
    def active(self) -> NDArray[np.bool_]:
        """Whether the hybrid is published, after the warm-up."""
        return self.result.active

    @property
    def x_pb(self) -> Array:
        """Physics-based prediction, m."""
        return self.result.x_pb

    @property
    def x_hold(self) -> Array:
        """Hold baseline, m."""
        return self.result.x_hold

    @property
    def x_h(self) -> Array:
        """Hybrid prediction, m."""
        return self.result.x_h

    def batch_rms(self) -> dict[str, Array]:
        """RMS of each batch, m."""
        return {
            "x_pb": self.result.batch_rms_pb,
            "x_hold": self.result.batch_rms_hold,
            "x_h": self.result.batch_rms_h,
        }


def default_backend() -> str:
    """Return the flavour of the demo's FMUs: native where there is a C compiler, Python otherwise."""
    return "native" if can_compile() else "python"


def demo_files(out: str | Path, backend: str, *, emps: bool) -> list[Path]:
    """Return all files that :func:`demo` writes, with or without the recorded axis."""
    out = Path(out)
    files = [
        out / name for name in ("summary.json", "spiral.png", "spiral_contour.png", *(["emps.png"] if emps else []))
    ]
    for case, name in MACHINES.items():
        files += [out / f"{case}{what}{end}" for what in ("", "_compensated") for end in (".csv", ".png")]
        files.append(out / f"{name}.state")
        for fmu, model in fmu_names(load_machine(name), backend).items():
            if model in ("HybridPredictor", "SepCompensator", "FeedDrive"):
                files.append(out / "fmus" / f"{fmu}.fmu")
            if model == "SepCompensator":
                files.append(out / "fmus" / "warm" / f"{fmu}.fmu")
    return files


def demo(
    out: str | Path,
    *,
    emps: str | Path | None = None,
    seeds: int = SEEDS,
    backend: str | None = None,
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
    backend : {"native", "python"}, optional
        Flavour of the FMUs; native where there is a C compiler, if left out.
    progress : callable
        Called with a message and the fraction done.

    Returns
    -------
    dict
        As written to ``summary.json``: for each case ``rms_pb_um``, ``rms_hold_um``, ``rms_h_um``,
        ``reduction_percent``, ``printed`` and more; RMS in µm against the measured position. ``compensation`` says for
        ``none``, ``physics``, ``hybrid_cold`` and ``hybrid_warm`` what :func:`hybridsep.sep_demo.compensate` found,
        for the spiral's axes with the contour error of both together, ``contour_rms_um`` and ``contour_max_um``.

    Raises
    ------
    LogError
        If ``emps`` cannot be read; nothing has been done then.
    """
    backend = backend or default_backend()
    recorded = None if emps is None else read_recorded(emps)  # a file that cannot be read must not end four minutes
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    total = seeds + 6 + 3 * len(KINDS) + (recorded is not None)
    done = 0

    def advance(message: str) -> None:
        nonlocal done
        progress(message, done / total)
        done += 1

    summary: Summary = {"staircase": _staircase(out, seeds, backend, advance), **_spiral(out, backend, advance)}
    if recorded is not None:
        advance("EMPS, a recorded axis")
        replay = replay_recorded(recorded)
        summary["emps"] = {**replay.result.summary(), **_worse(replay)}
        plots.prediction_figure(replay, "EMPS, a recorded axis: causal replay", out / "emps.png")
    for name, case in summary.items():
        case["printed"] = PRINTED[name]
    with written_text(out / "summary.json") as file:
        file.write(json.dumps(summary, indent=2) + "\n")
    progress("done", 1.0)
    return summary


def _staircase(out: Path, seeds: int, backend: str, advance: Callable[[str], None]) -> dict[str, Any]:
    """Predict and compensate on the staircase."""
    machine = load_machine(MACHINES["staircase"])
    command = staircase(machine.T_s)
    fmus = _build_pair(machine, out / "fmus", backend)
    runs = []
    for seed in range(seeds):
        advance(f"staircase, FMU against FMU, noise seed {seed}")
        runs.append(cosimulate(*fmus, command, plant_values={"seed": seed}))
    runs[0].save(out / "staircase.csv")
    title = "Staircase (cf. the paper's Fig. 4), FMU against FMU, noise seed 0"
    plots.prediction_figure(runs[0], title, out / "staircase.png")
    compensated, compensation = compensate(
        machine, fmus[1], command, out, backend, seeds=range(seeds), advance=partial(_say, advance, "staircase")
    )
    compensated["hybrid_warm"].save(out / "staircase_compensated.csv")
    title = "Staircase, compensated: FMU against FMU, noise seed 0"
    sep_plots.tracking_figure(compensated, title, out / "staircase_compensated.png")
    return {
        **mean_summary([run.summary() for run in runs], spread="rms_h_um"),
        "n_seeds": seeds,
        "batches_of_seed": 0,
        **_worse(runs[0]),
        "compensation": compensation,
    }


def _spiral(out: Path, backend: str, advance: Callable[[str], None]) -> Summary:
    """Predict and compensate on the spiral, both axes."""
    summary: Summary = {}
    axes: dict[str, CoSimulation] = {}
    compensated: dict[str, Runs] = {}
    for axis, command in zip(("x", "y"), spiral(), strict=True):
        machine, label = load_machine(MACHINES[f"spiral_{axis}"]), f"spiral, {axis.upper()} axis"
        fmus = _build_pair(machine, out / "fmus", backend)
        advance(label)
        axes[axis] = run = cosimulate(*fmus, command)
        case = summary[f"spiral_{axis}"] = {**run.summary(), "physics_tuned_to_printed": True, **_worse(run)}
        for name, off in (("friction_alone", "kappa"), ("stiffness_alone", "f")):
            advance(f"{label}, {name.replace('_', ' ')}")
            case[name] = cosimulate(*fmus, command, plant_values={off: 0.0}).summary()
        run.save(out / f"spiral_{axis}.csv")
        title = f"Spiral, {axis.upper()} axis (cf. the paper's Fig. 8), FMU against FMU"
        plots.prediction_figure(run, title, out / f"spiral_{axis}.png")
        compensated[axis], case["compensation"] = compensate(
            machine, fmus[1], command, out, backend, advance=partial(_say, advance, label)
        )
        compensated[axis]["hybrid_warm"].save(out / f"spiral_{axis}_compensated.csv")
        title = f"Spiral, {axis.upper()} axis, compensated: FMU against FMU"
        sep_plots.tracking_figure(compensated[axis], title, out / f"spiral_{axis}_compensated.png")
    plots.spiral_figure(axes["x"], axes["y"], out / "spiral.png")
    errors = contour_errors(compensated["x"], compensated["y"])
    pairs = {kind: (compensated["x"][kind], compensated["y"][kind]) for kind in KINDS}
    sep_plots.contour_figure(pairs, errors, "Spiral, X and Y compensated: contour error", out / "spiral_contour.png")
    for case in summary.values():
        for kind, error in errors.items():
            figures = {"rms": np.sqrt(np.mean(error**2)), "max": np.max(error)}
            case["compensation"][kind] |= {f"contour_{key}_um": 1e6 * float(v) for key, v in figures.items()}
    return summary


def read_recorded(path: str | Path) -> Log:
    """Read the EMPS recording.

    Raises
    ------
    LogError
        If the file cannot be read as a ``DATA_EMPS.mat``.
    """
    return read_log(path, columns=load_machine("emps").log.model_dump())


def replay_recorded(log: Log) -> RecordedReplay:
    """Replay the EMPS recording with its published constants."""
    predictor = load_machine("emps").new_predictor()
    return RecordedReplay(log, backtest(predictor, log.x_d, log.x), predictor.Np)


def _say(advance: Callable[[str], None], case: str, kind: str) -> None:
    """Say which kind of compensation of a case is run next."""
    advance(f"{case}, {kind}")


def _build_pair(machine: Machine, out: Path, backend: str) -> tuple[Path, Path]:
    """Build a machine's predictor and plant FMU."""
    return (
        build_for_host(machine, "HybridPredictor", out, backend),
        build_for_host(machine, "FeedDrive", out, backend),
    )


def _worse(replay: plots.Replay) -> dict[str, Any]:
    """Return in which batches the hybrid is worse than the physics model, and in how many worse than hold."""
    rms = replay.batch_rms()
    worse = np.flatnonzero(rms["x_h"] > rms["x_pb"])
    step = replay.Np * float(replay.t[1] - replay.t[0])
    return {
        "n_batches": len(rms["x_h"]),
        "n_batches_worse_than_hold": int(np.count_nonzero(rms["x_h"] > rms["x_hold"])),
        "batches_hybrid_worse": [
            {
                "t_s": round(float(j * step), 9),
                "rms_pb_um": 1e6 * float(rms["x_pb"][j]),
                "rms_h_um": 1e6 * float(rms["x_h"][j]),
            }
            for j in worse
        ],
    }
