"""ReferenceTrajectory → a look-ahead FMU → FeedDrive over the staircase, in one importer after the other.

Run as a program, so that an importer's threads and libraries live in a process of their own:
``python tests/support/importers_closed_system.py IMPORTER FOLDER MOVED OUT`` runs all systems that the importer can,
with the FMUs of a folder, and of another one whose trajectory, command.npy, starts elsewhere; what :func:`run` returns
goes to OUT.
"""

import ctypes
import json
import os
import platform
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray
from places import ROOT

from hybridsep import FmuInstance, load_machine, staircase
from hybridsep.fmi.ssp import build_system

Array = NDArray[np.float64]

N_SAMPLES = 6001  # of the staircase
STEP = 1e-3  # s
GUIDE = ROOT / "docs" / "evidence" / "importers.md"


UNCARRIED = ("fmpy SSP", "fmucontainer -sequential")
"""Importers that carry nothing to the drive before the first step, and change the first measurement."""

READ_FMI3 = ("ecos", "fmucontainer")
MOVED = " moved"


@dataclass(frozen=True)
class ClosedSystem:
    """A closed system of three FMUs: ``reference``, the look-ahead and ``drive``."""

    # the look-ahead's name in the system, and its FMU
    look_ahead: str
    model: str
    command: str  # its output that goes to the drive
    delay: int  # by how many samples it delays the trajectory; the trajectory is held at its end for as many more
    # its outputs that move with the trajectory, and its own figures, errors since ``t_init``
    positions: tuple[str, ...]
    reported: tuple[str, ...]
    figures: tuple[str, ...]  # figures of ``reported`` that the guide states
    # each (str, str): minuend and subtrahend of the errors whose RMS values over the whole trajectory the guide states
    errors: tuple[tuple[str, str], ...]
    suffix: str = ""  # ending of the FMUs' names: Fmi3 for FMI 3.0
    n_samples: int = N_SAMPLES  # of the trajectory, as far as it is played

    @property
    def components(self) -> dict[str, str]:
        """Name → FMU, in the order of the signals."""
        models = {"reference": "ReferenceTrajectory", self.look_ahead: self.model, "drive": "FeedDrive"}
        return {name: f"{model}{self.suffix}" for name, model in models.items()}

    @property
    def connections(self) -> tuple[tuple[str, str, str, str], ...]:
        """Component and output, component and input."""
        return (
            ("reference", "r", self.look_ahead, "x_d_ahead"),
            (self.look_ahead, self.command, "drive", "x_d"),
            ("drive", "x_meas", self.look_ahead, "x_meas"),
        )

    @property
    def observed(self) -> tuple[tuple[str, str], ...]:
        """Component and output of each column of what the runs return; the positions first."""
        own, drive = self.look_ahead, (("drive", "x"), ("drive", "x_meas"))
        return (*((own, name) for name in self.positions), *drive, *((own, name) for name in self.reported))

    @property
    def n_positions(self) -> int:
        """Number of columns that move with the trajectory."""
        return len(self.observed) - len(self.reported)

    @property
    def n_steps(self) -> int:
        """Steps to the trajectory's last sample."""
        return self.n_samples - 1 + self.delay

    def columns(self, rows: Array) -> dict[str, Array]:
        """Return the columns by the outputs' names, from the end of the first fill on, m."""
        return dict(zip((name for _, name in self.observed), rows[self.delay - 1 :].T, strict=True))


SYSTEMS = {
    system.look_ahead: system
    for system in (
        ClosedSystem(
            look_ahead="predictor",
            model="HybridPredictor",
            command="x_d",
            delay=100,
            positions=("x_d", "x_pb", "x_h"),
            reported=("rms_pb", "rms_h"),
            figures=("rms_pb", "rms_h"),
            errors=(("x_meas", "x_pb"), ("x_meas", "x_h")),
        ),
        ClosedSystem(
            look_ahead="compensator",
            model="SepCompensator",
            command="x_dm",
            delay=200,
            positions=("x_dm", "x_d", "x_pb", "x_h"),
            reported=("rms_e", "rms_pb", "rms_h"),
            figures=("rms_e", "rms_h"),
            errors=(("x_d", "x"),),
        ),
    )
}


