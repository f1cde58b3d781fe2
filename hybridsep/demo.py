"""The main job, end to end: build the FMUs, co-simulate the paper's cases, score them, draw them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import plots
from .backtest import Backtest, backtest
from .cosim import CoSimulation, cosimulate
from .fmi.archive import build_fmu, fmu_names
from .fmi.compiler import can_compile
from .logs import Log, read_log
from .machine import Machine, load_machine
from .signals import Array
from .trajectory import spiral, staircase

__all__ = ["PRINTED", "RecordedReplay", "demo"]

PRINTED = {
    "staircase": {"rms_pb_um": 33.7, "rms_h_um": 14.7, "reduction_percent": 56.4},
    "spiral_x": {"rms_pb_um": 22.0, "reduction_percent": 38.0},
    "spiral_y": {"rms_pb_um": 130.2, "reduction_percent": 27.0},
    "emps": {},
}
"""What the paper prints for each case."""

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
        return np.asarray(np.arange(len(self.log.x)) * self.log.Ts, dtype=np.float64)

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


def demo(
    out: str | Path,
    *,
    emps: str | Path | None = None,
    seeds: int = SEEDS,
    backend: str | None = None,
    progress: Progress = lambda message, fraction: None,
) -> Summary:
    """Build the FMUs, co-simulate the staircase and the spiral, write figures and ``summary.json``.

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
        ``reduction_percent``, ``printed`` and more; RMS in µm against the measured position.
    """
    if backend is None:
        backend = "native" if can_compile() else "python"
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    total = seeds + 6 + (emps is not None)
    done = 0

    def advance(message: str) -> None:
        nonlocal done
        progress(message, done / total)
        done += 1

    summary: Summary = {}
    machine = load_machine("spring_mass_damper")
    runs = []
    fmus = _build_pair(machine, out / "fmus", backend)
    for seed in range(seeds):
        advance(f"staircase, FMU against FMU, noise seed {seed}")
        runs.append(cosimulate(*fmus, staircase(machine.T_s), plant_values={"seed": seed}))
    summary["staircase"] = {
        **_mean([run.summary() for run in runs]),
        "n_seeds": seeds,
        "batches_of_seed": 0,
        **_worse(runs[0]),
    }
    runs[0].save(out / "staircase.csv")
    plots.prediction_figure(
        runs[0], "Staircase (cf. the paper's Fig. 4), FMU against FMU, noise seed 0", out / "staircase.png"
    )

    commands = dict(zip(("x", "y"), spiral(), strict=True))
    axes: dict[str, CoSimulation] = {}
    for axis, command in commands.items():
        machine = load_machine(f"als25010_{axis}")
        fmus = _build_pair(machine, out / "fmus", backend)
        advance(f"spiral, {axis.upper()} axis")
        axes[axis] = run = cosimulate(*fmus, command)
        case = summary[f"spiral_{axis}"] = {**run.summary(), "tuned_to_printed": True, **_worse(run)}
        for name, off in (("friction_alone", "kappa"), ("stiffness_alone", "f")):
            advance(f"spiral, {axis.upper()} axis, {name.replace('_', ' ')}")
            case[name] = cosimulate(*fmus, command, plant_values={off: 0.0}).summary()
        run.save(out / f"spiral_{axis}.csv")
        title = f"Spiral, {axis.upper()} axis (cf. the paper's Fig. 8), FMU against FMU"
        plots.prediction_figure(run, title, out / f"spiral_{axis}.png")
    plots.spiral_figure(axes["x"], axes["y"], out / "spiral.png")

    if emps is not None:
        advance("EMPS, a recorded axis")
        replay = replay_emps(emps)
        summary["emps"] = {**replay.result.summary(), **_worse(replay)}
        plots.prediction_figure(replay, "EMPS, a recorded axis: causal replay", out / "emps.png")
    for name, case in summary.items():
        case["printed"] = PRINTED[name]
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    progress("done", 1.0)
    return summary


def replay_emps(path: str | Path) -> RecordedReplay:
    """Replay the EMPS recording with its published constants.

    Raises
    ------
    LogError
        If the file cannot be read as a ``DATA_EMPS.mat``.
    """
    machine = load_machine("emps")
    log = read_log(path, columns=machine.log.model_dump())
    predictor = machine.new_predictor()
    return RecordedReplay(log, backtest(predictor, log.x_d, log.x), predictor.Np)


def _build_pair(machine: Machine, out: Path, backend: str) -> tuple[Path, Path]:
    """Build a machine's predictor and plant FMU."""
    names = {model: name for name, model in fmu_names(machine, backend).items()}
    host = ("host",)
    predictor = build_fmu(machine, names["HybridPredictor"], out, backend, targets=host)
    return predictor, build_fmu(machine, names["FeedDrive"], out, backend, targets=host)


def _mean(summaries: list[dict[str, float | int]]) -> dict[str, Any]:
    """Return the mean of each figure over the runs, and the spread of the hybrid's RMS."""
    mean: dict[str, Any] = {key: float(np.mean([s[key] for s in summaries])) for key in summaries[0]}
    mean["n_samples"] = summaries[0]["n_samples"]
    mean["rms_h_um_std"] = float(np.std([s["rms_h_um"] for s in summaries]))
    return mean


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
