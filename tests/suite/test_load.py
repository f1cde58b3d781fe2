"""A load that is known ahead, on every implementation: it acts as so much more command, and plans make up for it."""

from functools import cache

import numpy as np
import pytest
from driving import SHORT, T_S
from library_stream import LookAheadStream
from staircase_data import commanded
from stream import COMPENSATOR, OUTPUTS, PREDICTOR, Array, Stream, Value, machine_of
from streams import StreamMaker, on_all

from hybridsep.base.metrics import rms
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.plant import Encoder

N, PREVIEW = 700, 60
PAPER: dict[str, Value] = {"averaging": False, "Np": 20, "p": 10, "q": 3, "t_init": 0.2, "preview": PREVIEW}
LOADS: dict[str, dict[str, Value]] = {
    "averaging": {**SHORT[COMPENSATOR], "p": 10},
    "late": {**SHORT[COMPENSATOR], "measurement_delay": 5},
    "early": {**SHORT[COMPENSATOR], "measurement_delay": -1},
    "paper": PAPER,
    "physics": {**SHORT[COMPENSATOR], "compensate": 1},
}


def load() -> Array:
    """Return a load that the command says nothing of, m."""
    t = T_S * np.arange(N)
    return np.asarray(2e-4 * np.sin(21.0 * t) * (t > 0.1) + 1e-4 * (1.0 - np.cos(47.0 * t)))


def driven(stream: Stream, values: dict[str, Value], told: Array, *, saved_at: int = -1) -> tuple[Array, Array]:
    """Return the outputs of a loop whose drive has the load, of which the compensator is told another, and errors."""
    machine, r, acting = machine_of(COMPENSATOR), commanded()[:N], load()
    plant, encoder = machine.new_plant(), Encoder(5e-6, 1)
    plant.reset(0.0)
    stream.initialise(values)
    outputs, x, x_meas = [stream.outputs()], np.zeros(len(told)), 0.0
    late = int(values.get("measurement_delay", 0))
    arrive = [0.0] * max(0, late)
    for k in range(len(told)):
        if k == saved_at:
            stream.restore(stream.save())
        x[k], x_meas = plant.x, encoder.measure(plant.x)
        if late >= 0:
            arrive.append(x_meas)
        plant.step(outputs[-1][0] + (acting[k - PREVIEW] if k >= PREVIEW else 0.0), T_S)
        if late < 0:
            arrive.append(encoder.measure(plant.x))
        for name, value in (("x_d_ahead", r[k]), ("x_meas", arrive.pop(0)), ("x_load", told[k])):
            stream.set(name, float(value))
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
    return np.array(outputs), r[: len(told) - PREVIEW] - x[PREVIEW:]


@cache
def of_library(kind: str) -> tuple[Array, Array]:
    return driven(LookAheadStream(COMPENSATOR), LOADS[kind], load())


@pytest.mark.slow
@on_all((COMPENSATOR,))
def test_plans_make_up_for_it(new_stream: StreamMaker) -> None:
    errors = [rms(driven(new_stream(), LOADS["averaging"], told)[1]) for told in (load(), np.zeros(N))]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.slow
@on_all((COMPENSATOR,))
@pytest.mark.parametrize("kind", ["averaging", "paper"])
def test_it_counts_from_its_first_value(new_stream: StreamMaker, kind: str) -> None:
    """A weight that the axis carries from the start on moves nothing, and is learned as any rest."""
    given, none = (driven(new_stream(), LOADS[kind], np.full(400, told))[0] for told in (3e-3, 0.0))
    np.testing.assert_array_equal(given, none)


@on_all((COMPENSATOR,))
def test_without_compensation_the_command_stays(new_stream: StreamMaker) -> None:
    outputs, _ = driven(new_stream(), {**LOADS["averaging"], "compensate": 0}, load())
    x_dm, x_d = (outputs[:, OUTPUTS[COMPENSATOR].index(name)] for name in ("x_dm", "x_d"))
    np.testing.assert_array_equal(x_dm, x_d)


@pytest.mark.slow
@on_all((COMPENSATOR,), needs="agreement")
@pytest.mark.parametrize("kind", LOADS)
def test_it_is_compensated_as_by_the_library(new_stream: StreamMaker, kind: str) -> None:
    """Across a saved state, too."""
    expected, errors = of_library(kind)
    found, _ = driven(new_stream(), LOADS[kind], load(), saved_at=377)
    assert rms(errors) > 0.0
    for name, one, other in zip(OUTPUTS[COMPENSATOR], found.T, expected.T, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9, err_msg=name)


def test_a_predictor_of_the_library_predicts_under_it() -> None:
    machine, r = machine_of(PREDICTOR), commanded()[:500]
    ahead, found = LookAhead(machine.new_predictor(), 0.0), []
    for position, told in zip(r, load(), strict=False):
        found.append(ahead.x_pb)
        ahead.sample(float(position), 0.0, float(told) + 3e-3)
    discrete = machine.new_predictor().discrete
    expected, _ = discrete.forced_response(discrete.rest(), r + load()[:500])
    np.testing.assert_allclose(found[ahead.Np :], expected[: 500 - ahead.Np], rtol=0, atol=1e-15)
