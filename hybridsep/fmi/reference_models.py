"""The library's models as a reference run drives them: where no FMU can be run, and for the tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..base.signals import as_samples
from ..machines.machine import Machine
from ..online.look_ahead import LookAhead
from ..plants.encoder import Encoder
from ..plants.plant import Drive
from ..plants.trajectory import staircase
from ..predict.predictor import HybridPredictor
from .reference import ReferenceModel
from .variables import variables_of
from .weights import restore_weights, weights_file

__all__ = ["library_model", "library_models"]


class _LookAheadModel:
    """A predictor or a compensator, sample by sample."""

    def __init__(self, look_ahead: LookAhead, names: Sequence[str]) -> None:
        self._look_ahead, self._names = look_ahead, names

    def outputs(self) -> list[float]:
        return [float(getattr(self._look_ahead, name)) for name in self._names]

    def sample(self, *inputs: float) -> None:
        self._look_ahead.sample(*inputs)


class _PlantModel:
    """A drive with its encoder."""

    def __init__(self, plant: Drive, encoder: Encoder, T_s: float) -> None:
        self._plant, self._encoder, self._T_s = plant, encoder, T_s
        plant.reset(0.0)

    def outputs(self) -> list[float]:
        return [self._plant.x, self._plant.v, self._encoder.measure(self._plant.x)]

    def sample(self, *inputs: float) -> None:
        self._plant.step(inputs[0], self._T_s)


class _TrajectoryModel:
    """Positions, the last of which stays."""

    def __init__(self, positions: Sequence[float]) -> None:
        self._positions, self._k = positions, 0

    def outputs(self) -> list[float]:
        return [self._positions[min(self._k, len(self._positions) - 1)]]

    def sample(self, *inputs: float) -> None:
        self._k += 1


def library_models(
    machine: Machine,
    description: Mapping[str, Any],
    *,
    samples: ArrayLike | None = None,
    trained: HybridPredictor | None = None,
) -> tuple[ReferenceModel, ReferenceModel | None]:
    """Return the models of a reference run: :func:`library_model`, and the machine's plant if it has one."""
    model = library_model(machine, description, samples=samples, trained=trained)
    plant = None if machine.plant is None else library_model(machine, {"model": "FeedDrive"})
    return model, plant


def library_model(
    machine: Machine,
    description: Mapping[str, Any],
    *,
    samples: ArrayLike | None = None,
    trained: HybridPredictor | None = None,
) -> ReferenceModel:
    """Return the model of an FMU, at its start values.

    Parameters
    ----------
    machine : Machine
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    samples : (n,) array_like, m, optional
        Trajectory 3 of ReferenceTrajectory.
    trained : HybridPredictor, optional
        Trained predictor with which a HybridPredictor or SepCompensator starts warm.
    """
    model = str(description["model"])
    if model == "FeedDrive":
        assert machine.plant is not None  # by fmu_names
        encoder = Encoder(machine.plant.noise_std, machine.plant.seed)
        return _PlantModel(machine.new_plant(), encoder, machine.T_s)
    if model == "ReferenceTrajectory":
        played = staircase(machine.T_s) if samples is None else as_samples(samples, "samples")
        return _TrajectoryModel(played.tolist())
    t_init = description["parameters"]["t_init"]
    names = [variable.name for variable in variables_of(description) if variable.causality == "output"]
    if model == "HybridPredictor":
        predictor = machine.new_predictor(replace(machine.predictor_settings, t_init=t_init))
        look_ahead = LookAhead(predictor, 0.0)
    else:
        compensator = machine.new_compensator(predictor=replace(machine.compensator_predictor, t_init=t_init))
        predictor = compensator.predictor
        look_ahead = LookAhead(compensator, 0.0)
    if trained is not None:
        restore_weights(predictor, weights_file(trained))
    return _LookAheadModel(look_ahead, names)
