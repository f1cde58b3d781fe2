"""An axis many of whose measurements are missing is predicted nearly as well as with all, in every implementation."""

from functools import cache

import numpy as np
import pytest
from driving import T_S, run
from library_stream import LookAheadStream
from staircase_data import commanded
from stream import LIBRARY, OUTPUTS, PREDICTOR, Array, Stream, Value, machine_of
from streams import StreamMaker, on_all

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Indices
from hybridsep.plants.plant import Encoder, simulate

N, NP, FIRST = 2000, 20, 1000
"""Samples of a run and of a window; first sample that is judged, behind one half of the staircase."""

MISSING: dict[str, Indices] = {
    "none": np.arange(0),
    "every fifth, at windows' ends": np.arange(4, N, 5),
    "every seventh": np.arange(6, N, 7),
    "a fifth": np.flatnonzero(np.random.default_rng(3).random(N) < 0.2),
}


@cache
def measured() -> tuple[Array, Array]:
    """Return commands and measured positions of the paper's drive, (N,), m."""
    machine, x_d = machine_of(PREDICTOR), commanded()[:N]
    assert machine.plant is not None
    return x_d, Encoder(1e-7, 5).measure_all(simulate(machine.new_plant(), x_d, T_S))


def predicted(stream: Stream, missing: Indices) -> Array:
    """Return what is predicted without some measurements, (N − NP,), m."""
    x_d, x = measured()
    given = x.copy()
    given[missing] = np.nan
    values: dict[str, Value] = {"averaging": True, "Np": NP, "p": NP, "t_init": 0.0, "x_meas": x_d[0]}
    outputs = run(stream, x_d, np.concatenate((np.full(NP, x_d[0]), given))[:N], values)
    return np.asarray(outputs[NP:-1, OUTPUTS[PREDICTOR].index("x_h")])


@cache
def of_library(name: str) -> Array:
    return predicted(LookAheadStream(PREDICTOR), MISSING[name])


@pytest.mark.parametrize("name", list(MISSING)[1:])
def test_many_missing_measurements_cost_little(name: str) -> None:
    _, x = measured()
    error, least = (rms((x[: N - NP] - of_library(one))[FIRST:]) for one in (name, "none"))
    assert error < 1.15 * least


@on_all((PREDICTOR,), alike=(LIBRARY,))
@pytest.mark.parametrize("name", ["every fifth, at windows' ends", "a fifth"])
def test_they_are_bridged_as_by_the_library(new_stream: StreamMaker, name: str) -> None:
    np.testing.assert_allclose(predicted(new_stream(), MISSING[name]), of_library(name), rtol=0.0, atol=1e-11)
