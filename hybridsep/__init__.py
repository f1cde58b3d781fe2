"""Servo-error prediction for CNC feed drives with the linear hybrid model.

A linear physics model of the drive predicts, a recursive ridge regression learns online what it misses, and the sum
stays linear in the command (C.-H. Chou, M. Duan, C. E. Okwudire, CIRP Annals 2021). Start with
:func:`load_machine`, :class:`HybridPredictor` and :func:`backtest`.
"""

from __future__ import annotations

__version__ = "0.1.0"

from .base.errors import (
    FmuError,
    HybridSepError,
    LogError,
    MachineError,
    ModelError,
    ParameterError,
    SignalError,
    StateError,
)
from .base.settings import Limits
from .compensate.compensator import SepCompensator, SepState
from .cosim.compensator_run import SepCoSimulation, cosimulate_sep
from .cosim.importer import FmuInstance
from .cosim.predictor_run import CoSimulation, cosimulate
from .evaluate.backtest import Backtest, Scores, backtest, backtest_stream
from .evaluate.closed_loop import ClosedLoop, contour_error, run_closed_loop
from .fmi.archive import build_fmu, fmu_names
from .logs import Log, LogReader, open_log, read_log
from .machine import Machine, load_machine, machine_names
from .model.discrete import DiscreteModel
from .model.physics import ModalModel, Mode
from .plants.encoder import Encoder
from .plants.feed_drive import FeedDrive
from .plants.plant import simulate
from .plants.stage_drive import StageDrive
from .plants.trajectory import (
    PAPER_LIMITS,
    along_path,
    archimedean_spiral,
    read_trajectory,
    rest_to_rest,
    spiral,
    staircase,
)
from .predict.look_ahead import LookAhead
from .predict.predictor import HybridPredictor
from .predict.regression import RidgeRegression
from .predict.window import Prediction, PublishedWindow, WindowOperator

__all__ = [
    "PAPER_LIMITS",
    "Backtest",
    "ClosedLoop",
    "CoSimulation",
    "DiscreteModel",
    "Encoder",
    "FeedDrive",
    "FmuError",
    "FmuInstance",
    "HybridPredictor",
    "HybridSepError",
    "Limits",
    "Log",
    "LogError",
    "LogReader",
    "LookAhead",
    "Machine",
    "MachineError",
    "ModalModel",
    "Mode",
    "ModelError",
    "ParameterError",
    "Prediction",
    "PublishedWindow",
    "RidgeRegression",
    "Scores",
    "SepCoSimulation",
    "SepCompensator",
    "SepState",
    "SignalError",
    "StageDrive",
    "StateError",
    "WindowOperator",
    "along_path",
    "archimedean_spiral",
    "backtest",
    "backtest_stream",
    "build_fmu",
    "contour_error",
    "cosimulate",
    "cosimulate_sep",
    "fmu_names",
    "load_machine",
    "machine_names",
    "open_log",
    "read_log",
    "read_trajectory",
    "rest_to_rest",
    "run_closed_loop",
    "simulate",
    "spiral",
    "staircase",
]
