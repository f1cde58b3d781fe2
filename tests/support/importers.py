"""A closed system as a file, ReferenceTrajectory → a look-ahead FMU → FeedDrive, in other projects' importers.

A process of its own, ``python tests/support/importers.py IMPORTER SYSTEM ARCHIVE N OUT``, runs the archive for N steps,
and writes what is observed after each, ``(N, n_observed)``, to OUT.
"""

import ctypes
import json
import os
import platform
import sys
import zipfile
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import fmpy
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP = 1e-3  # s

OWN = {
    "predictor": ("HybridPredictor", "x_d", ("x_pb", "x_h", "rms_pb", "rms_h")),
    "compensator": ("SepCompensator", "x_dm", ("x_d", "x_pb", "x_h", "rms_e", "rms_h")),
}
"""Look-ahead of a system, by its name: FMU, output that goes to the drive, others that are observed."""


def observed(system: str) -> list[tuple[str, str]]:
    """Return component and output of each column."""
    _, command, others = OWN[system]
    return [("drive", "x"), ("drive", "x_meas"), *((system, name) for name in (command, *others))]


def with_fmpy(system: str, archive: Path, n: int) -> Array:
    """Run fmpy's own SSP loop: Jacobi, but what is wired starts at 0 and is carried after a step only."""
    simulate_ssp = import_module("fmpy.ssp.simulation").simulate_ssp
    result = simulate_ssp(str(archive), stop_time=(n - 0.5) * STEP, step_size=STEP)
    return np.column_stack([result[f"{component}.{name}"] for component, name in observed(system)])


def with_libcosim(system: str, archive: Path, n: int) -> Array:
    """Run libcosim's fixed-step algorithm."""
    real = import_module("libcosimpy.CosimEnums").CosimVariableType.REAL
    logging = import_module("libcosimpy.CosimLogging")
    logging.log_output_level(logging.CosimLogLevel.WARNING)
    execution = import_module("libcosimpy.CosimExecution").CosimExecution.from_ssp_file(str(archive), round(STEP * 1e9))
    observer = import_module("libcosimpy.CosimObserver").CosimObserver.create_time_series(n + 1)
    execution.add_observer(observer)
    places = []
    for component, name in observed(system):
        slave = execution.slave_index_from_instance_name(component)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(slave)}
        places.append((slave, references[name]))
        observer.start_time_series(slave, references[name], real)
    execution.step(n)  # the last version for Python 3.10 returns False whatever happens; the rows tell
    return np.column_stack([observer.time_series_real_samples(*place, 1, n)[2] for place in places])


def with_ecos(system: str, archive: Path, n: int) -> Array:
    """Run ecos's fixed-step algorithm."""
    load_tbb()
    simulation = import_module("ecospy").EcosSimulation(ssp_path=str(archive), step_size=STEP)
    rows = []
    assert simulation.init()
    for _ in range(n):
        simulation.step()
        rows.append([simulation.get_real(f"{component}::{name}") for component, name in observed(system)])
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


def with_fmucontainer(system: str, archive: Path, n: int, *, sequential: bool = False) -> Array:
    """Run the fmu-manipulation-toolbox's container, an importer in C that is an FMU itself.

    ``sequential``: Gauss-Seidel, the drive first, so that its measurement reaches the look-ahead a sample early.
    """
    folder, (model, command, _) = archive.parent / "resources", OWN[system]
    with zipfile.ZipFile(archive) as content:
        content.extractall(archive.parent)
    wires = [
        *(("ReferenceTrajectory", "r", model, "x_d_ahead"), (model, command, "FeedDrive", "x_d")),
        ("FeedDrive", "x_meas", model, "x_meas"),
    ]
    models, names = {"drive": "FeedDrive", system: model}, [name for _, name in observed(system)]
    description = {
        "name": "container.fmu",
        "fmu": [f"{one}.fmu" for one in ("ReferenceTrajectory", model, "FeedDrive")][:: -1 if sequential else 1],
        "sequential": sequential,
        "start": [[f"{model}.fmu", "measurement_delay", -1]] if sequential else [],
        "link": [[f"{a}.fmu", output, f"{b}.fmu", name] for a, output, b, name in wires],
        "output": [[f"{models[component]}.fmu", name, name] for component, name in observed(system)],
        "step_size": STEP,
    }
    (folder / "container.json").write_text(json.dumps(description))
    assembly = import_module("fmu_manipulation_toolbox.assembly").Assembly
    assembly("container.json", fmu_directory=folder).make_fmu(fmi_version=2)
    how = {"stop_time": n * STEP, "step_size": STEP, "output_interval": STEP, "output": names}
    result = fmpy.simulate_fmu(str(folder / "container.fmu"), **how)
    return np.column_stack([result[name][1:] for name in names])


_DESKTOP = {("Linux", "x86_64"), ("Windows", "AMD64")}

IMPORTERS: dict[str, tuple[Callable[[str, Path, int], Array], set[tuple[str, str]] | None]] = {
    "fmpy SSP": (with_fmpy, None),
    "libcosim": (with_libcosim, _DESKTOP),  # libcosimpy 0.0.6 has wheels for these
    "ecos": (with_ecos, _DESKTOP),  # ecospy 0.7.2's wheel is for any platform, its libraries are for these
    "fmucontainer -sequential": (partial(with_fmucontainer, sequential=True), _DESKTOP | {("Darwin", "arm64")}),
    "fmucontainer": (with_fmucontainer, _DESKTOP | {("Darwin", "arm64")}),  # likewise fmu-manipulation-toolbox 2.0's
}
"""Importers: function that runs a system, and platforms with a library; None for all."""


def exists_here(importer: str) -> bool:
    """Whether the importer's package has a library for this platform; it must then be installed."""
    platforms = IMPORTERS[importer][1]
    return platforms is None or (platform.system(), platform.machine()) in platforms


if __name__ == "__main__":
    given = Path(sys.argv[3])
    os.chdir(given.parent)
    np.save(sys.argv[5], IMPORTERS[sys.argv[1]][0](sys.argv[2], given, int(sys.argv[4])))
