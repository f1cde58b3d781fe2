"""Servo-error prediction for CNC feed drives with the linear hybrid model.

A linear physics model of the drive predicts, a recursive ridge regression learns online what it misses, and the sum
stays linear in the command (C.-H. Chou, M. Duan, C. E. Okwudire, CIRP Annals 2021). Start with
:func:`fit`, :func:`load_machine`, :class:`HybridPredictor` and :func:`backtest`.

The names below are loaded when they are first used; others are imported from their package.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .base.version import __version__

if TYPE_CHECKING:
    from .base.errors import HybridSepError
    from .base.settings import CompensatorSettings, Limits, PredictorSettings
    from .compensate.compensator import SepCompensator
    from .cosim.fmu import FmuInstance
    from .cosim.loop import Compensator, cosimulate
    from .cosim.run import Run
    from .evaluate.backtest import backtest
    from .fitting.fit import fit
    from .fmi.archive import build_fmu
    from .fmi.spec import fmu_names
    from .logs.log import Log, read_log
    from .machines.machine import Machine, load_machine, machine_names, paper_machine
    from .model.physics import ModalModel, Mode
    from .online.look_ahead import LookAhead, SepState
    from .plants.plant import Encoder, Plant, simulate
    from .plants.trajectory import PAPER_LIMITS, rest_to_rest, spiral, staircase
    from .predict.predictor import HybridPredictor

__all__ = [
    "PAPER_LIMITS", "Compensator", "CompensatorSettings", "Encoder", "FmuInstance", "HybridPredictor", "HybridSepError",
    "Limits", "Log", "LookAhead", "Machine", "ModalModel", "Mode", "Plant", "PredictorSettings", "Run",
    "SepCompensator", "SepState", "__version__", "backtest", "build_fmu", "cosimulate", "fit", "fmu_names",
    "load_machine", "machine_names", "paper_machine", "read_log", "rest_to_rest", "simulate", "spiral", "staircase",
]  # fmt: skip

_MODULES = {
    name: module
    for module, names in {
        "base.errors": "HybridSepError",
        "base.settings": "CompensatorSettings Limits PredictorSettings",
        "compensate.compensator": "SepCompensator",
        "cosim.fmu": "FmuInstance",
        "cosim.loop": "Compensator cosimulate",
        "cosim.run": "Run",
        "evaluate.backtest": "backtest",
        "fitting.fit": "fit",
        "fmi.archive": "build_fmu",
        "fmi.spec": "fmu_names",
        "logs.log": "Log read_log",
        "machines.machine": "Machine load_machine machine_names paper_machine",
        "model.physics": "ModalModel Mode",
        "online.look_ahead": "LookAhead SepState",
        "plants.plant": "Encoder Plant simulate",
        "plants.trajectory": "PAPER_LIMITS rest_to_rest spiral staircase",
        "predict.predictor": "HybridPredictor",
    }.items()
    for name in names.split()
}
"""Where the names are, without loading it; ``tests/base/test_public_names.py`` holds the three lists together."""

if not TYPE_CHECKING:  # a module's __getattr__ would hide misspelt names from type checkers

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f".{_MODULES[name]}", __name__), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
