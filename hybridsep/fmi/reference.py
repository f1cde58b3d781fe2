"""Reference run of an FMU: inputs and expected outputs for importers, in ``documentation/reference``.

The files are named and written as the FMI cross-check had them: ``<name>_in.csv`` with the inputs at each
communication point, ``<name>_ref.csv`` with the outputs there, ``<name>_ref.opt`` with the times of the run. All
parameters have their start values. The outputs are the FMU's own, by fmpy; the tests compare them with the library's.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..base.errors import FmuError
from ..base.settings import samples_before
from ..machines.machine import Machine
from ..plants.plant import Encoder
from ..plants.trajectory import staircase
from .c_header import TABLE_FILE, table_file
from .compile import TARGETS, host_target, libraries
from .spec import FmuSpec, table_of
from .variables import FmuTable

REFERENCE_FOLDER = "documentation/reference"

AGREEMENT: Mapping[str, int] = {"SepCompensator": 9}
"""Decimals, m, to which a model's reference agrees; else 11. The iteration for a bounded plan amplifies rounding."""

_SAMPLES = 600
"""Length of a run; a look-ahead's is longer if its fill and warm-up are."""

_COMPENSATED_SAMPLES = 1500
"""Length of a compensator's run: into the second move, when the hybrid model plans on all machines."""

_SAMPLES_MAX = 3000
_WINDOW_MAX = 1000
"""Longest look-ahead with a reference, samples: with a longer one no short run contains a prediction."""

_RESOLUTION = 9
"""Decimals of an input, m; the result is computed from the rounded values."""

_RESULT_RESOLUTION = 11
"""Decimals of a result: what platforms agree on, so that an archive has the same bytes wherever it is built."""

_REL_TOL = 1e-4
_GAIN, _NOISE_STD = 1.02, 5e-6
_GUID = "{reference}"
"""Of an FMU that only computes its reference: its table and its instance agree, whatever the archive's becomes."""


class _HostFmu:
    """A native FMU with its start values on this machine, before it is an archive.

    Parameters
    ----------
    table : FmuTable
    resources : mapping
        Content of its resources by file name; the table is added.
    folder : Path
        Empty.
    T_s : float, s

    Raises
    ------
    FmuError, OSError
        If its library cannot be had, or not be loaded from the folder.
    """

    def __init__(self, table: FmuTable, resources: Mapping[str, bytes], folder: Path, T_s: float) -> None:
        import fmpy  # which loads slowly
        from fmpy.fmi2 import FMU2Slave

        target, self._T_s, self._k = host_target(), T_s, 0
        library = folder / "binaries" / fmpy.platform / f"{table.kind}{TARGETS[target].suffix}"
        files = {library: libraries(table.kind, (target,))[target]}
        files |= {folder / "resources" / file: content for file, content in resources.items()}
        files[folder / "resources" / TABLE_FILE] = table_file(table, _GUID)
        for file, content in files.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        here = Path.cwd()
        try:  # fmpy changes the working directory while it loads a library, and leaves it changed if that fails
            self._slave = FMU2Slave(
                guid=_GUID, unzipDirectory=str(folder), modelIdentifier=table.kind, instanceName=table.name
            )
        finally:
            os.chdir(here)
        self.close = self._slave.freeInstance
        self._slave.instantiate()
        self._slave.setupExperiment(startTime=0.0)
        self._slave.enterInitializationMode()
        self._slave.exitInitializationMode()
        gets = {"Real": self._slave.getReal, "Boolean": self._slave.getBoolean}
        variables = list(enumerate(table.variables))
        self._inputs = [i for i, variable in variables if variable.causality == "input" and variable.kind == "Real"]
        outputs = [(i, variable.kind) for i, variable in variables if variable.causality == "output"]
        self._outputs = [
            (gets.get(kind, self._slave.getInteger), [i for i, _ in same])
            for kind, same in groupby(outputs, lambda each: each[1])
        ]

    def outputs(self) -> list[float]:
        """Return all outputs, in the order of the table."""
        return [float(value) for get, references in self._outputs for value in get(references)]

    def sample(self, *inputs: float) -> None:
        """Do one step of T_s, with all positions that enter in the order of the table."""
        self._slave.setReal(self._inputs, inputs)
        self._slave.doStep(self._k * self._T_s, self._T_s)
        self._k += 1


