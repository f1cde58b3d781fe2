"""Warm-start check of a saved predictor against the machine whose FMU gets its weights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import StateError
from ..machines.machine import Machine

if TYPE_CHECKING:
    from ..predict.predictor import HybridPredictor

__all__ = ["load_trained", "warm_predictor"]


def warm_predictor(machine: Machine, weights: str | Path | None) -> HybridPredictor:
    """Return a machine's predictor at the beginning of a run, with what a saved one has learned where it is given.

    Raises
    ------
    StateError
        As :func:`load_trained`.
    """
    if weights is None:
        return machine.new_predictor()
    predictor = load_trained(weights, machine, "HybridPredictor")
    predictor.restart()
    return predictor


def load_trained(path: str | Path, machine: Machine, model: str) -> HybridPredictor:
    """Return the predictor that :meth:`HybridPredictor.save` wrote.

    Parameters
    ----------
    path : str or Path
    machine : Machine
        Machine that it must have been trained for: ``Np``, ``p``, ``q``, ``lambda``, ``T_s``, ``input_hold``,
        ``dead_time`` and modes.
    model : {"HybridPredictor", "SepCompensator"}
        Which of the machine's two sets of ``Np``, ``p``, ``q`` and ``lambda`` is meant.

    Raises
    ------
    StateError
        If the file is not a saved predictor, one of another machine, naming all that differs, or has learned nothing.
    """
    from ..predict.predictor import HybridPredictor

    path = Path(path)
    try:
        trained = HybridPredictor.load(path)
    except StateError as error:
        raise StateError(f"{path.name}: {error}") from error
    compensates = model == "SepCompensator"
    user = machine.new_compensator().predictor if compensates else machine.new_predictor()
    found, expected = _parameters(trained), _parameters(user)
    differing = [
        f"{name} = {found.get(name, 'none')} instead of {expected.get(name, 'none')}"
        for name in {**expected, **found}
        if found.get(name) != expected.get(name)
    ]
    if differing:
        subject = "'s compensator" if compensates else ""
        raise StateError(
            f"{path.name} was not trained for machine {machine.name}{subject}: it has {', '.join(differing)}; "
            "train it with that machine, or correct the machine file"
        )
    if trained.regression.n_rows == 0:
        raise StateError(f"{path.name} has learned no sample; save the predictor after a run")
    return trained


def _parameters(predictor: HybridPredictor) -> dict[str, object]:
    """Return the settings that must agree, by their names in the machine file."""
    from .weights import learned_settings

    return {"Np": predictor.Np, **learned_settings(predictor), "input_hold": predictor.settings.input_hold}
