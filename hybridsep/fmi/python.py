"""Python flavour of the FMUs: a pythonfmu slave over this library, to read and edit.

Such an FMU carries the slave, the packages of this library that compute, pythonfmu itself and pythonfmu's binaries.
The library is packed under a name with a hash of its content (``hybridsep_1a2b…``), because two FMUs in one process
share every module of the same name, and the one loaded first would silently serve both.
"""

import hashlib
import json
import re
from importlib import metadata
from pathlib import Path

import pythonfmu

from ..base.files import data_folder
from ..base.version import __version__
from .description import documentation, icon, model_description
from .flavours import filled
from .reference import reference_run
from .spec import FmuSpec, content_guid
from .weights import WEIGHTS_FILE

_SLAVES = {"HybridPredictor": "hybrid_predictor", "FeedDrive": "feed_drive"}

_PACKED = ("base/*", "model/*", "predict/**/*", "online/*", "plants/*", "fmi/variables", "fmi/weights")
_LIBRARY = Path(__file__).resolve().parents[1]


def files(spec: FmuSpec) -> dict[str, bytes]:
    """Return all files of one FMU of FMI 2.0: archive name → content."""
    model, name = spec.table.model, spec.table.name
    version = metadata.version("pythonfmu")  # 0.7, whose reference counting the slave balances
    content = _resources(model)
    if spec.weights is not None:
        content[f"resources/{WEIGHTS_FILE}"] = spec.weights
    needs = "The FMU needs a Python 3 with NumPy and SciPy in the importing tool's process."
    limits = filled("pythonfmu_limits.html", version=version).rstrip("\n")
    content["model.png"] = icon(model)
    reference = reference_run(spec)
    content |= documentation(spec, needs, filled("python_dependencies.txt", version=version), reference, limits=limits)
    for source in ("linux64/libpythonfmu-export.so", "win64/pythonfmu-export.dll"):
        binary = Path(pythonfmu.__file__).parent / "resources" / "binaries" / source
        content[f"binaries/{Path(source).parent}/{name}{binary.suffix}"] = binary.read_bytes()
    content["documentation/licenses/license.txt"] = (data_folder("fmu_src").parent / "LICENSE").read_bytes()
    (licence,) = (file for file in metadata.files("pythonfmu") or () if file.name == "LICENSE")
    content["documentation/licenses/pythonfmu.txt"] = licence.read_binary()
    guid = content_guid(content, spec.table)
    keys = ("name", "kind", "causality", "variability", "start")
    variables = [{key: getattr(one, key) for key in keys} for one in spec.table.variables]
    described = {"name": name, "unit": spec.table.unit, "content": guid, "variables": variables}
    content["resources/machine.json"] = json.dumps(described, indent=1).encode()
    content["modelDescription.xml"] = model_description(spec, guid, f"hybridsep {__version__} with pythonfmu {version}")
    return content | reference


def _resources(model: str) -> dict[str, bytes]:
    """Return the Python side of an FMU: launcher, pythonfmu, and slave and library as a package of their own name."""
    folder, slave = data_folder("fmu_src") / "python", _SLAVES[model]
    paths = [path for one in _PACKED for path in sorted(_LIBRARY.glob(f"{one}.py"))]
    texts = {path.relative_to(_LIBRARY).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    texts |= {f"{one}.py": (folder / f"{one}.py").read_text(encoding="utf-8") for one in ("slave", slave)}
    texts |= {"__init__.py": "", "fmi/__init__.py": ""}  # the library's would load all of it
    launcher = (folder / "launcher.py").read_text(encoding="utf-8")
    number = hashlib.sha256("\0".join((launcher, *texts, *texts.values())).encode()).hexdigest()[:12]
    package, launch = f"hybridsep_{number}", f"launch_{slave}_{number}"
    content = {
        "resources/slavemodule.txt": launch.encode(),
        f"resources/{launch}.py": launcher.replace("slave_module", f"{package}.{slave}").encode(),
    }
    for place, text in texts.items():
        own = re.sub(r"^from (hybridsep|fmu_src\.python)\b", f"from {package}", text, flags=re.MULTILINE)
        content[f"resources/{package}/{place}"] = own.encode()
    for path in sorted(Path(pythonfmu.__file__).parent.glob("*.py")):
        content[f"resources/pythonfmu/{path.name}"] = path.read_bytes()
    return content
