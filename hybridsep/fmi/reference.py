"""Reference experiment of an FMU: inputs and expected outputs for importers, in the folder of LS-REF.

``reference.exp`` describes it (:mod:`hybridsep.fmi.extras`). The tables are named and written as the FMI
cross-check had them: ``<name>_in.csv`` with the inputs at each communication point, ``<name>_ref.csv`` with the outputs
there, ``<name>_ref.opt`` with the times of the run. All parameters have their start values. The outputs are the FMU's
own where this machine can run it, else the library's; the tests compare both.
"""

from __future__ import annotations

import _ctypes
import ctypes
import sys
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..base.errors import FmuError
from ..base.settings import samples_before
from ..base.signals import Array, as_samples
from ..machines.machine import Machine
from ..plants.encoder import Encoder
from ..plants.plant import Drive
from ..plants.trajectory import staircase
from .c_header import TABLE_FILE, table_file
from .compile import TARGETS, host_target, is_kept_here, libraries
from .extras import EXPERIMENT_FILE, RELATED_FOLDER, experiment
from .spec import FmuSpec, table_of
from .variables import FmuTable

if TYPE_CHECKING:
    from ..online.look_ahead import LookAhead

__all__ = [
    "has_reference",
    "library_model",
    "library_models",
    "reference_files",
    "reference_run",
]

_SAMPLES = 600
"""Length of a run; a look-ahead's is longer if its fill and warm-up are."""

_COMPENSATED_SAMPLES = 1500
"""Length of a compensator's run: into the second move, when the hybrid model is trusted on all machines."""

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


class _ReferenceModel(Protocol):
    """What a reference run drives, sample by sample from its start values."""

    def outputs(self) -> list[float]:
        """Return all outputs, in the order of the table."""

    def sample(self, *inputs: float) -> None:
        """Do one step of T_s, with all inputs in the order of the table."""


def has_reference(table: FmuTable) -> bool:
    """Return whether an FMU gets a reference result."""
    return int(table.parameters.get("preview", table.parameters.get("Np", 0))) <= _WINDOW_MAX


def reference_files(spec: FmuSpec, model: _ReferenceModel, drive: _ReferenceModel | None = None) -> dict[str, bytes]:
    """Return experiment, input, result and options of one FMU: archive name → content.

    Parameters
    ----------
    spec : FmuSpec
    model : _ReferenceModel
    drive : _ReferenceModel, optional
        The machine's plant, behind a look-ahead; a linear drive 2 % off if left out.
    """
    machine, table = spec.machine, spec.table
    T_s = machine.T_s
    outputs = {name: variable.kind for name, variable in table.named("output").items()}
    names, given = list(outputs), list(table.named("input"))
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
    model: _ReferenceModel,
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


def _played(model: _ReferenceModel, inputs: Sequence[tuple[float, ...]]) -> list[Row]:
    """Run a model with inputs that do not depend on its outputs."""
    rows: list[Row] = []
    for given in inputs:
        rows.append((model.outputs(), given))
        model.sample(*given)
    return rows


def _measurement(machine: Machine, drive: _ReferenceModel | None) -> Callable[[float], float]:
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


_CO_SIMULATION = 1
_OK = 0
_KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
"""Kind of a variable → the FMI functions' name of it."""


class _Values:
    """Room for the values of variables of one kind, which one call gets.

    Parameters
    ----------
    kind : str
        Of the values of ``_KINDS``.
    references : sequence of int
    """

    def __init__(self, kind: str, references: Sequence[int]) -> None:
        number = ctypes.c_double if kind == "Real" else ctypes.c_int
        self.kind, self.n = kind, ctypes.c_size_t(len(references))
        self.references = (ctypes.c_uint * len(references))(*references)
        self.values = (number * len(references))()


