"""Late and missing measurements, starts in motion, faster motion and plants that have changed, in every implementation.

Every implementation shows what the library shows: within 1e-12 m with averaging, 1e-11 m with the paper's model.
"""

from copy import copy
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from driving import T_S, initialise, named, run
from library_stream import LookAheadStream
from predictor_cases import averaged_model, change_learned
from staircase_data import commanded
from stream import COMPENSATOR, OUTPUTS, PREDICTOR, STAGE_PREDICTOR, Array, Value, machine_of
from streams import StreamMaker, on_all

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Indices
from hybridsep.evaluate.backtest import backtest
from hybridsep.fmi.weights import weights_file
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.predict.averaging.experts import ARX_COMMAND, ARX_RESIDUAL, EXPERTS, Regression

AVERAGING: dict[str, Value] = {"averaging": True, "t_init": 0.0}
DELAY = 5

CUT = 1060  # sample of the staircase in the middle of a move, at 80 mm/s


@cache
def moved(model: str, n: int = 3300, noise_std: float | None = None, seed: int = 3) -> tuple[Array, Array]:
    """Return commanded and measured positions of the model's plant over the staircase, (n,), m, with its own noise."""
    machine, x_d = machine_of(model), commanded()[:n]
    assert machine.plant is not None
    encoder = Encoder(machine.plant.noise_std if noise_std is None else noise_std, seed)
    return x_d, encoder.measure_all(simulate(machine.new_plant(), x_d, T_S))


def late(model: str, Np: int, delay: int, n: int = 1200) -> tuple[Array, Array]:
    """Return the inputs of a look-ahead whose sensor is late, from rest, (n,), m."""
    x_d, x = moved(model)
    return x_d[:n], np.concatenate((np.full(Np + delay, x_d[0]), x))[:n]


def cut(model: str, Np: int, delay: int, n: int = 1000) -> tuple[Array, Array]:
    """Return the inputs of a look-ahead beside an axis that is in motion already, (n,), m."""
    x_d, x = moved(model)
    return x_d[CUT : CUT + n], x[CUT - Np - delay :][:n]


@cache
def learned(model: str, leading: Regression = ARX_RESIDUAL, **sizes: Any) -> bytes:
    """Return the ``weights.bin`` of the model's predictor with averaging after the staircase in which an expert led."""
    machine = machine_of(model)
    predictor = machine.new_predictor(replace(machine.predictor_settings, averaging=True, **sizes))
    backtest(predictor, *moved(model))
    stack = averaged_model(predictor).learned.stack
    change_learned(predictor, stacks=(replace(stack, weights=np.eye(len(EXPERTS))[leading.place]),) * 2)
    return weights_file(predictor)


@cache
def changed(model: str, name: str, factor: float) -> tuple[Array, Array]:
    """Return the inputs of a look-ahead on the model's plant with another parameter, (n,), m, under other noise."""
    machine, x_d = machine_of(model), commanded()[:3300]
    assert machine.plant is not None
    plant = copy(machine.new_plant())
    setattr(plant, name, factor * getattr(plant, name))
    x = Encoder(machine.plant.noise_std, 4).measure_all(simulate(plant, x_d, T_S))
    return x_d, np.concatenate((np.full(100, x_d[0]), x))[: len(x_d)]


_OF_LIBRARY: dict[object, Array] = {}


def of_library(model: str, inputs: tuple[Array, Array], values: dict[str, Value], weights: bytes = b"") -> Array:
    """Return what the library shows; the same is run once for all that are compared with it."""
    key = (model, *(one.tobytes() for one in inputs), *sorted(values.items()), weights)
    if key not in _OF_LIBRARY:
        _OF_LIBRARY[key] = run(LookAheadStream(model, weights), *inputs, values)
    return _OF_LIBRARY[key]


