"""Build FMUs: the same sources and the same machine give the same bytes.

A pythonfmu FMU carries the slave, the part of this library that it needs, pythonfmu itself and pythonfmu's binaries.
The library travels under a name with a number of its content (``hybridsep_1a2b…``), because two FMUs in one process
share every module of the same name, and the one loaded first would silently serve both.
"""

from __future__ import annotations

import hashlib
import html
import json
import re
import uuid
import zipfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import pythonfmu

from .. import __version__
from .._data_files import data_folder
from ..errors import FmuError
from ..machine import DEFAULT_MACHINE, FeedDriveSection, Machine
from .model_description import FmuInfo, model_description
from .tables import interface_table
from .variables import variables_of

__all__ = ["BACKENDS", "build_fmu", "fmu_names"]

BACKENDS = ("python",)

_PACKAGE = Path(__file__).resolve().parent.parent
_TRAVELS = (
    "errors.py",
    "parameters.py",
    "signals.py",
    "state.py",
    "physics.py",
    "regression.py",
    "predictor.py",
    "lookahead.py",
    "plant.py",
    "fmi/variables.py",
    "fmi/clock.py",
    "fmi/slave.py",
)
"""The modules an FMU needs; with NumPy and SciPy they need nothing else."""

_MODELS = {
    "HybridPredictor": (
        "hybrid_predictor.py",
        "linear hybrid model: predicts the drive's position one look-ahead window early",
    ),
    "FeedDrive": ("feed_drive.py", "nonlinear feed drive with encoder noise"),
}
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)


def fmu_names(machine: Machine, backend: str = "python") -> dict[str, str]:
    """Return the FMUs a machine has: archive stem → model (``HybridPredictor``, ``FeedDrive``).

    Raises
    ------
    FmuError
        If the backend is unknown.
    """
    if backend not in BACKENDS:
        raise FmuError(f"backend must be one of {', '.join(BACKENDS)}, got {backend!r}")
    suffix = "" if machine.name == DEFAULT_MACHINE else f"_{machine.name}"
    models = ["HybridPredictor"] + (["FeedDrive"] if machine.plant is not None else [])
    return {f"{model}Py{suffix}": model for model in models}


def build_fmu(machine: Machine, name: str, out: str | Path, backend: str = "python") -> Path:
    """Build one FMU.

    Parameters
    ----------
    machine : Machine
        The axis; its values become the parameters' start values.
    name : str
        One of :func:`fmu_names`.
    out : str or Path
        Folder for the archive; made if needed.
    backend : {"python"}
        Flavour.

    Returns
    -------
    Path
        ``out/name.fmu``.

    Raises
    ------
    FmuError
        If the machine has no such FMU.
    """
    names = fmu_names(machine, backend)
    if name not in names:
        raise FmuError(f"machine {machine.name} has no FMU {name!r}; it has {', '.join(names)}")
    model = names[name]
    files = _resources(model)
    description = _description(machine, model, name)
    table = variables_of(description)
    files["documentation/index.html"] = _documentation(machine, name, model, description)
    for source in ("linux64/libpythonfmu-export.so", "win64/pythonfmu-export.dll"):
        binary = Path(pythonfmu.__file__).parent / "resources" / "binaries" / source
        files[f"binaries/{Path(source).parent}/{name}{binary.suffix}"] = binary.read_bytes()
    guid = _guid(files, description)
    description["content"] = guid
    files["resources/machine.json"] = json.dumps(description, indent=1, sort_keys=True).encode()
    info = FmuInfo(
        name=name,
        description=f"{machine.title}: {_MODELS[model][1]}",
        guid=guid,
        step_size=machine.T_s,
        stop_time=6.0,
        variable_step=model == "FeedDrive",
        needs_execution_tool=True,
        generation_tool=f"hybridsep {__version__} with pythonfmu {metadata.version('pythonfmu')}",
        version=__version__,
    )
    files["modelDescription.xml"] = model_description(info, table)
    path = Path(out) / f"{name}.fmu"
    path.parent.mkdir(parents=True, exist_ok=True)
    _write_archive(path, files)
    return path