def blocks(language: str) -> list[str]:
    """Return the guide's code blocks in a language."""
    text = GUIDE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def system_structure(system: ClosedSystem, folder: Path) -> Path:
    """Write the system as one file and return its path; ``command.npy`` of the folder is played, or the staircase."""
    given = folder / "command.npy"
    command = np.load(given) if given.exists() else staircase()
    machine = load_machine("spring_mass_damper")
    compensate = "hybrid" if system.look_ahead == "compensator" else None
    return build_system(machine, folder / "staircase.ssp", command, compensate=compensate, targets=("host",))


def with_fmpy(system: ClosedSystem, folder: Path) -> Array:
    """Jacobi: all outputs are read, all inputs set, all FMUs stepped; initialized in the order of the signals."""
    fmus = {name: FmuInstance(folder / f"{model}.fmu") for name, model in system.components.items()}
    rows = []
    fmus["reference"].initialise()
    fmus[system.look_ahead].initialise({"x_d_ahead": fmus["reference"].get("r")})
    fmus["drive"].initialise({"x_d": fmus[system.look_ahead].get(system.command)})
    for k in range(system.n_steps):
        carried = [fmus[source].get(output) for source, output, _, _ in system.connections]
        for (_, _, sink, name), position in zip(system.connections, carried, strict=True):
            fmus[sink].set(name, position)
        for fmu in fmus.values():
            fmu.step(k * STEP, STEP)
        rows.append([fmus[component].get(name) for component, name in system.observed])
    for fmu in fmus.values():
        fmu.close()
    return np.array(rows)


def with_fmpy_ssp(system: ClosedSystem, folder: Path) -> Array:
    """fmpy's own SSP loop: Jacobi as well, but what is wired starts at 0 and is carried after a step only."""
    simulate_ssp = import_module("fmpy.ssp.simulation").simulate_ssp
    result = simulate_ssp(
        str(system_structure(system, folder)), stop_time=(system.n_steps - 0.5) * STEP, step_size=STEP
    )
    return np.column_stack([result[f"{component}.{name}"] for component, name in system.observed])


def with_libcosim(system: ClosedSystem, folder: Path) -> Array:
    """libcosim's fixed-step algorithm."""
    execution_of = import_module("libcosimpy.CosimExecution").CosimExecution
    observer_of = import_module("libcosimpy.CosimObserver").CosimObserver
    real = import_module("libcosimpy.CosimEnums").CosimVariableType.REAL
    logging = import_module("libcosimpy.CosimLogging")
    logging.log_output_level(logging.CosimLogLevel.WARNING)
    execution = execution_of.from_ssp_file(str(system_structure(system, folder)), round(STEP * 1e9))
    observer = observer_of.create_time_series(system.n_steps + 1)
    execution.add_observer(observer)
    places = []
    for component, name in system.observed:
        slave = execution.slave_index_from_instance_name(component)
        references = {v.name.decode(): v.reference for v in execution.slave_variables(slave)}
        places.append((slave, references[name]))
        observer.start_time_series(slave, references[name], real)
    execution.step(system.n_steps)  # the last version for Python 3.10 returns False whatever happens; the rows tell
    return np.column_stack([observer.time_series_real_samples(*place, 1, system.n_steps)[2] for place in places])


def with_ecos(system: ClosedSystem, folder: Path) -> Array:
    """ecos's fixed-step algorithm."""
    load_tbb()
    ecospy, how = import_module("ecospy"), dict[str, Any]()
    if system.suffix:  # it reads SSP 1.0 alone
        how["structure"] = ecospy.EcosSimulationStructure()
        for name, model in system.components.items():
            how["structure"].add_model(name, str(folder / f"{model}.fmu"))
        for source, output, sink, name in system.connections:
            how["structure"].make_real_connection(f"{source}::{output}", f"{sink}::{name}")
    else:
        how["ssp_path"] = str(system_structure(system, folder))
    simulation = ecospy.EcosSimulation(**how, step_size=STEP)
    rows = []
    assert simulation.init()
    for _ in range(system.n_steps):
        simulation.step()
        rows.append([simulation.get_real(f"{component}::{name}") for component, name in system.observed])
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