class _HostFmu:
    """An instance of a native FMU with its start values, sample by sample.

    Parameters
    ----------
    library : ctypes.CDLL
        Of its kind.
    table : FmuTable
    guid : str
    resources : Path
    T_s : float, s
    """

    def __init__(self, library: ctypes.CDLL, table: FmuTable, guid: str, resources: Path, T_s: float) -> None:
        variables = list(enumerate(table.variables))
        self._inputs = [i for i, variable in variables if variable.causality == "input"]
        outputs = [(i, _KINDS[variable.kind]) for i, variable in variables if variable.causality == "output"]
        self._outputs = [_Values(kind, [i for i, _ in same]) for kind, same in groupby(outputs, lambda each: each[1])]
        self._library, self._T_s, self._k = library, T_s, 0
        library.fmi2Instantiate.restype = ctypes.c_void_p
        text = [table.name.encode(), guid.encode(), resources.as_uri().encode()]
        self._component = ctypes.c_void_p(
            library.fmi2Instantiate(text[0], _CO_SIMULATION, text[1], text[2], None, 0, 0)
        )
        if not self._component:
            raise FmuError(f"{table.name}: the FMU that is being built cannot be instantiated")
        self._call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(0.0), 0, ctypes.c_double(0.0))
        self._call("EnterInitializationMode")
        self._call("ExitInitializationMode")

    def outputs(self) -> list[float]:
        """Return all outputs, in the order of the table."""
        for outputs in self._outputs:
            self._call(f"Get{outputs.kind}", outputs.references, outputs.n, outputs.values)
        return [float(value) for outputs in self._outputs for value in outputs.values]

    def sample(self, *inputs: float) -> None:
        """Do one step of T_s, with all inputs in the order of the table."""
        n = len(self._inputs)
        self._call("SetReal", (ctypes.c_uint * n)(*self._inputs), ctypes.c_size_t(n), (ctypes.c_double * n)(*inputs))
        self._call("DoStep", ctypes.c_double(self._k * self._T_s), ctypes.c_double(self._T_s), 1)
        self._k += 1

    def close(self) -> None:
        """End the instance."""
        self._library.fmi2FreeInstance(self._component)

    def _call(self, name: str, *arguments: Any) -> None:
        if getattr(self._library, f"fmi2{name}")(self._component, *arguments) != _OK:
            raise FmuError(f"fmi2{name} was refused by the FMU that is being built")


@contextmanager
def _host_fmu(table: FmuTable, guid: str, resources: Mapping[str, bytes], T_s: float) -> Iterator[_HostFmu | None]:
    """Run an FMU on this machine; None where no library of its kind can be loaded here.

    Parameters
    ----------
    table : FmuTable
    guid : str
    resources : mapping
        Content of its resources by file name; the table is added.
    T_s : float, s
    """
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:
        library = _loaded(table.kind, Path(place))
        if library is None:
            yield None
            return
        for file, content in {**resources, TABLE_FILE: table_file(table, guid)}.items():
            (Path(place) / file).write_bytes(content)
        try:
            fmu = _HostFmu(library, table, guid, Path(place), T_s)
            try:
                yield fmu
            finally:
                fmu.close()
        finally:
            _unload(library)


def _loaded(kind: str, folder: Path) -> ctypes.CDLL | None:
    """Return a copy of the kind's library for this machine, loaded from a folder."""
    try:
        target = host_target()
        file = folder / f"{kind}{TARGETS[target].suffix}"
        file.write_bytes(libraries(kind, (target,))[target])
        return ctypes.CDLL(str(file))
    except (FmuError, OSError):  # another platform or C library; a folder from which nothing may be loaded
        return None


def _unload(library: ctypes.CDLL) -> None:
    """Let go of a library, whose file Windows keeps as long as it is loaded."""
    release = "FreeLibrary" if sys.platform == "win32" else "dlclose"
    getattr(_ctypes, release)(library._handle)


class _LookAheadModel:
    """A predictor or a compensator, sample by sample."""

    def __init__(self, look_ahead: LookAhead, names: Sequence[str]) -> None:
        self._look_ahead, self._names = look_ahead, names

    def outputs(self) -> list[float]:
        return [float(getattr(self._look_ahead, name)) for name in self._names]

    def sample(self, *inputs: float) -> None:
        self._look_ahead.sample(*inputs)