def assert_same(shown: Array, expected: Array, *, averaging: bool = True) -> None:
    tolerance = 1e-12 if averaging else 1e-11
    for name, output, of_library in zip(OUTPUTS[PREDICTOR], shown.T, expected.T, strict=True):
        whole = name in ("batch", "n_rejected", "hybrid_active")
        np.testing.assert_allclose(output, of_library, rtol=0, atol=0 if whole else tolerance, err_msg=name)


def assert_agreement(new_stream: StreamMaker, inputs: tuple[Array, Array], values: dict[str, Value]) -> None:
    expected = of_library(new_stream.model, inputs, values)
    shown = run(new_stream(), *inputs, values, saved_at=733)
    assert_same(shown, expected, averaging=bool(values.get("averaging")))


@pytest.mark.slow
@on_all((PREDICTOR,), needs="agreement")
@pytest.mark.parametrize(
    ("values", "inputs"),
    [
        (AVERAGING | {"measurement_delay": DELAY, "dead_time": 9, "input_hold": 1}, late),
        (AVERAGING | {"Np": 20, "p": 6, "q": 2, "measurement_delay": 50}, cut),  # later than a window
        (AVERAGING | {"Np": 7, "p": 7, "q": 0, "measurement_delay": 7, "t_init": 0.25}, late),
        ({"p": 20, "measurement_delay": DELAY}, cut),
        ({"Np": 20, "p": 6, "q": 2, "measurement_delay": 50, "t_init": 0.0}, late),
    ],
)
def test_a_late_measurement_is_predicted_as_by_the_library(
    new_stream: StreamMaker, values: dict[str, Value], inputs: Any
) -> None:
    delay = int(values["measurement_delay"])
    assert_agreement(new_stream, inputs(new_stream.model, int(values.get("Np", 100)), delay), values)


@on_all((PREDICTOR, STAGE_PREDICTOR), needs="agreement")
@pytest.mark.parametrize(
    "values", [{}, {"p": 20, "dead_time": 4, "input_hold": 1}, {"Np": 9, "p": 9}, {"averaging": False}], ids=named
)
def test_a_start_in_motion_is_predicted_as_by_the_library(new_stream: StreamMaker, values: dict[str, Value]) -> None:
    inputs = cut(new_stream.model, int(values.get("Np", 100)), 0)
    assert_agreement(new_stream, inputs, AVERAGING | values)


@on_all((PREDICTOR,), needs="agreement")
def test_a_rejected_measurement_is_within_the_interval(new_stream: StreamMaker) -> None:
    """Of the windows that follow, as long as it is rejected; a sensor that is set anew by 1 mm is so for a second."""
    r, x = late(PREDICTOR, 100, 0, 3000)
    x = x + 1e-3 * (np.arange(3000) >= 1830)
    shown = dict(zip(OUTPUTS[PREDICTOR], run(new_stream(), r, x, AVERAGING)[:-1].T, strict=True))
    error, std = np.abs(x - shown["x_h"]), shown["x_h_std"]
    assert shown["n_rejected"][-1] == 1000
    assert error[1900:2830].min() > 9e-4
    assert (error < 1.96 * std)[1900:2830].all()
    assert std[1700:1900].max() < 2e-5


@cache
def growing(model: str) -> tuple[Array, Array]:
    """Return the inputs of a look-ahead on a plant that rings, and whose motion grows from next to nothing, (n,), m."""
    k = np.arange(3300.0)
    x_d = 1e-3 * (np.maximum(k - 300.0, 0.0) / 3000.0) ** 2 * np.sin(2.0 * np.pi * 2e-3 * (k - 300.0))
    x = simulate(machine_of(model).new_plant(), x_d, T_S) + 4e-6 * np.sin(2.0 * np.pi * 0.03 * k) * (k > 200.0)
    return np.append(x_d[100:], np.full(100, x_d[-1])), Encoder(1e-7, 5).measure_all(x)


@on_all((PREDICTOR, STAGE_PREDICTOR), needs="agreement")
def test_growing_and_ringing_are_predicted_as_by_the_library(new_stream: StreamMaker) -> None:
    assert_agreement(new_stream, growing(new_stream.model), AVERAGING | {"Np": 50, "p": 20})