def with_fmucontainer(system: ClosedSystem, folder: Path, *, sequential: bool = False) -> Array:
    """The fmu-manipulation-toolbox's container, an importer in C that is an FMU itself.

    ``sequential``: Gauss-Seidel, the drive first, so that its measurement reaches the look-ahead a sample early.
    """
    fmu_of = {name: f"{model}.fmu" for name, model in system.components.items()}
    description = {
        "name": "container.fmu",
        "fmu": list(fmu_of.values())[:: -1 if sequential else 1],
        "sequential": sequential,
        "start": [[fmu_of[system.look_ahead], "measurement_delay", -1]] if sequential else [],
        "link": [[fmu_of[a], output, fmu_of[b], name] for a, output, b, name in system.connections],
        "output": [[fmu_of[component], name, name] for component, name in system.observed],
        "auto_output": False,  # of FMI 3.0 it knows no arrays that a structural parameter sizes
        "step_size": STEP,
    }
    (folder / "container.json").write_text(json.dumps(description))
    assembly = import_module("fmu_manipulation_toolbox.assembly").Assembly
    assembly("container.json", fmu_directory=folder).make_fmu(fmi_version=2)
    names = [name for _, name in system.observed]
    container, stop_time = str(folder / "container.fmu"), system.n_steps * STEP
    result = fmpy.simulate_fmu(container, stop_time=stop_time, step_size=STEP, output_interval=STEP, output=names)
    return np.column_stack([result[name][1:] for name in names])


_DESKTOP = {("Linux", "x86_64"), ("Windows", "AMD64")}

IMPORTERS: dict[str, tuple[Callable[[ClosedSystem, Path], Array], set[tuple[str, str]] | None]] = {
    "fmpy": (with_fmpy, None),
    "fmpy SSP": (with_fmpy_ssp, None),
    "libcosim": (with_libcosim, _DESKTOP),  # libcosimpy 0.0.6 has wheels for these
    "ecos": (with_ecos, _DESKTOP),  # ecospy 0.7.2's wheel is for any platform, its libraries are for these
    "fmucontainer -sequential": (partial(with_fmucontainer, sequential=True), _DESKTOP | {("Darwin", "arm64")}),
    "fmucontainer": (with_fmucontainer, _DESKTOP | {("Darwin", "arm64")}),  # likewise fmu-manipulation-toolbox 2.0's
}
"""Importers: function that runs the system, and platforms with a library; None for all."""


def exists_here(importer: str) -> bool:
    """Whether the importer's package has a library for this platform; it must then be installed."""
    platforms = IMPORTERS[importer][1]
    return platforms is None or (platform.system(), platform.machine()) in platforms


def run(importer: str, system: ClosedSystem, folder: Path) -> Array:
    """Return what is observed at ``t_1 … t_n``, ``(n_steps, n_observed)``, m."""
    rows: Any = IMPORTERS[importer][0](system, folder)
    assert rows.shape == (system.n_steps, len(system.observed))
    return np.asarray(rows, dtype=np.float64)


def main(importer: str, folder: Path, moved: Path, out: Path) -> None:
    """Run all systems that an importer can, each in a folder of its own."""
    runs = {key: (system, folder) for key, system in SYSTEMS.items()}
    if importer not in UNCARRIED:
        n = len(np.load(moved / "command.npy"))
        runs |= {f"{key}{MOVED}": (replace(system, n_samples=n), moved) for key, system in SYSTEMS.items()}
    if importer in READ_FMI3:
        runs["predictor Fmi3"] = replace(SYSTEMS["predictor"], suffix="Fmi3"), folder
    for name, (system, source) in runs.items():
        place = shutil.copytree(source, out / name.replace(" ", "_"))
        os.chdir(place)
        np.save(out / f"{name}.npy", run(importer, system, place))


if __name__ == "__main__":
    main(sys.argv[1], *map(Path, sys.argv[2:]))
