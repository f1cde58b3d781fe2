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
    from .cosim.adapters import Compensator
    from .cosim.fmu import FmuInstance
    from .cosim.loop import cosimulate
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
    "PAPER_LIMITS",
    "Compensator",
    "CompensatorSettings",
    "Encoder",
    "FmuInstance",
    "HybridPredictor",
    "HybridSepError",
    "Limits",
    "Log",
    "LookAhead",
    "Machine",
    "ModalModel",
    "Mode",
    "Plant",
    "PredictorSettings",
    "Run",
    "SepCompensator",
    "SepState",
    "__version__",
    "backtest",
    "build_fmu",
    "cosimulate",
    "fit",
    "fmu_names",
    "load_machine",
    "machine_names",
    "paper_machine",
    "read_log",
    "rest_to_rest",
    "simulate",
    "spiral",
    "staircase",
]

_MODULES = {
    "PAPER_LIMITS": "plants.trajectory",
    "Compensator": "cosim.adapters",
    "CompensatorSettings": "base.settings",
    "Encoder": "plants.plant",
    "FmuInstance": "cosim.fmu",
    "HybridPredictor": "predict.predictor",
    "HybridSepError": "base.errors",
    "Limits": "base.settings",
    "Log": "logs.log",
    "LookAhead": "online.look_ahead",
    "Machine": "machines.machine",
    "ModalModel": "model.physics",
    "Mode": "model.physics",
    "Plant": "plants.plant",
    "PredictorSettings": "base.settings",
    "Run": "cosim.run",
    "SepCompensator": "compensate.compensator",
    "SepState": "online.look_ahead",
    "backtest": "evaluate.backtest",
    "build_fmu": "fmi.archive",
    "cosimulate": "cosim.loop",
    "fit": "fitting.fit",
    "fmu_names": "fmi.spec",
    "load_machine": "machines.machine",
    "machine_names": "machines.machine",
    "paper_machine": "machines.machine",
    "read_log": "logs.log",
    "rest_to_rest": "plants.trajectory",
    "simulate": "plants.plant",
    "spiral": "plants.trajectory",
    "staircase": "plants.trajectory",
}
"""Where the names are, without loading it; ``tests/base/test_public_names.py`` holds the three lists together."""

if not TYPE_CHECKING:  # a module's __getattr__ would hide misspelt names from type checkers

    def __getattr__(name: str) -> Any:
        """Load a public name."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f".{_MODULES[name]}", __name__), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