@on_all((PREDICTOR,), needs="agreement")
@pytest.mark.parametrize(
    ("name", "factor", "saved_at", "leading"),
    [
        ("k", 1.2, 1333, ARX_RESIDUAL),
        ("c_nl", 3.0, 150, ARX_COMMAND),
        # of the drive, told only by errors in the window that ends then, predicted again
        ("k_nl", 0.7, 2499, ARX_RESIDUAL),
    ],
)
def test_a_changed_plant_is_relearned_as_by_the_library(
    new_stream: StreamMaker, name: str, factor: float, saved_at: int, leading: Regression
) -> None:
    """The state that is saved has what was learned in earlier runs and in this one, or what is left of it."""
    model = new_stream.model
    inputs, weights = changed(model, name, factor), learned(model, leading)
    expected = of_library(model, inputs, AVERAGING, weights)
    assert_same(run(new_stream.planted(weights), *inputs, AVERAGING, saved_at=saved_at), expected)


N, NP, FIRST = 2000, 20, 1000
"""Samples of a run and of a window; first sample that is judged, after one half of the staircase."""

MISSING: dict[str, Indices] = {
    "none": np.arange(0),
    "every fifth, at windows' ends": np.arange(4, N, 5),
    "every seventh": np.arange(6, N, 7),
    "a fifth": np.flatnonzero(np.random.default_rng(3).random(N) < 0.2),
}


@cache
def error_without(name: str) -> float:
    """Return the RMS error of the library's predictions without some measurements, m."""
    x_d, x = moved(PREDICTOR, N, 1e-7, 5)
    given = x.copy()
    given[MISSING[name]] = np.nan
    values: dict[str, Value] = {"averaging": True, "Np": NP, "p": NP, "t_init": 0.0, "x_meas": x_d[0]}
    inputs = x_d, np.concatenate((np.full(NP, x_d[0]), given))[:N]
    outputs = run(LookAheadStream(PREDICTOR), *inputs, values)
    return rms((x[: N - NP] - outputs[NP:-1, OUTPUTS[PREDICTOR].index("x_h")])[FIRST:])


@pytest.mark.parametrize("name", list(MISSING)[1:])
def test_many_missing_measurements_cost_little(name: str) -> None:
    assert error_without(name) < 1.15 * error_without("none")


CHANGE_MAX = 5e-6  # m: every plan of the physics model is at it


@on_all((COMPENSATOR,))
@pytest.mark.parametrize(("trained", "shares"), [(False, [0.5, 1.0, 0.5]), (True, [1.0, 1.0])])
def test_half_of_the_largest_change_until_the_motion_was_measured(
    new_stream: StreamMaker, trained: bool, shares: list[float]
) -> None:
    """Of the physics model's plan where no weights judge it; the ones of another motion are forgotten on the way."""
    stream = new_stream.planted(learned(PREDICTOR, Np=NP, p=6, q=2)) if trained else new_stream()
    initialise(stream, compensate=1, change_max=CHANGE_MAX)
    velocity = np.convolve(np.repeat([0.0, 0.02, 0.2], [20, 300, 160]), np.full(40, 1 / 40))[:480]
    x_d, x_dm = OUTPUTS[COMPENSATOR].index("x_d"), OUTPUTS[COMPENSATOR].index("x_dm")
    changes, path = [], np.cumsum(velocity) * T_S
    for k, ahead in enumerate(path):
        stream.set("x_d_ahead", float(ahead))
        stream.set("x_meas", float(path[max(k - 60, 0)]))
        stream.step(k * T_S, T_S)
        outputs = stream.outputs()
        changes.append(abs(outputs[x_dm] - outputs[x_d]))
    # At 20 mm/s for the first time; later; and after what is left of the plans from before 200 mm/s came in sight
    found = [max(changes[first:last]) / CHANGE_MAX for first, last in ((0, 120), (120, 340), (380, 480))]
    assert found[: len(shares)] == pytest.approx(shares, rel=1e-3)
