"""Reference experiment of an FMU: inputs and expected outputs for importers, in the folder of LS-REF.

``reference.exp`` describes it (:mod:`hybridsep.fmi.extras`). The tables are named and written as the FMI
cross-check had them: ``<name>_in.csv`` with the inputs at each communication point, ``<name>_ref.csv`` with the outputs
there, ``<name>_ref.opt`` with the times of the run. All parameters have their start values. The outputs are the FMU's
own, by fmpy; the tests compare them with the library's.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

import numpy as np

from ..base.errors import FmuError
from ..base.settings import samples_before
from ..base.signals import Array
from ..machines.machine import Machine
from ..plants.plant import Encoder
from ..plants.trajectory import staircase
from .c_header import TABLE_FILE, table_file
from .compile import TARGETS, host_target, libraries
from .extras import EXPERIMENT_FILE, RELATED_FOLDER, experiment
from .spec import FmuSpec, table_of
from .variables import FmuTable

__all__ = ["ReferenceModel", "reference_files", "reference_run"]

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

Row = tuple[list[float], tuple[float, ...]]
"""Outputs at a communication point, and the inputs that go in there."""


class ReferenceModel(Protocol):
    """What a reference run drives, sample by sample from its start values."""

    def outputs(self) -> list[float]:
        """Return all outputs, in the order of the table."""

    def sample(self, *inputs: float) -> None:
        """Do one step of T_s, with all positions that enter in the order of the table."""


def reference_files(spec: FmuSpec, model: ReferenceModel, drive: ReferenceModel | None = None) -> dict[str, bytes]:
    """Return experiment, input, result and options of one FMU: archive name → content.

    Parameters
    ----------
    spec : FmuSpec
    model : ReferenceModel
    drive : ReferenceModel, optional
        The machine's plant, behind a look-ahead; a linear drive 2 % off if left out.
    """
    machine, table = spec.machine, spec.table
    T_s = machine.T_s
    outputs = {name: variable.kind for name, variable in table.named("output").items()}
    names = list(outputs)
    given = [name for name, variable in table.named("input").items() if variable.kind == "Real"]
    if table.model in ("HybridPredictor", "SepCompensator"):
        measure = _measurement(machine, drive)
        rows = _look_ahead_run(machine, table.parameters, names, model, measure)
    elif given:
        rows = _played(model, [(x_d,) for x_d in _command(machine, _SAMPLES + 1).tolist()])
    else:
        rows = _played(model, [()] * (_SAMPLES + 1))
    times = [k * T_s for k in range(len(rows))]
    base = f"{RELATED_FOLDER}/{table.name}"
    options = {"StartTime": 0.0, "StopTime": times[-1], "StepSize": T_s, "RelTol": _REL_TOL}
    files = {
        f"{base}_ref.csv": _csv(times, outputs, [row[0] for row in rows], _RESULT_RESOLUTION),
        f"{base}_ref.opt": "".join(f"{name}, {number!r}\n" for name, number in options.items()).encode(),
    }
    if given:
        files[f"{base}_in.csv"] = _csv(times, dict.fromkeys(given, "Real"), [row[1] for row in rows], _RESOLUTION)
    files[EXPERIMENT_FILE] = experiment(table.name, table.model, options, inputs=bool(given))
    return files


def _look_ahead_run(
    machine: Machine,
    parameters: Mapping[str, Any],
    names: Sequence[str],
    model: ReferenceModel,
    measure: Callable[[float], float],
) -> list[Row]:
    """Run a look-ahead over the staircase, with a drive behind it, through two windows of prediction.

    If the outputs ``names`` have a modified command, the look-ahead is the compensator's and the drive gets ``x_dm``.
    """
    compensates = "x_dm" in names
    sent = names.index("x_dm" if compensates else "x_d")
    settings = machine.compensator_predictor if compensates else machine.predictor_settings
    settings = replace(settings, t_init=parameters["t_init"])
    least = _COMPENSATED_SAMPLES if compensates else _SAMPLES
    warm_up = max(samples_before(settings.warm_up, machine.T_s), int(parameters.get("preview", 0)))
    n = min(max(least, 3 * settings.Np + warm_up), _SAMPLES_MAX)
    on_the_way = deque([0.0] * settings.n_late)
    rows: list[Row] = []
    for x_d_ahead in _command(machine, n + 1).tolist():
        outputs = model.outputs()
        on_the_way.append(round(measure(outputs[sent]), _RESOLUTION))
        inputs = (x_d_ahead, on_the_way.popleft())
        rows.append((outputs, inputs))
        model.sample(*inputs)
    return rows


def _played(model: ReferenceModel, inputs: Sequence[tuple[float, ...]]) -> list[Row]:
    """Run a model with inputs that do not depend on its outputs."""
    rows: list[Row] = []
    for given in inputs:
        rows.append((model.outputs(), given))
        model.sample(*given)
    return rows


def _measurement(machine: Machine, drive: ReferenceModel | None) -> Callable[[float], float]:
    """Return a function of ``x_d(k)`` that gives the measured ``x(k)``: of a plant, or of a linear drive 2 % off."""
    if drive is not None:

        def measure(x_d: float) -> float:
            *_, x_meas = drive.outputs()
            drive.sample(x_d)
            return x_meas

        return measure
    discrete = machine.model.discretise(machine.T_s, machine.physics.input_hold)
    state, encoder = discrete.rest(), Encoder(_NOISE_STD, 0)

    def measure_linear(x_d: float) -> float:
        nonlocal state
        x, state = discrete.forced_response(state, np.array([x_d]))
        return encoder.measure(_GAIN * float(x[0]))

    return measure_linear


def _command(machine: Machine, n: int) -> Array:
    """Return the staircase's first ``n`` samples, m, rounded as in the CSV."""
    limits = {} if machine.limits is None else {"limits": machine.trajectory_limits()}
    command = np.round(staircase(machine.T_s, **limits)[:n], _RESOLUTION)
    return np.asarray(np.pad(command, (0, n - len(command)), mode="edge"))


