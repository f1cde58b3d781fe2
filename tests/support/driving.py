"""Inputs for streams and how they are stepped; closed loops that the library's stream has run."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from library_stream import LookAheadStream, learned_file
from staircase_data import commanded
from stream import COMPENSATOR, LOOK_AHEADS, OUTPUTS, PREDICTOR, TRAJECTORY, Array, Stream, Value, kind_of, machine_of

from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import spiral

T_S = 1e-3  # s

SHORT: dict[str, dict[str, Value]] = {
    PREDICTOR: {"Np": 20, "p": 6, "q": 2, "t_init": 0.05},
    COMPENSATOR: {"Np": 20, "p": 6, "q": 2, "t_init": 0.05, "preview": 60, "horizon": 0},
}
"""Windows short enough for many of them."""

TIGHT: dict[str, Value] = {"v_max": 0.08, "a_max": 8.0, "j_max": 1000.0}
"""Limits of the trajectory itself: most of a compensator's plans are bounded by them."""


def named(values: object) -> str:
    """Return the name of a set of values as a test's parameter."""
    return ",".join(f"{key}={value:g}" for key, value in values.items()) if isinstance(values, dict) else str(values)


def position(t: float) -> float:
    """Return a smooth command, m."""
    return 0.01 * (1 - math.cos(9 * t)) + 1e-3 * math.sin(40 * t)


def measured(t: float) -> float:
    return position(t - 0.03) + 2e-5 * math.sin(300 * t)


def initialise(stream: Stream, start: float = 0.0, **values: Value) -> None:
    """Initialise, a look-ahead with short windows."""
    stream.initialise({**SHORT.get(kind_of(stream.model), {}), **values}, start=start)


def set_inputs(stream: Stream, t: float, shift: float = 0.0) -> None:
    """Set the smooth motion at ``t``, s, moved by ``shift``, m."""
    kind = kind_of(stream.model)
    if kind in LOOK_AHEADS:
        stream.set("x_d_ahead", position(t) + shift)
        stream.set("x_meas", measured(t) + shift)
    elif kind != TRAJECTORY:
        stream.set("x_d", position(t) + shift)


def steps(stream: Stream, first: int, last: int, shift: float = 0.0) -> list[list[float]]:
    """Step samples ``first … last − 1`` of the smooth motion; return the outputs after each."""
    outputs = []
    for k in range(first, last):
        set_inputs(stream, k * T_S, shift)
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
    return outputs


@dataclass(frozen=True)
class Loop:
    """A closed loop of the library's look-ahead with a plant of the library."""

    values: dict[str, Value]  # what the look-ahead was initialised with
    # (n,), m: its inputs
    r: Array
    x: Array
    outputs: Array  # (n + 1, n_outputs): before each sample and after the last

    def column(self, model: str, name: str) -> Array:
        """Return one of the model's outputs."""
        return self.outputs[:, OUTPUTS[kind_of(model)].index(name)]


Sensor = Callable[[int, float, float], float]
"""Sensor model: output at sample k from the measured position and its last output, m."""


def closed_loop(
    model: str,
    n: int,
    values: Mapping[str, Value] | None = None,
    *,
    start: float = 0.0,
    weights: Path | None = None,
    size: float = 1.0,
    sensor: Sensor = lambda k, x_meas, last: x_meas,
    delay: int = 0,
    path: str = "staircase",
) -> Loop:
    """Return a closed loop over a path; the same is run once.

    ``model``: a look-ahead; ``n``: samples; ``values``: parameters; ``start``: position of rest, m; ``weights``:
    saved predictor that the look-ahead starts warm with; ``size``: of the path, as a fraction; ``delay``: samples by
    which its output arrives late; at rest before; ``path``: {"staircase", "spiral"}, of which the X axis is taken.
    """
    given = {**(values or {}), "x_d_ahead": start, "x_meas": start}
    return _closed_loop(model, n, tuple(given.items()), weights, size, sensor, delay, path)


@cache
def _closed_loop(
    model: str,
    n: int,
    given: tuple[tuple[str, Value], ...],
    weights: Path | None,
    size: float,
    sensor: Sensor,
    delay: int,
    path: str,
) -> Loop:
    machine, values = machine_of(model), dict(given)
    assert machine.plant is not None
    plant, encoder = machine.new_plant(), Encoder(machine.plant.noise_std, 1)
    stream, start = LookAheadStream(model, learned_file(weights)), float(values["x_d_ahead"])
    T_s = float(values.get("T_s", T_S))
    stream.initialise(values)
    plant.reset(start)
    r, x = size * (commanded() if path == "staircase" else spiral()[0])[:n] + start, np.empty(n)
    outputs, arrive = [stream.outputs()], [start] * delay
    for k in range(n):
        arrive.append(sensor(k, encoder.measure(plant.x), float(x[k - 1]) if k else start))
        x[k] = arrive[k]
        plant.step(outputs[-1][0], T_s)  # x_d of a predictor, x_dm of a compensator
        stream.set("x_d_ahead", float(r[k]))
        stream.set("x_meas", float(x[k]))
        stream.step(k * T_s, T_s)
        outputs.append(stream.outputs())
    return Loop(values, r, x, np.array(outputs))


def replay(
    stream: Stream, loop: Loop, first: int = 0, last: int | None = None, start_time: float = 0.0, *, saved_at: int = -1
) -> Array:
    """Step samples ``first … last − 1`` of a loop, saved and restored before one; return the outputs, the first too."""
    T_s = float(loop.values.get("T_s", T_S))
    outputs = [stream.outputs()]
    for k in range(first, len(loop.r) if last is None else last):
        if k == saved_at:
            stream.restore(stream.save())
        stream.set("x_d_ahead", float(loop.r[k]))
        stream.set("x_meas", float(loop.x[k]))
        stream.step(start_time + k * T_s, T_s)
        outputs.append(stream.outputs())
    return np.array(outputs)


def run(stream: Stream, r: Array, x: Array, values: Mapping[str, Value], *, saved_at: int = -1) -> Array:
    """Return the outputs of a look-ahead over its inputs, (n,), m, which rest at their first ones before."""
    given = {"x_d_ahead": float(r[0]), "x_meas": float(x[0]), **values}
    stream.initialise(given)
    return replay(stream, Loop(given, r, x, np.empty(0)), saved_at=saved_at)
