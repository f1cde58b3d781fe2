"""Compensated runs of the demonstration: a compensator FMU in place of the predictor FMU, cold and warm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.metrics import contour_error
from ..base.settings import PARAMETERS
from ..base.signals import Array
from ..cosim.loop import cosimulate
from ..cosim.run import Run
from ..fmi.archive import build_here
from ..fmi.flavours import FMI_VERSIONS
from ..machines.machine import Machine
from ..plants.encoder import Encoder
from ..plants.trajectory import archimedean_spiral

__all__ = ["COMPENSATED", "Runs", "compensate", "contour_errors", "mean_summary", "train"]

TRAINING_SEED = 1000
"""Noise seed of the training run of a warm compensator; no case uses it."""

COMPENSATED = {"off": "off", "physics": "physics", "hybrid_cold": "hybrid", "hybrid_warm": "hybrid"}
"""Compensated runs of a case, by the keys of :data:`hybridsep.evaluate.figures.CASES`: value of ``compensate``."""

Runs = dict[str, Run]


def compensate(
    machine: Machine,
    plant: Path,
    command: Array,
    out: Path,
    flavour: str,
    fmi: str = FMI_VERSIONS[0],
    *,
    seeds: Sequence[int] = (0,),
    label: str = "",
    advance: Callable[[str], object] = lambda message: None,
) -> tuple[Runs, dict[str, Any]]:
    """Run a machine's compensator FMU against a plant FMU: none, physics, hybrid cold and warm.

    Parameters
    ----------
    machine : Machine
    plant : Path
        Its plant FMU.
    command : (n,) array, m
        Commanded positions.
    out : Path
        Folder: the FMU goes to ``fmus``, the trained one to ``fmus/warm``, what it learned from to ``<machine>.state``.
    flavour : {"native", "python"}
        Flavour of the FMU.
    fmi : str
        Version of FMI, one of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`.
    seeds : sequence of int
        Noise seeds.
    label : str
        Name of the case.
    advance : callable
        Called with it and the name of each run before that.

    Returns
    -------
    runs : dict
        The first seed's, by the keys of :data:`COMPENSATED`.
    summary : dict
        The same keys → means over the seeds of :meth:`Run.summary`, with the spread
        ``tracking_rms_um_std``.
    """
    cold = build_here(machine, "SepCompensator", out / "fmus", flavour, fmi=fmi)
    weights = out / f"{machine.name}.state"
    advance(f"{label}, a run to learn from")
    train(machine, command, weights)
    warm = build_here(machine, "SepCompensator", out / "fmus" / "warm", flavour, weights=weights, fmi=fmi)
    runs: Runs = {}
    summary: dict[str, Any] = {}
    for key, choice in COMPENSATED.items():
        advance(f"{label}, {key.replace('_', ' ')}")
        values = {"compensate": PARAMETERS["compensate"].to_fmi(choice)}
        fmu = warm if key == "hybrid_warm" else cold
        of_seeds = [
            cosimulate(fmu, plant, command, controller_values=values, plant_values={"seed": seed}) for seed in seeds
        ]
        runs[key] = of_seeds[0]
        summary[key] = mean_summary([run.summary() for run in of_seeds], spread="tracking_rms_um")
    return runs, summary


def train(machine: Machine, command: Array, path: Path) -> None:
    """Save what a machine's compensator learns in one run of the library over ``command``, ``(n,)``, m."""
    assert machine.plant is not None
    compensator = machine.new_compensator()
    encoder = Encoder(machine.plant.noise_std, TRAINING_SEED)
    cosimulate(compensator, machine.new_plant(), command, encoder=encoder)
    compensator.predictor.save(path)


def contour_errors(x: Runs, y: Runs) -> dict[str, Array]:
    """Return the contour errors on the paper's spiral, ``(n,)``, m, of the runs of X and Y with the same key."""
    path = archimedean_spiral(0.030, 5.0)
    return {key: contour_error(np.column_stack((x[key].x, y[key].x)), *path) for key in x}


def mean_summary(summaries: list[dict[str, float | int]], *, spread: str) -> dict[str, Any]:
    """Return the mean of each figure over several runs, and the standard deviation of one of them."""
    mean: dict[str, Any] = {key: float(np.mean([s[key] for s in summaries])) for key in summaries[0]}
    mean["n_samples"] = summaries[0]["n_samples"]
    mean[f"{spread}_std"] = float(np.std([s[spread] for s in summaries]))
    return mean
