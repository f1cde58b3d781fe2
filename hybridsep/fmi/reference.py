"""Reference results in ``documentation/reference/``: inputs and expected outputs for importers.

The files are named and written as the FMI cross-check has them: ``<name>_in.csv`` with the inputs at each
communication point, ``<name>_ref.csv`` with the outputs there, ``<name>_ref.opt`` with the times of the run. All
parameters have their start values. The result is the library's: a second implementation, not a recording of the FMU.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.signals import Array, as_samples
from ..compensate.compensator import SepCompensator
from ..machines.machine import Machine
from ..online.look_ahead import LookAhead
from ..plants.encoder import Encoder
from ..plants.trajectory import staircase
from ..predict.predictor import HybridPredictor
from .variables import variables_of
from .weights import restore_weights, weights_file

__all__ = ["REFERENCE_FOLDER", "reference_files"]

REFERENCE_FOLDER = "documentation/reference"

_SAMPLES = 600
"""Length of a run; a look-ahead's is longer if its fill and warm-up are."""

_COMPENSATED_SAMPLES = 1500
"""Length of a compensator's run: into the second move, when the hybrid model is trusted on all machines."""

_SAMPLES_MAX = 3000
_WINDOW_MAX = 1000
"""Longest look-ahead with a reference, samples: with a longer one no short run contains a prediction."""

_RESOLUTION = 9
"""Decimals of an input, m; the result is computed from the rounded values."""

_RESULT_RESOLUTION = 13
_REL_TOL = 1e-4
_GAIN, _NOISE_STD = 1.02, 5e-6

Columns = dict[str, list[float]]


def reference_files(
    machine: Machine,
    description: Mapping[str, Any],
    *,
    samples: ArrayLike | None = None,
    trained: HybridPredictor | None = None,
) -> dict[str, bytes]:
    """Return reference input, result and options of one FMU: archive name → content; empty if it gets none.

    Parameters
    ----------
    machine : Machine
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``.
    samples : (n,) array_like, m, optional
        Trajectory 3 of ReferenceTrajectory.
    trained : HybridPredictor, optional
        Trained predictor with which a HybridPredictor or SepCompensator starts warm.
    """
    table, T_s, parameters = variables_of(description), machine.T_s, description["parameters"]
    names = [variable.name for variable in table if variable.causality == "output"]
    if description["model"] in ("HybridPredictor", "SepCompensator"):
        if parameters.get("preview", parameters["Np"]) > _WINDOW_MAX:
            return {}
        inputs, outputs = _look_ahead_run(machine, parameters["t_init"], names, trained)
    elif description["model"] == "FeedDrive":
        inputs, outputs = _plant_run(machine)
    else:
        command = staircase(T_s) if samples is None else as_samples(samples, "samples")
        inputs = {}
        outputs = {"r": [float(command[min(k, len(command) - 1)]) for k in range(_SAMPLES + 1)]}
    count = len(outputs[names[0]])
    times = [k * T_s for k in range(count)]
    base = f"{REFERENCE_FOLDER}/{description['name']}"
    options = {"StartTime": 0.0, "StopTime": times[-1], "StepSize": T_s, "RelTol": _REL_TOL}
    files = {
        f"{base}_ref.csv": _csv(times, {name: outputs[name] for name in names}, _RESULT_RESOLUTION),
        f"{base}_ref.opt": "".join(f"{name}, {number!r}\n" for name, number in options.items()).encode(),
    }
    if inputs:
        files[f"{base}_in.csv"] = _csv(times, inputs, _RESOLUTION)
    return files


def _look_ahead_run(
    machine: Machine, t_init: float, names: Sequence[str], trained: HybridPredictor | None
) -> tuple[Columns, Columns]:
    """Run a look-ahead over the staircase, with the machine's plant behind it, through two windows of prediction.

    If the outputs ``names`` have a modified command, the look-ahead is the compensator's and the drive gets ``x_dm``.
    """
    model: HybridPredictor | SepCompensator
    if "x_dm" in names:
        model = machine.new_compensator(predictor=replace(machine.compensator_predictor, t_init=t_init))
        predictor, sent, least, warm_up = model.predictor, "x_dm", _COMPENSATED_SAMPLES, model.preview
    else:
        model = predictor = machine.new_predictor(replace(machine.predictor_settings, t_init=t_init))
        sent, least, warm_up = "x_d", _SAMPLES, 0
    if trained is not None:
        restore_weights(predictor, weights_file(trained))
    look_ahead = LookAhead(model, 0.0)
    n = min(max(least, 3 * predictor.Np + max(predictor.n_init, warm_up)), _SAMPLES_MAX)
    command = _command(machine, n + 1)
    measure = _drive(machine, predictor)
    on_the_way = deque([0.0] * predictor.settings.measurement_delay)
    inputs: Columns = {"x_d_ahead": command.tolist(), "x_meas": []}
    outputs: Columns = {name: [] for name in names}
    for k in range(n + 1):
        for name in names:
            outputs[name].append(getattr(look_ahead, name))
        on_the_way.append(round(measure(getattr(look_ahead, sent)), _RESOLUTION))
        inputs["x_meas"].append(on_the_way.popleft())
        look_ahead.sample(inputs["x_d_ahead"][k], inputs["x_meas"][k])
    return inputs, outputs


def _drive(machine: Machine, predictor: HybridPredictor) -> Callable[[float], float]:
    """Return a function of ``x_d(k)`` that gives the measured ``x(k)``: the plant, or a linear drive 2 % off."""
    if machine.plant is not None:
        plant, encoder = machine.new_plant(), Encoder(machine.plant.noise_std, machine.plant.seed)
        plant.reset(0.0)

        def measure(x_d: float) -> float:
            x = encoder.measure(plant.x)
            plant.step(x_d, machine.T_s)
            return x

        return measure
    state, encoder = predictor.discrete.rest(), Encoder(_NOISE_STD, 0)

    def measure_linear(x_d: float) -> float:
        nonlocal state
        x, state = predictor.discrete.forced_response(state, np.array([x_d]))
        return encoder.measure(_GAIN * float(x[0]))

    return measure_linear


def _plant_run(machine: Machine) -> tuple[Columns, Columns]:
    """Run the plant over the staircase."""
    assert machine.plant is not None  # by fmu_names
    plant, encoder = machine.new_plant(), Encoder(machine.plant.noise_std, machine.plant.seed)
    plant.reset(0.0)
    command = _command(machine, _SAMPLES + 1).tolist()
    outputs: Columns = {"x": [], "v": [], "x_meas": []}
    for x_d in command:
        for name, number in (("x", plant.x), ("v", plant.v), ("x_meas", encoder.measure(plant.x))):
            outputs[name].append(number)
        plant.step(x_d, machine.T_s)
    return {"x_d": command}, outputs


def _command(machine: Machine, n: int) -> Array:
    """Return the staircase's first ``n`` samples, m, rounded as in the CSV."""
    limits = {} if machine.limits is None else {"limits": machine.trajectory_limits()}
    command = np.round(staircase(machine.T_s, **limits)[:n], _RESOLUTION)
    return np.asarray(np.pad(command, (0, n - len(command)), mode="edge"))


def _csv(times: Sequence[float], columns: Columns, decimals: int) -> bytes:
    """Write columns over time, numbers so that they read back the same."""
    head = ",".join(f'"{name}"' for name in ("time", *columns))
    rows = (
        ",".join([repr(t), *(repr(round(float(column[k]), decimals)) for column in columns.values())])
        for k, t in enumerate(times)
    )
    return "\n".join((head, *rows, "")).encode()
