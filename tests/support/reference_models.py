"""The library's models as a reference run drives them: what FMUs are compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hybridsep.base.signals import as_samples
from hybridsep.fmi.reference import ReferenceModel
from hybridsep.fmi.spec import FmuSpec
from hybridsep.fmi.weights import restore_weights, weights_file
from hybridsep.machines.machine import Machine
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.plant import Drive, Encoder
from hybridsep.plants.trajectory import staircase


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


def library_models(spec: FmuSpec) -> tuple[ReferenceModel, ReferenceModel | None]:
    """Return the models of a reference run: :func:`library_model`, and the machine's plant if it has one."""
    plant = None if spec.machine.plant is None else _plant(spec.machine)
    return library_model(spec), plant


def library_model(spec: FmuSpec) -> ReferenceModel:
    """Return the model of an FMU, at its start values."""
    machine, table = spec.machine, spec.table
    if table.model == "FeedDrive":
        return _plant(machine)
    if table.model == "ReferenceTrajectory":
        played = staircase(machine.T_s) if spec.samples is None else as_samples(spec.samples, "samples")
        return _TrajectoryModel(played.tolist())
    t_init = table.parameters["t_init"]
    if table.model == "HybridPredictor":
        predictor = machine.new_predictor(replace(machine.predictor_settings, t_init=t_init))
        look_ahead = LookAhead(predictor, 0.0)
    else:
        compensator = machine.new_compensator(predictor=replace(machine.compensator_predictor, t_init=t_init))
        predictor = compensator.predictor
        look_ahead = LookAhead(compensator, 0.0)
    if spec.trained is not None:
        restore_weights(predictor, weights_file(spec.trained))
    return _LookAheadModel(look_ahead, list(table.named("output")))


def _plant(machine: Machine) -> _PlantModel:
    assert machine.plant is not None  # by fmu_names
    encoder = Encoder(machine.plant.noise_std, machine.plant.seed)
    return _PlantModel(machine.new_plant(), encoder, machine.T_s)
