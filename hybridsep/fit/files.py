"""Files of a fit, the FMUs among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..base.data_files import COMMANDS, COMMANDS_HEAD
from ..base.output import written_text
from ..base.signals import Array
from ..fmi.archive import fmu_name
from ..fmi.builds import build_here
from ..fmi.flavours import FLAVOURS, FMI_VERSIONS, versions_of
from ..fmi.libraries import check_available, has_native
from ..machines.machine import Machine

__all__ = ["build_fmus", "fit_files", "write_commands"]

_MODELS = {"": "HybridPredictor", "compensator ": "SepCompensator"}
"""Models of the FMUs, by how a compensator's are called."""


def fit_files(out: Path, name: str, *, compensator: bool = False, fmi: str = FMI_VERSIONS[0]) -> dict[str, Path]:
    """Return the files that :func:`~hybridsep.fit.fit.fit` writes and its report, by what they are.

    Parameters
    ----------
    out : Path
        Their folder.
    name : str
        The machine's.
    compensator : bool
        Whether there is a compensator's FMU beside each predictor's.
    fmi : str
        Version of the native FMUs, one of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`.

    Raises
    ------
    ParameterError
        If ``fmi`` is another word.
    FmuError
        If it asks for FMUs of FMI 3.0, and no native ones can be built here.
    """
    return {
        "machine file": out / "machine.toml",
        "trained predictor": out / "trained.state",
        "results": out / "fit.json",
        "report": out / "report.html",
        "commands to try": out / COMMANDS,
        **{
            _called(what, flavour, version): out / f"{fmu_name(model, name, flavour, version)}.fmu"
            for what, model in list(_MODELS.items())[: 2 if compensator else 1]
            for flavour, version in _variants(fmi)
        },
    }


def write_commands(path: Path, x_d: Array, T_s: float, unit: str) -> None:
    """Write commands as a CSV that ``--trajectory`` takes, m, or rad where that is the unit."""
    with written_text(path) as file:
        file.write(f"{COMMANDS_HEAD}\nt [s],x_d [{unit}]\n")
        file.writelines(f"{k * T_s:.9g},{position!r}\n" for k, position in enumerate(x_d.tolist()))


def build_fmus(
    machine: Machine,
    files: Mapping[str, Path],
    progress: Callable[[float], object],
    fmi: str = FMI_VERSIONS[0],
    origin: Mapping[str, Any] | None = None,
) -> Path:
    """Build the FMUs among :func:`fit_files`, trained, and return the first predictor's.

    Parameters
    ----------
    machine, files, fmi
        As :func:`fit_files` has them.
    progress : callable
        Called with the fraction done.
    origin : mapping, optional
        What the FMUs say of their origin, of :func:`~hybridsep.fit.origin.fit_origin`.
    """
    variants = _variants(fmi)
    for i, (flavour, version) in enumerate(variants):
        progress(i / len(variants))
        for what, model in _MODELS.items():
            if path := files.get(_called(what, flavour, version)):
                given: dict[str, Any] = {"weights": files["trained predictor"], "fmi": version, "origin": origin}
                build_here(machine, model, path.parent, flavour, **given)
    return files[_called("", *variants[0])]


def _variants(fmi: str) -> list[tuple[str, str]]:
    """Return flavour and version of FMI of the FMUs that can be built here."""
    if fmi != FMI_VERSIONS[0]:
        check_available(("host",))
    native = [(FLAVOURS[0], version) for version in versions_of(fmi, FLAVOURS[0])]
    python = [(flavour, FMI_VERSIONS[0]) for flavour in FLAVOURS[1:]]
    return [*native, *python] if has_native() else python


def _called(what: str, flavour: str, version: str) -> str:
    return f"{flavour} {what}FMU" if version == FMI_VERSIONS[0] else f"{flavour} {what}FMU, FMI {version}.0"