def _csv(times: Sequence[float], kinds: Mapping[str, str], rows: Sequence[Sequence[float]], decimals: int) -> bytes:
    """Write columns over time, numbers so that they read back the same, whole ones and flags without a point.

    ``kinds`` are the kinds of the columns by name.
    """
    head = ",".join(f'"{name}"' for name in ("time", *kinds))
    real = [kind == "Real" for kind in kinds.values()]
    lines = (
        ",".join(
            [
                repr(t),
                *(repr(round(float(n), decimals) if is_real else int(n)) for n, is_real in zip(row, real, strict=True)),
            ]
        )
        for t, row in zip(times, rows, strict=True)
    )
    return "\n".join((head, *lines, "")).encode()


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

    def close(self) -> None:
        """End the instance and let go of its library."""
        self._slave.freeInstance()


def reference_run(spec: FmuSpec, content: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the reference experiment as its native FMU runs it here: archive name → content.

    Empty where the look-ahead is too long, or this machine cannot load its library. A Python FMU's is its native
    twin's, which agrees with it. Platforms differ in the last digits, so it stays out of the GUID, as the binaries do.

    Parameters
    ----------
    spec : FmuSpec
    content : mapping
        Archive name → content; the FMU reads ``resources/*.bin``.
    """
    if int(spec.table.parameters.get("preview", spec.table.parameters.get("Np", 0))) > _WINDOW_MAX:
        return {}
    machine, folder = spec.machine, "resources/"
    resources = {
        file.removeprefix(folder): data
        for file, data in content.items()
        if file.startswith(folder) and file.endswith(".bin")
    }
    plant = None if machine.plant is None else table_of(machine, "FeedDrive", "drive")
    with TemporaryDirectory(ignore_cleanup_errors=True) as place, ExitStack() as running:
        try:
            model = _HostFmu(spec.table, resources, Path(place) / "model", machine.T_s)
            running.callback(model.close)
            drive = None if plant is None else _HostFmu(plant, {}, Path(place) / "drive", machine.T_s)
            if drive is not None:
                running.callback(drive.close)
        except (FmuError, OSError):  # no library, another C library, or a folder from which nothing may be loaded
            return {}
        return reference_files(spec, model, drive)