def _description(machine: Machine, model: str, name: str) -> dict[str, object]:
    """Return what the slave reads of its machine: model, name, start values and modes."""
    modes = [mode.model_dump() for mode in machine.physics.mode]
    if model == "HybridPredictor":
        smd = [{"f_n": m.f_n, "zeta": m.zeta, "alpha": m.alpha, "beta": m.beta} for m in machine.model.modes]
        return {"model": model, "name": name, "parameters": machine.fmi_parameters(), "modes": smd}
    assert machine.plant is not None  # by fmu_names
    parameters: dict[str, object] = machine.plant.model_dump(exclude={"kind"})
    if isinstance(machine.plant, FeedDriveSection):
        assert machine.physics.spring_mass_damper is not None  # by Machine
        parameters |= machine.physics.spring_mass_damper.model_dump()
    else:
        parameters["T_s"] = machine.T_s
    return {"model": model, "name": name, "parameters": parameters, "modes": modes}


def _resources(model: str) -> dict[str, bytes]:
    """Return the Python side of an FMU: slave, library and pythonfmu, under names of their content."""
    slave = data_folder("fmu_src") / "python" / _MODELS[model][0]
    library = {module: (_PACKAGE / module).read_bytes() for module in _TRAVELS}
    digest = hashlib.sha256(slave.read_bytes())
    for module, text in library.items():
        digest.update(module.encode() + text)
    number = digest.hexdigest()[:12]
    package, module_name = f"hybridsep_{number}", f"{slave.stem}_{number}"
    renamed = re.sub(r"^from hybridsep\b", f"from {package}", slave.read_text(encoding="utf-8"), flags=re.MULTILINE)
    files = {
        "resources/slavemodule.txt": module_name.encode(),
        f"resources/{module_name}.py": renamed.encode(),
        f"resources/{package}/__init__.py": b"",
        f"resources/{package}/fmi/__init__.py": b"",
    }
    files |= {f"resources/{package}/{module}": text for module, text in library.items()}
    for path in sorted(Path(pythonfmu.__file__).parent.glob("*.py")):
        files[f"resources/pythonfmu/{path.name}"] = path.read_bytes()
    return files


def _documentation(machine: Machine, name: str, model: str, description: Mapping[str, object]) -> bytes:
    """Return the page a tool shows for the FMU: what it is, where its numbers come from, its interface."""
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in interface_table(variables_of(description))
    )
    sources = "\n".join(f"<li>{html.escape(source)}</li>" for source in machine.sources)
    page = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title>
<style>body{{font-family:sans-serif;max-width:60em;margin:2em auto}}td,th{{padding:.2em .6em;text-align:left;
border-bottom:1px solid #ddd}}</style></head><body>
<h1>{name}</h1>
<p>{html.escape(machine.title)}: {_MODELS[model][1]}.</p>
<p>The FMU needs a Python 3 with NumPy and SciPy in the importing tool's process.</p>
<table><tr><th>name</th><th>causality</th><th>type, unit</th><th>start</th><th>meaning</th></tr>
{rows}
</table>
<h2>Sources</h2>
<ul>
{sources}
</ul>
</body></html>
"""
    return page.encode()


def _guid(files: Mapping[str, bytes], description: Mapping[str, object]) -> str:
    """Return a GUID that follows from the content."""
    digest = hashlib.sha256(json.dumps(description, sort_keys=True).encode())
    for arcname in sorted(files):
        digest.update(arcname.encode() + hashlib.sha256(files[arcname]).digest())
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def _write_archive(path: Path, files: Mapping[str, bytes]) -> None:
    """Write a zip whose bytes depend on nothing but its content."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        # modelDescription.xml first, as readers that stream expect
        for arcname in sorted(files, key=lambda key: (key != "modelDescription.xml", key)):
            entry = zipfile.ZipInfo(arcname, _ZIP_TIME)
            entry.compress_type, entry.external_attr, entry.create_system = zipfile.ZIP_DEFLATED, 0o644 << 16, 3
            archive.writestr(entry, files[arcname])
