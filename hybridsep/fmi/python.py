"""Python flavour of the FMUs: a pythonfmu slave over this library, to read and edit.

Such an FMU carries the slave, the part of this library that it needs, pythonfmu itself and pythonfmu's binaries.
The library is packed under a name with a hash of its content (``hybridsep_1a2b…``), because two FMUs in one process
share every module of the same name, and the one loaded first would silently serve both.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
from functools import cache
from importlib import metadata
from pathlib import Path

import pythonfmu

from ..base.errors import FmuError
from ..base.files import data_folder
from ..base.version import __version__
from .description import model_description
from .pages import documentation, filled, icon
from .reference import reference_run
from .spec import FmuSpec, content_guid

_SERIES = "0.7."
"""Series of pythonfmu whose reference counting ``slave.py`` balances and whose limits are listed in ``templates``."""

_SLAVES = {
    "HybridPredictor": "hybrid_predictor.py",
    "SepCompensator": "sep_compensator.py",
    "FeedDrive": "feed_drive.py",
}


def files(spec: FmuSpec) -> dict[str, bytes]:
    """Return all files of one FMU of FMI 2.0: archive name → content.

    Raises
    ------
    FmuError
        If the pythonfmu that is installed is of another series than 0.7.
    """
    model, name = spec.table.model, spec.table.name
    version = checked_version()
    content = _resources(model)
    if spec.trained is not None:
        from .weights import WEIGHTS_FILE, weights_file

        content[f"resources/{WEIGHTS_FILE}"] = weights_file(spec.trained)
    needs = "The FMU needs a Python 3 with NumPy and SciPy in the importing tool's process."
    limits = filled("pythonfmu_limits.html", version=version).rstrip("\n")
    content["model.png"] = icon(model)
    reference = reference_run(spec, content)
    content |= documentation(spec, needs, filled("python_dependencies.txt", version=version), reference, limits=limits)
    for source in ("linux64/libpythonfmu-export.so", "win64/pythonfmu-export.dll"):
        binary = Path(pythonfmu.__file__).parent / "resources" / "binaries" / source
        content[f"binaries/{Path(source).parent}/{name}{binary.suffix}"] = binary.read_bytes()
    content["documentation/licenses/license.txt"] = (data_folder("fmu_src").parent / "LICENSE").read_bytes()
    content["documentation/licenses/pythonfmu.txt"] = _license()
    guid = content_guid(content, spec.table)
    content["resources/machine.json"] = json.dumps(
        {**spec.table.as_json(), "content": guid}, indent=1, sort_keys=True
    ).encode()
    tool = f"hybridsep {__version__} with pythonfmu {version}"
    content["modelDescription.xml"] = model_description(spec, guid, tool)
    return content | reference


def _resources(model: str) -> dict[str, bytes]:
    """Return the Python side of an FMU: slave, library and pythonfmu, under names with a hash of their content."""
    slave = data_folder("fmu_src") / "python" / _SLAVES[model]
    library = _imported_modules(slave)
    launcher = slave.with_name("launcher.py").read_text(encoding="utf-8")  # which pythonfmu loads first
    digest = hashlib.sha256(slave.read_bytes() + launcher.encode())
    for module, text in library.items():
        digest.update(module.encode() + text)
    number = digest.hexdigest()[:12]
    package, module_name = f"hybridsep_{number}", f"{slave.stem}_{number}"
    source = re.sub(r"^from hybridsep\b", f"from {package}", slave.read_text(encoding="utf-8"), flags=re.MULTILINE)
    content = {
        "resources/slavemodule.txt": f"launch_{module_name}".encode(),
        f"resources/launch_{module_name}.py": launcher.replace("slave_module", module_name).encode(),
        f"resources/{module_name}.py": source.encode(),
    }
    content |= {f"resources/{package}/{module}": text for module, text in library.items()}
    for path in sorted(Path(pythonfmu.__file__).parent.glob("*.py")):
        content[f"resources/pythonfmu/{path.name}"] = path.read_bytes()
    return content


def checked_version() -> str:
    """Return the version of the pythonfmu that is installed.

    Raises
    ------
    FmuError
        If ``slave.py`` was not made for it.
    """
    version = metadata.version("pythonfmu")
    if not version.startswith(_SERIES):
        raise FmuError(
            f"pythonfmu must be {_SERIES}x, whose reference counting hybridsep/fmi/slave.py balances, got {version}; "
            f"pip install 'pythonfmu~={_SERIES}0'"
        )
    return version


def _license() -> bytes:
    """Return the licence of the pythonfmu that is installed, which goes with copies of it; FmuError if it has none."""
    found = [file for file in metadata.files("pythonfmu") or () if file.name == "LICENSE"]
    if not found:
        raise FmuError("pythonfmu's LICENSE, which an FMU with a copy of it must carry, is not installed: reinstall it")
    return found[0].read_binary()


_PACKAGE = Path(__file__).resolve().parents[1]


def _imported_modules(script: Path) -> dict[str, bytes]:
    """Return the modules that a script needs when it is loaded: path within the package → source.

    Followed are the imports at the top level of a module; one inside a function is not needed to load it. The
    ``__init__.py`` of the folders are among them, empty: the top level's public names would import the whole library.
    """
    found: dict[str, bytes] = {}
    waiting = list(_imports(script.read_bytes(), ()))
    while waiting:
        module = waiting.pop()
        if module.as_posix() in found:
            continue
        source = (_PACKAGE / module).read_bytes()
        found[module.as_posix()] = source
        waiting += _imports(source, module.parent.parts)
    folders = {parent / "__init__.py" for module in found for parent in Path(module).parents}
    return dict(sorted({**found, **{folder.as_posix(): b"" for folder in folders}}.items()))


@cache
def _imports(source: bytes, place: tuple[str, ...]) -> tuple[Path, ...]:
    """Return the modules of this package that a module in the folder ``place`` names at its top level."""
    found: list[Path] = []
    for statement in ast.parse(source).body:
        if not isinstance(statement, ast.ImportFrom):
            continue
        parts = tuple(statement.module.split(".")) if statement.module else ()
        if statement.level:
            parts = (*place[: len(place) + 1 - statement.level], *parts)
        elif parts[:1] == ("hybridsep",):
            parts = parts[1:]
        else:
            continue
        if (_PACKAGE / Path(*parts)).with_suffix(".py").is_file():
            found.append(Path(*parts).with_suffix(".py"))
        else:
            found += [Path(*parts, alias.name).with_suffix(".py") for alias in statement.names]
    return tuple(found)
