"""ReferenceTrajectory → HybridPredictor → FeedDrive over the staircase, in one importer after the other.

Run as a program, so that an importer's threads and libraries live in a process of their own:
``python tests/importers_closed_system.py IMPORTER FOLDER OUT.npy``. FOLDER holds the three FMUs; OUT.npy gets what
:func:`run` returns.
"""

from __future__ import annotations

import ctypes
import json
import platform
import re
import sys
import zipfile
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

from hybridsep import FmuInstance

Array = NDArray[np.float64]

COMPONENTS = {"reference": "ReferenceTrajectory", "predictor": "HybridPredictor", "drive": "FeedDrive"}
CONNECTIONS = (
    ("reference", "r", "predictor", "x_d_ahead"),
    ("predictor", "x_d", "drive", "x_d"),
    ("drive", "x_meas", "predictor", "x_meas"),
)
OBSERVED = (
    ("predictor", "x_pb"),
    ("predictor", "x_h"),
    ("drive", "x_meas"),
    ("predictor", "rms_pb"),
    ("predictor", "rms_h"),
)
"""The columns of what the runs return."""

N_STEPS = 6100  # the staircase, 6001 samples, Np samples later
STEP = 1e-3  # s
GUIDE = Path(__file__).parents[1] / "docs" / "importers.md"


def system_structure(folder: Path) -> Path:
    """Write the SSP that the guide describes, with the FMUs of the folder, and return its path."""
    (description,) = re.findall(r"^```xml\n(.*?)^```$", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    path = folder / "staircase.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", description)
        for model in COMPONENTS.values():
            archive.write(folder / f"{model}.fmu", f"resources/{model}.fmu")
    return path


def with_fmpy(folder: Path) -> Array:
    """Jacobi: all outputs are read, all inputs set, all FMUs stepped; initialized in the order of the signals."""
    fmus = {name: FmuInstance(folder / f"{model}.fmu") for name, model in COMPONENTS.items()}
    rows = []
    fmus["reference"].initialise()
    fmus["predictor"].initialise({"x_d_ahead": fmus["reference"].get("r")})
    fmus["drive"].initialise({"x_d": fmus["predictor"].get("x_d")})
    for k in range(N_STEPS):
        carried = [fmus[source].get(output) for source, output, _, _ in CONNECTIONS]
        for (_, _, sink, name), position in zip(CONNECTIONS, carried, strict=True):
            fmus[sink].set(name, position)
        for fmu in fmus.values():
            fmu.step(k * STEP, STEP)
        rows.append([fmus[component].get(name) for component, name in OBSERVED])
    for fmu in fmus.values():
        fmu.close()
    return np.array(rows)


def with_fmpy_ssp(folder: Path) -> Array:
    """fmpy's own SSP loop: Jacobi as well, but what is wired starts at 0 and is carried after a step only."""
    simulate_ssp = import_module("fmpy.ssp.simulation").simulate_ssp
    result = simulate_ssp(str(system_structure(folder)), stop_time=(N_STEPS - 0.5) * STEP, step_size=STEP)
    return np.column_stack([result[f"{component}.{name}"] for component, name in OBSERVED])


def with_libcosim(folder: Path) -> Array:
    """libcosim's fixed-step algorithm."""
    execution_of = import_module("libcosimpy.CosimExecution").CosimExecution
    observer_of = import_module("libcosimpy.CosimObserver").CosimObserver
    real = import_module("libcosimpy.CosimEnums").CosimVariableType.REAL
    logging = import_module("libcosimpy.CosimLogging")
    logging.log_output_level(logging.CosimLogLevel.WARNING)
    execution = execution_of.from_ssp_file(str(system_structure(folder)), round(STEP * 1e9))
    observer = observer_of.create_time_series(N_STEPS + 1)
    execution.add_observer(observer)
    places = []
    for component, name in OBSERVED:
        slave = execution.slave_index_from_instance_name(component)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(slave)}
        places.append((slave, references[name]))
        observer.start_time_series(slave, references[name], real)
    execution.step(N_STEPS)  # the last version for Python 3.10 returns False whatever happens; the rows tell
    return np.column_stack([observer.time_series_real_samples(*place, 1, N_STEPS)[2] for place in places])


def with_ecos(folder: Path) -> Array:
    """ecos's fixed-step algorithm."""
    load_tbb()
    simulation = import_module("ecospy").EcosSimulation(ssp_path=str(system_structure(folder)), step_size=STEP)
    rows = []
    assert simulation.init()
    for _ in range(N_STEPS):
        simulation.step()
        rows.append([simulation.get_real(f"{component}::{name}") for component, name in OBSERVED])
    simulation.terminate()
    simulation.free()
    return np.array(rows)


def load_tbb() -> None:
    """Load the wheel's libtbb, which ecos links to and which is beside no library search path."""
    try:
        libraries = files("tbb") or []
    except PackageNotFoundError:  # the system may have it
        return
    for library in libraries:
        if library.name == "libtbb.so.12":
            ctypes.CDLL(str(library.locate()))


def with_fmucontainer(folder: Path) -> Array:
    """The fmu-manipulation-toolbox's container, an importer in C that is an FMU itself."""
    description = {
        "name": "container.fmu",
        "fmu": [f"{model}.fmu" for model in COMPONENTS.values()],
        "link": [[f"{COMPONENTS[a]}.fmu", x, f"{COMPONENTS[b]}.fmu", y] for a, x, b, y in CONNECTIONS],
        "output": [[f"{COMPONENTS[component]}.fmu", name, name] for component, name in OBSERVED],
        "step_size": STEP,
    }
    (folder / "container.json").write_text(json.dumps(description))
    assembly = import_module("fmu_manipulation_toolbox.assembly").Assembly
    assembly("container.json", fmu_directory=folder).make_fmu(fmi_version=2)
    names = [name for _, name in OBSERVED]
    container, stop_time = str(folder / "container.fmu"), N_STEPS * STEP
    result = fmpy.simulate_fmu(container, stop_time=stop_time, step_size=STEP, output_interval=STEP, output=names)
    return np.column_stack([result[name][1:] for name in names])


_DESKTOP = {("Linux", "x86_64"), ("Windows", "AMD64")}

IMPORTERS: dict[str, tuple[Callable[[Path], Array], set[tuple[str, str]] | None]] = {
    "fmpy": (with_fmpy, None),
    "fmpy SSP": (with_fmpy_ssp, None),
    "libcosim": (with_libcosim, _DESKTOP),  # libcosimpy 0.0.6 has wheels for these
    "ecos": (with_ecos, _DESKTOP),  # ecospy 0.7.2's wheel is for any platform, its libraries are for these
    "fmucontainer": (with_fmucontainer, _DESKTOP | {("Darwin", "arm64")}),  # likewise fmu-manipulation-toolbox 2.0's
}
"""How each importer runs the system, and the platforms it has a library for; None for all."""


def exists_here(importer: str) -> bool:
    """Whether the importer's package has a library for this platform; it must then be installed."""
    platforms = IMPORTERS[importer][1]
    return platforms is None or (platform.system(), platform.machine()) in platforms


def run(importer: str, folder: Path) -> Array:
    """Return :data:`OBSERVED` at ``t_1 … t_6100``, ``(6100, 5)``, m."""
    rows: Any = IMPORTERS[importer][0](folder)
    assert rows.shape == (N_STEPS, len(OBSERVED))
    return np.asarray(rows, dtype=np.float64)


if __name__ == "__main__":
    np.save(sys.argv[3], run(sys.argv[1], Path(sys.argv[2])))