def reference_run(spec: FmuSpec, content: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return inputs, result and times as the native FMU of that content runs them here: archive name → content.

    Empty where the look-ahead is too long, or this machine cannot load its library. A Python FMU's is its native
    twin's, which agrees with it. Platforms differ in the last digits, so it stays out of the GUID, as the binaries do.
    """
    machine, table, folder = spec.machine, spec.table, "resources/"
    if int(table.parameters.get("preview", table.parameters.get("Np", 0))) > _WINDOW_MAX:
        return {}
    resources = {
        file.removeprefix(folder): data
        for file, data in content.items()
        if file.startswith(folder) and file.endswith(".bin")
    }
    with TemporaryDirectory(ignore_cleanup_errors=True) as place, ExitStack() as running:
        try:
            model = running.enter_context(closing(_HostFmu(table, resources, Path(place) / "model", machine.T_s)))
            measure = _linear_drive(machine)
            if machine.plant is not None:
                plant = table_of(machine, "FeedDrive", "drive")
                measure = _drive(running.enter_context(closing(_HostFmu(plant, {}, Path(place) / "d", machine.T_s))))
        except (FmuError, OSError):  # no library, another C library, or a folder from which nothing may be loaded
            return {}
        rows = _run(spec, model, measure)
    outputs = [(name, variable.kind) for name, variable in table.named("output").items()]
    inputs = [(name, variable.kind) for name, variable in table.named("input").items() if variable.kind == "Real"]
    base, T_s = f"{REFERENCE_FOLDER}/{table.name}", machine.T_s
    options = {"StartTime": 0.0, "StopTime": (len(rows) - 1) * T_s, "StepSize": T_s, "RelTol": _REL_TOL}
    files = {
        f"{base}_ref.csv": _csv(T_s, outputs, (row for row, _ in rows), _RESULT_RESOLUTION),
        f"{base}_ref.opt": "".join(f"{name}, {number!r}\n" for name, number in options.items()).encode(),
    }
    if inputs:
        files[f"{base}_in.csv"] = _csv(T_s, inputs, (row for _, row in rows), _RESOLUTION)
    return files


def _run(spec: FmuSpec, model: _HostFmu, measure: Callable[[float], float]) -> list[tuple[list[float], list[float]]]:
    """Return the outputs at each communication point, and the inputs that go in there.

    The command is the staircase. A look-ahead runs through two windows of prediction; behind it is a drive that
    measures what a command, m, leads to, of a compensator the modified one.
    """
    machine, parameters, names = spec.machine, spec.table.parameters, list(spec.table.named("output"))
    n, inputs, on_the_way = _SAMPLES, "x_d" in spec.table.named("input"), deque[float]()
    looks_ahead = "x_h" in names
    if looks_ahead:
        compensates = "x_dm" in names
        sent = names.index("x_dm" if compensates else "x_d")
        settings = machine.compensator_predictor if compensates else machine.predictor_settings
        settings = replace(settings, t_init=parameters["t_init"])
        warm_up = max(samples_before(settings.warm_up, machine.T_s), int(parameters.get("preview", 0)))
        n = min(max(_COMPENSATED_SAMPLES if compensates else _SAMPLES, 3 * settings.Np + warm_up), _SAMPLES_MAX)
        on_the_way.extend([0.0] * settings.n_late)
    limits = {} if machine.limits is None else {"limits": machine.trajectory_limits()}
    command = np.round(staircase(machine.T_s, **limits)[: n + 1], _RESOLUTION)
    rows = []
    for x_d in np.pad(command, (0, n + 1 - len(command)), mode="edge").tolist():
        outputs, given = model.outputs(), [x_d] if inputs or looks_ahead else []
        if looks_ahead:
            on_the_way.append(round(measure(outputs[sent]), _RESOLUTION))
            given.append(on_the_way.popleft())
        rows.append((outputs, given))
        model.sample(*given)
    return rows


def _drive(drive: _HostFmu) -> Callable[[float], float]:
    """Return a function of ``x_d(k)`` that gives the measured ``x(k)`` of a plant."""

    def measure(x_d: float) -> float:
        *_, x_meas = drive.outputs()
        drive.sample(x_d)
        return x_meas

    return measure


def _linear_drive(machine: Machine) -> Callable[[float], float]:
    """Return a function of ``x_d(k)`` that gives the measured ``x(k)`` of the physics model 2 % off."""
    discrete = machine.model.discretise(machine.T_s, machine.physics.input_hold)
    state, encoder = discrete.rest(), Encoder(_NOISE_STD, 0)

    def measure(x_d: float) -> float:
        nonlocal state
        x, state = discrete.forced_response(state, np.array([x_d]))
        return encoder.measure(_GAIN * float(x[0]))

    return measure


def _csv(T_s: float, columns: Iterable[tuple[str, str]], rows: Iterable[Iterable[float]], decimals: int) -> bytes:
    """Write columns, names with kinds, over time; numbers that read back the same, of whole ones without a point."""
    names, kinds = zip(*columns, strict=True)
    lines = [",".join(f'"{name}"' for name in ("time", *names))]
    for k, row in enumerate(rows):
        numbers = zip(row, kinds, strict=True)
        texts = [repr(round(one, decimals) if kind == "Real" else int(one)) for one, kind in numbers]
        lines.append(",".join((repr(k * T_s), *texts)))
    return "\n".join((*lines, "")).encode()
