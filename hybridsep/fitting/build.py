"""Files of a fit: machine file, what was learned, commands to try with, FMUs."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path

from ..base.files import COMMANDS, written_text
from ..base.signals import Array
from ..fmi.archive import build_fmu
from ..fmi.compile import has_native
from ..fmi.flavours import FLAVOURS
from ..fmi.spec import fmu_name
from ..machines.machine import Machine

__all__ = [
    "build_fmus",
    "fit_files",
    "sha256_of",
    "write_commands",
]

_MODELS = {"": "HybridPredictor", "compensator ": "SepCompensator"}
"""Models of the FMUs, by how a compensator's are called."""


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
