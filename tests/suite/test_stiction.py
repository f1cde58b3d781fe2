"""A servo with stiction, which stands for hundreds of samples while its command moves on, in every implementation."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from driving import T_S
from library_stream import LookAheadStream
from stiction import slow_servo
from stream import OUTPUTS, PREDICTOR, PYTHON, Array, Stream, Value
from streams import StreamMaker, on_all

from hybridsep.base.metrics import coverage, rms


def shown(stream: Stream, name: str, Np: int) -> tuple[dict[str, Array], Array]:
    """Return the outputs over the servo's run, (n,) each, and what it measured, (n,), m."""
    x_d, x = slow_servo(name)
    values: dict[str, Value] = {"averaging": True, "Np": Np, "p": min(Np, 50), "q": 3, "t_init": 0.0}
    stream.initialise({**values, "x_d_ahead": float(x_d[0]), "x_meas": float(x[0])})
    outputs = []
    for k, (ahead, measured) in enumerate(zip(x_d, np.concatenate((np.full(Np, x[0]), x)), strict=False)):
        if k == 1234:
            stream.restore(stream.save())
        outputs.append(stream.outputs())
        stream.set("x_d_ahead", float(ahead))
        stream.set("x_meas", float(measured))
        stream.step(k * T_S, T_S)
    return dict(zip(OUTPUTS[PREDICTOR], np.array(outputs)[Np:].T, strict=True)), x[: len(x_d) - Np]


@on_all((PREDICTOR,), needs="figures")
@pytest.mark.parametrize("name", ["to and fro", "creep", "creep after motion"])
def test_an_axis_that_stands_is_learned(new_stream: StreamMaker, name: str) -> None:
    found, x = shown(new_stream(), name, 20)
    settled = np.arange(len(x)) >= 100
    error = (x - found["x_h"])[settled]
    assert rms(error) < 0.17 * rms((x - found["x_pb"])[settled])
    assert coverage(error, found["x_h_std"][settled], 0.95) > 0.85
    assert not found["n_rejected"].any()


@cache
def of_library(Np: int) -> dict[str, Array]:
    return shown(LookAheadStream(PREDICTOR), "to and fro", Np)[0]


@pytest.mark.slow
@on_all((PREDICTOR,), needs="agreement")
@pytest.mark.parametrize("Np", [20, 100])
def test_a_servo_with_stiction_is_predicted_as_by_the_library(new_stream: StreamMaker, Np: int) -> None:
    expected = of_library(Np)
    found, _ = shown(new_stream(), "to and fro", Np)
    exact = new_stream.implementation == PYTHON
    for name in OUTPUTS[PREDICTOR]:
        # Rows of an axis that stands are all alike, without noise, and their Gram matrix has the square of their
        # condition: 1.4e-9 m of slips that are predicted by up to 0.1 m.
        rtol, atol = (0.0, 0.0) if exact else (1e-7, 0.0) if name == "x_h_std" else (0.0, 3e-9)
        np.testing.assert_allclose(found[name], expected[name], rtol=rtol, atol=atol, err_msg=name)
