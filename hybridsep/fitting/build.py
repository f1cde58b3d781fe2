"""Files of a fit: machine file, what was learned, commands to try with, FMUs, and the times of their steps."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from ..base.files import COMMANDS, written_text
from ..base.signals import Array
from ..cosim.adapters import FmuController
from ..fmi.archive import build_fmu
from ..fmi.compile import has_native
from ..fmi.flavours import FLAVOURS
from ..fmi.spec import fmu_name
from ..machines.machine import Machine

__all__ = [
    "Built",
    "StepTimes",
    "build_fmus",
    "fit_files",
    "sha256_of",
    "step_times",
    "write_commands",
]

_TIMED_MAX = 5000
"""Samples that are timed, at most."""

_MODELS = {"": "HybridPredictor", "compensator ": "SepCompensator"}
"""Models of the FMUs, by how a compensator's are called."""


@dataclass(frozen=True)
class StepTimes:
    """Times of an FMU's steps, s: the median, what 99.9 % of them are below, and the largest."""

    median: float
    p99_9: float
    largest: float


@dataclass(frozen=True)
class Built:
    """What was written.

    Attributes
    ----------
    files : mapping
        What a file is → its path.
    steps : StepTimes, optional
        Of the predictor's FMU; None where none is built, or it cannot be run here.
    untimed : str
        Why steps are not timed, though FMUs were built; empty where they are.
    """

    files: Mapping[str, Path]
    steps: StepTimes | None = None
    untimed: str = ""

    @property
    def fmus(self) -> list[Path]:
        """FMUs among the files, the one that is timed first."""
        return [path for path in self.files.values() if path.suffix == ".fmu"]


def fit_files(out: Path, name: str, *, compensator: bool = False) -> dict[str, Path]:
    """Return the files of a fit, by what they are.

    Parameters
    ----------
    out : Path
        Their folder.
    name : str
        The machine's.
    compensator : bool
        Whether there is a compensator's FMU beside each predictor's.
    """
    return {
        "machine file": out / "machine.toml",
        "trained predictor": out / "trained.state",
        "results": out / "fit.json",
        "report": out / "report.html",
        "commands to try": out / COMMANDS,
        **{
            f"{flavour} {what}FMU": out / f"{fmu_name(model, name, flavour)}.fmu"
            for what, model in list(_MODELS.items())[: 2 if compensator else 1]
            for flavour in _flavours()
        },
    }


def _flavours() -> tuple[str, ...]:
    """Return the flavours of FMUs that can be built here."""
    return FLAVOURS if has_native() else FLAVOURS[1:]


def write_commands(path: Path, x_d: Array, T_s: float, unit: str) -> None:
    """Write commands as a CSV that ``--trajectory`` takes, m, or rad where that is the unit."""
    with written_text(path) as file:
        file.write(f"# commands of a log, by hybridsep fit, to try with\nt [s],x_d [{unit}]\n")
        file.writelines(f"{k * T_s:.9g},{position!r}\n" for k, position in enumerate(x_d.tolist()))


def build_fmus(machine: Machine, files: Mapping[str, Path], progress: Callable[[float], object]) -> None:
    """Build the FMUs among :func:`fit_files`, trained."""
    flavours = _flavours()
    for i, flavour in enumerate(flavours):
        progress(i / len(flavours))
        for what in _MODELS:
            if path := files.get(f"{flavour} {what}FMU"):
                build_fmu(machine, path.stem, path.parent, flavour, weights=files["trained predictor"])


def sha256_of(path: Path) -> str:
    """Return the hash of a file's content, ``"unknown"`` where it is none that can be read again, as a pipe."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "unknown"


def step_times(fmu: Path, x_d: Array, x: Array) -> StepTimes:
    """Return times of a predictor FMU's steps over the beginning of a log.

    Parameters
    ----------
    fmu : Path
        A HybridPredictor.
    x_d, x : (n,) array, m
        Commanded and measured positions.
    """
    n = min(len(x_d), _TIMED_MAX)
    taken = np.empty(n)
    controller = FmuController(fmu, {}, 0.0)
    with controller:
        controller.initialise(float(x_d[0]))
        for k in range(n):
            begin = perf_counter()
            controller.step(k, float(x_d[k]), float(x[max(k - controller.delay, 0)]))
            taken[k] = perf_counter() - begin
    return StepTimes(float(np.median(taken)), float(np.quantile(taken, 0.999)), float(taken.max()))
