"""The library's models from the values of an FMU's parameters: how every test that needs both puts them together."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from built_once import built_once, shared_builds

from hybridsep.base.settings import CompensatorSettings, PredictorSettings
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.cosim.loop import cosimulate
from hybridsep.evaluate.backtest import backtest
from hybridsep.fmi.variables import modes_from
from hybridsep.fmi.weights import weights_file
from hybridsep.machines.machine import paper_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor
from hybridsep.predict.regression import RidgeRegression

RUNAWAY = 1e5  # pole of the recursion that diverges: e_h grows by it with each sample


def library_predictor(values: Mapping[str, Any]) -> HybridPredictor:
    """Return the predictor; ``dead_time`` and ``mode[i].*`` must be among the values."""
    model = ModalModel([Mode(**mode) for mode in modes_from(values)], values["dead_time"])
    return HybridPredictor(model, PredictorSettings.from_fmi(values))


def library_compensator(values: Mapping[str, Any]) -> SepCompensator:
    """Return the compensator."""
    return SepCompensator(library_predictor(values), CompensatorSettings.from_fmi(values))


def learned_file(saved: Path | None) -> bytes:
    """Return the content of ``weights.bin`` for a saved predictor; none without one."""
    return weights_file(HybridPredictor.load(saved)) if saved else b""


def trained_predictor(kind: str) -> HybridPredictor:
    """Return the predictor of the default machine's FMU ``kind`` after one staircase."""
    machine, encoder = paper_machine("spring_mass_damper"), Encoder(5e-6, 7)
    if kind == "HybridPredictor":
        predictor = machine.new_predictor()
        backtest(predictor, staircase(), encoder.measure_all(simulate(machine.new_plant(), staircase(), machine.T_s)))
        return predictor
    compensator = machine.new_compensator()
    cosimulate(compensator, machine.new_plant(), staircase()[:4000], encoder=encoder)
    return compensator.predictor


def trained_state(kind: str) -> Path:
    """Return a file with that predictor, saved once for all processes of a test session."""
    return built_once(shared_builds() / f"{kind}.state", lambda path: trained_predictor(kind).save(path))


def runaway_predictor() -> HybridPredictor:
    """Return a predictor of the default machine, without warm-up, whose learned recursion diverges.

    It has a bias and one past residual, so firmly learned that a run changes nothing.
    """
    machine = paper_machine("spring_mass_damper")
    predictor = machine.new_predictor(replace(machine.predictor_settings, t_init=0.0))
    weights = np.zeros(predictor.regression.n_features)
    weights[0], weights[2 + predictor.settings.q] = 1e-3, RUNAWAY
    factor = np.asfortranarray(1e6 * np.eye(predictor.regression.n_features + 1))
    factor[:-1, -1] = factor[:-1, :-1] @ weights
    predictor.take_over((), predictor.state.uncertainty, (RidgeRegression(factor, 1000.0),))
    return predictor
