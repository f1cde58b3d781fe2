"""Reference run of an FMU: inputs and expected outputs for importers, in ``documentation/reference``.

The files are named and written as the FMI cross-check had them: ``<name>_in.csv`` with the inputs at each
communication point, ``<name>_ref.csv`` with the outputs there, ``<name>_ref.opt`` with the times of the run. All
parameters have their start values. The outputs are the library's, which computes the same independently; the tests
compare them with the FMU's.
"""

from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np

from ..base.settings import CompensatorSettings, PredictorSettings, samples_before
from ..base.threads import one_blas_thread
from ..compensate.compensator import SepCompensator
from ..machines.machine import Machine
from ..online.look_ahead import LookAhead
from ..plants.plant import Encoder
from ..plants.trajectory import staircase
from ..predict.predictor import HybridPredictor
from .spec import FmuSpec
from .weights import restore_weights

REFERENCE_FOLDER = "documentation/reference"

AGREEMENT: Mapping[str, int] = {"SepCompensator": 9}
"""Decimals, m, to which a model's reference agrees; else 11. The iteration for a bounded plan amplifies rounding."""

_SAMPLES = 600  # length of a run; a look-ahead's is longer if its fill and warm-up are
_COMPENSATED_SAMPLES = 750  # length of a compensator's run: the hybrid model has planned half of it, on all machines
_SAMPLES_MAX = 3000
_WINDOW_MAX = 1000  # longest look-ahead with a reference, samples: with a longer one no short run contains a prediction
_RESOLUTION = 9  # decimals of an input, m; the result is computed from the rounded values
_RESULT_RESOLUTION = 11  # decimals of a result that platforms agree on: an archive has the same bytes wherever built


def reference_run(spec: FmuSpec) -> dict[str, bytes]:
    """Return inputs, result and times: archive name → content; empty where the look-ahead is too long.

    Platforms differ in the last digits, so it stays out of the GUID, as the binaries do.
    """
    table, T_s = spec.table, spec.machine.T_s
    if int(table.parameters.get("preview", table.parameters.get("Np", 0))) > _WINDOW_MAX:
        return {}
    rows = {"FeedDrive": _drive_rows, "ReferenceTrajectory": _played_rows}.get(table.model, _look_ahead_rows)(spec)
    outputs = [(name, variable.kind) for name, variable in table.named("output").items()]
    inputs = [(name, one.kind) for name, one in table.named("input").items() if one.wired]
    base = f"{REFERENCE_FOLDER}/{table.name}"
    options = {"StartTime": 0.0, "StopTime": (len(rows) - 1) * T_s, "StepSize": T_s, "RelTol": 1e-4}
    files = {
        f"{base}_ref.csv": _csv(T_s, outputs, (row for row, _ in rows), _RESULT_RESOLUTION),
        f"{base}_ref.opt": "".join(f"{name}, {number!r}\n" for name, number in options.items()).encode(),
    }
    if inputs:
        files[f"{base}_in.csv"] = _csv(T_s, inputs, (row for _, row in rows), _RESOLUTION)
    return files


Rows = list[tuple[list[float], list[float]]]  # outputs at each communication point, and the inputs that go in there


def _command(machine: Machine, n: int) -> list[float]:
    """Return ``n + 1`` samples of the staircase, m, which ends at rest."""
    limits = {} if machine.limits is None else {"limits": machine.trajectory_limits()}
    command = np.round(staircase(machine.T_s, **limits)[: n + 1], _RESOLUTION)
    rows: list[float] = np.pad(command, (0, n + 1 - len(command)), mode="edge").tolist()
    return rows


def _played_rows(spec: FmuSpec) -> Rows:
    """Return the rows of a trajectory, which stays where it ends."""
    played = staircase(spec.machine.T_s) if spec.samples is None else spec.samples
    return [([float(played[min(k, len(played) - 1)])], []) for k in range(_SAMPLES + 1)]


def _drive_rows(spec: FmuSpec) -> Rows:
    """Return the rows of a drive under the staircase."""
    machine, rows = spec.machine, Rows()
    assert machine.plant is not None  # by fmu_names
    plant, encoder = machine.new_plant(), Encoder(machine.plant.noise_std, machine.plant.seed)
    plant.reset(spec.table.rest)
    for x_d in _command(machine, _SAMPLES):
        rows.append(([plant.x, plant.v, encoder.measure(plant.x)], [x_d]))
        plant.step(x_d, machine.T_s)
    return rows


@one_blas_thread
def _look_ahead_rows(spec: FmuSpec) -> Rows:
    """Return the rows of a look-ahead under the staircase, through two windows of prediction."""
    # What a command leads to, of a compensator the modified one, is measured at the physics model, 2 % off
    machine, parameters, names = spec.machine, spec.table.parameters, list(spec.table.named("output"))
    settings = PredictorSettings.from_fmi(parameters)
    predictor, compensates = HybridPredictor(machine.model, settings), "x_dm" in names
    if spec.weights is not None:
        restore_weights(predictor, spec.weights)
    model: HybridPredictor | SepCompensator = predictor
    if compensates:
        model = SepCompensator(predictor, CompensatorSettings.from_fmi(parameters))
    look_ahead = LookAhead(model, spec.table.rest, unit=machine.unit)
    warm_up = max(samples_before(settings.warm_up, machine.T_s), int(parameters.get("preview", 0)))
    n = min(max(_COMPENSATED_SAMPLES if compensates else _SAMPLES, 3 * settings.Np + warm_up), _SAMPLES_MAX)
    drive = machine.model.discretise(machine.T_s, machine.physics.input_hold).stepper()
    encoder, on_the_way, rows = Encoder(5e-6, 0), deque([0.0] * settings.n_late), Rows()
    for x_d in _command(machine, n):
        outputs = [float(getattr(look_ahead, name)) for name in names]
        on_the_way.append(round(encoder.measure(1.02 * drive(look_ahead.x_dm)), _RESOLUTION))
        rows.append((outputs, [x_d, on_the_way.popleft()]))
        look_ahead.sample(*rows[-1][1])
    return rows


def _csv(T_s: float, columns: Iterable[tuple[str, str]], rows: Iterable[Iterable[float]], decimals: int) -> bytes:
    """Write columns, names with kinds, over time; numbers that read back the same, of whole ones without a point."""
    names, kinds = zip(*columns, strict=True)
    lines = [",".join(f'"{name}"' for name in ("time", *names))]
    for k, row in enumerate(rows):
        numbers = zip(row, kinds, strict=True)
        texts = [repr(round(one, decimals) if kind == "Real" else int(one)) for one, kind in numbers]
        lines.append(",".join((repr(k * T_s), *texts)))
    return "\n".join((*lines, "")).encode()
