"""Runs of a machine's compensator against its plant, FMU against FMU: none, physics, hybrid cold and warm, a rival."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.settings import PARAMETERS
from ..base.signals import Array
from ..fmi.archive import build_here
from ..machines.machine import Machine
from ..plants.plant import Encoder
from .fir_inverse import FirInverse, PlayedCommand
from .loop import cosimulate
from .run import Run

COMPENSATED = {"off": "off", "physics": "physics", "hybrid_cold": "hybrid", "hybrid_warm": "hybrid"}
"""Compensated runs of a case, by the keys of :data:`hybridsep.evaluate.figures.CASES`: value of ``compensate``."""

RIVAL = "fir_inverse"  # key of :class:`~hybridsep.cosim.fir_inverse.FirInverse`, fitted to the first run of ``off``

Runs = dict[str, Run]
Advance = Callable[[str], object]  # called with the name of each run before it


def compensate(
    machine: Machine,
    plant: Path,
    command: Array,
    out: Path,
    label: str,
    advance: Advance,
    seeds: Sequence[int] = (),
    reference: bool = True,
) -> tuple[Runs, dict[str, Any]]:
    """Run a machine's compensator FMU against a plant FMU: none, physics, hybrid cold and warm.

    The FMU goes to the folder ``fmus``, the trained one to ``fmus/warm``, what it learned from to ``<machine>.state``.
    The seeds of the noise are the machine's if none are given.

    Returns ``runs``: the first seed's, by the keys of :data:`COMPENSATED` and :data:`RIVAL`; ``summary``: the same
    keys → means over the seeds of :meth:`Run.summary`, with the spread ``tracking_rms_um_std``.
    """
    assert machine.plant is not None
    seeds = seeds or [machine.plant.seed]
    weights = out / f"{machine.name}.state"
    cold = build_here(machine, "SepCompensator", out / "fmus", reference=reference)
    advance(f"{label}, a run to learn from")
    train(machine, command, weights)
    warm = build_here(machine, "SepCompensator", out / "fmus" / "warm", weights=weights, reference=reference)
    runs, summary = Runs(), dict[str, Any]()

    def run(key: str, controller: Path | PlayedCommand, values: dict[str, Any] | None = None) -> None:
        advance(f"{label}, {key.replace('_', ' ')}")
        of_seeds = [
            cosimulate(controller, plant, command, controller_values=values, plant_values={"seed": seed})
            for seed in seeds
        ]
        runs[key] = of_seeds[0]
        summary[key] = mean_summary([run.summary() for run in of_seeds], spread="tracking_rms_um")

    for key, choice in COMPENSATED.items():
        values = {"compensate": PARAMETERS["compensate"].to_fmi(choice)}
        run(key, warm if key == "hybrid_warm" else cold, values)
    rival = FirInverse.fitted([(runs["off"].x_d, runs["off"].x_meas)], machine.compensator_predictor.Np)
    if rival is not None:
        run(RIVAL, PlayedCommand(rival.command(command), machine.T_s))
    return runs, summary


def train(machine: Machine, command: Array, path: Path) -> None:
    """Save what a machine's compensator learns in one run of the library over ``command``, ``(n,)``, m."""
    assert machine.plant is not None
    compensator = machine.new_compensator()
    encoder = Encoder(machine.plant.noise_std, 1000)  # a seed that no case uses
    cosimulate(compensator, machine.new_plant(), command, encoder=encoder)
    compensator.predictor.save(path)


def mean_summary(summaries: list[dict[str, float | int]], *, spread: str) -> dict[str, Any]:
    """Return the mean of each figure over several runs, and the standard deviation of one of them."""
    mean: dict[str, Any] = {key: float(np.mean([s[key] for s in summaries])) for key in summaries[0]}
    std = float(np.std([s[spread] for s in summaries]))
    return mean | {"n_samples": summaries[0]["n_samples"], f"{spread}_std": std}
