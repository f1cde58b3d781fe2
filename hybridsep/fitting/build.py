"""Files of a fit: machine file, what was learned, commands to try with, FMUs."""

import hashlib
from pathlib import Path

from ..base.files import COMMANDS, write_whole
from ..base.signals import Array
from ..fmi.compile import no_native
from ..fmi.spec import fmu_name
from ..logs.units import DisplayUnits


def fit_files(out: Path, name: str, *, compensator: bool = False) -> dict[str, Path]:
    """Return the files of a fit of a machine, in their folder, by what they are; FMUs where they can be built."""
    models = {"": "HybridPredictor", **({"compensator ": "SepCompensator"} if compensator else {})}
    archives = {f"native {what}FMU": out / f"{fmu_name(model, name)}.fmu" for what, model in models.items()}
    return {
        "machine file": out / "machine.toml",
        "trained predictor": out / "trained.state",
        "results": out / "fit.json",
        "report": out / "report.html",
        "commands to try": out / COMMANDS,
        **({} if no_native() else archives),
    }


def write_commands(path: Path, x_d: Array, T_s: float, shown: DisplayUnits) -> None:
    """Write commands, m or rad, as a CSV that ``--trajectory`` takes, in the unit in which positions are shown."""
    factor, unit = shown.position
    rows = [f"{k * T_s:.9g},{position!r}\n" for k, position in enumerate((factor * x_d).tolist())]
    write_whole(path, f"# commands of a log, by hybridsep fit, to try with\nt [s],x_d [{unit}]\n{''.join(rows)}")


def sha256_of(path: Path) -> str:
    """Return the hash of a file's content, ``"unknown"`` where it is none that can be read again, as a pipe."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "unknown"