class _PlantModel:
    """A drive with its encoder."""

    def __init__(self, plant: Drive, encoder: Encoder, T_s: float) -> None:
        self._plant, self._encoder, self._T_s = plant, encoder, T_s
        plant.reset(0.0)

    def outputs(self) -> list[float]:
        return [self._plant.x, self._plant.v, self._encoder.measure(self._plant.x)]

    def sample(self, *inputs: float) -> None:
        self._plant.step(inputs[0], self._T_s)


class _TrajectoryModel:
    """Positions, the last of which stays."""

    def __init__(self, positions: Sequence[float]) -> None:
        self._positions, self._k = positions, 0

    def outputs(self) -> list[float]:
        return [self._positions[min(self._k, len(self._positions) - 1)]]

    def sample(self, *inputs: float) -> None:
        self._k += 1


def library_models(spec: FmuSpec) -> tuple[_ReferenceModel, _ReferenceModel | None]:
    """Return the models of a reference run: :func:`library_model`, and the machine's plant if it has one."""
    plant = None if spec.machine.plant is None else _plant(spec.machine)
    return library_model(spec), plant


def library_model(spec: FmuSpec) -> _ReferenceModel:
    """Return the model of an FMU, at its start values."""
    from ..online.look_ahead import LookAhead  # which loads slowly
    from .weights import restore_weights, weights_file

    machine, table = spec.machine, spec.table
    if table.model == "FeedDrive":
        return _plant(machine)
    if table.model == "ReferenceTrajectory":
        played = staircase(machine.T_s) if spec.samples is None else as_samples(spec.samples, "samples")
        return _TrajectoryModel(played.tolist())
    t_init = table.parameters["t_init"]
    if table.model == "HybridPredictor":
        predictor = machine.new_predictor(replace(machine.predictor_settings, t_init=t_init))
        look_ahead = LookAhead(predictor, 0.0)
    else:
        compensator = machine.new_compensator(predictor=replace(machine.compensator_predictor, t_init=t_init))
        predictor = compensator.predictor
        look_ahead = LookAhead(compensator, 0.0)
    if spec.trained is not None:
        restore_weights(predictor, weights_file(spec.trained))
    return _LookAheadModel(look_ahead, list(table.named("output")))


def _plant(machine: Machine) -> _PlantModel:
    assert machine.plant is not None  # by fmu_names
    encoder = Encoder(machine.plant.noise_std, machine.plant.seed)
    return _PlantModel(machine.new_plant(), encoder, machine.T_s)


_FOLDER = "resources/"


def reference_run(spec: FmuSpec, guid: str, content: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the files of :func:`~hybridsep.fmi.reference.reference_files`.

    Platforms differ in the last digits, so they stay out of the GUID, as the binaries do. A Python FMU's are its native
    twin's, which agrees with it, where that library is there: the Python one takes seconds.

    Parameters
    ----------
    spec : FmuSpec
    guid : str
        The modelDescription's.
    content : mapping
        Archive name → content; a native model reads ``resources/``, and its library is compiled where it is not there.
    """
    resources = {
        file.removeprefix(_FOLDER): data
        for file, data in content.items()
        if file.startswith(_FOLDER) and file.endswith(".bin")
    }
    machine, table = spec.machine, spec.table
    plant = None if machine.plant is None else table_of(machine, "FeedDrive", "drive")
    if spec.flavour == "native" or all(is_kept_here(each.kind) for each in (table, plant) if each is not None):
        with ExitStack() as running:
            model = running.enter_context(_host_fmu(table, guid, resources, machine.T_s))
            if model is not None:
                drive = None if plant is None else running.enter_context(_host_fmu(plant, "{drive}", {}, machine.T_s))
                return reference_files(spec, model, drive)
    return reference_files(spec, *library_models(spec))
