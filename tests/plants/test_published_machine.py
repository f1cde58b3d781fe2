"""Xiao's machine, benchmarks/outside/xiao.py: its printed error without compensation, and its linear part."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.outside.controller import Controller
from benchmarks.outside.xiao import (
    AXES,
    NOISE_STD,
    T_S,
    UM,
    Axis,
    Friction,
    XiaoDrive,
    circle,
    contour_errors,
    of_gains,
)
from hybridsep.base.metrics import ErrorSize, largest, rms
from hybridsep.cosim.loop import cosimulate
from hybridsep.plants.plant import Encoder, simulate


@pytest.mark.slow
def test_the_contour_error_without_compensation_is_the_printed_one() -> None:
    points, judged = circle()
    reached = [simulate(XiaoDrive(axis), points[:, i], T_S) for i, axis in enumerate(AXES.values())]
    error = UM * contour_errors(np.stack(reached, axis=1))[judged]
    assert (largest(error), rms(error)) == pytest.approx((67.3, 22.3), abs=0.5)


@pytest.mark.parametrize("axis", AXES.values(), ids=list(AXES))
def test_without_friction_it_moves_as_its_linear_loop(axis: Axis) -> None:
    x_d, none = circle()[0][:1500, 0], Friction(0.0, 0.0, 1.0, 1.0)
    x = simulate(XiaoDrive(replace(axis, forward=none, backward=none)), x_d, T_S)
    model = axis.model()
    assert model.dc_gain == pytest.approx(1.0, abs=1e-9)
    discrete = model.discretise(T_S, "foh")
    # the command reaches x_d(k) at the end of the sample, a first-order hold at its beginning
    x_pb = discrete.forced_response(discrete.rest(), np.append(x_d[0], x_d[:-1]) - x_d[0])[0] + x_d[0]
    # its steps are of 50 µs, half of which is 0.5 µm at the circle's feed
    assert rms(x - x_pb) < 1e-6 < 0.1 * rms(x - x_d)


@pytest.mark.slow
def test_what_is_left_of_a_repeated_pass_falls_where_memory_holds_the_pass() -> None:
    """By the C library: RMS and largest error, with limits as the paper's own method leaves."""
    r, judged = circle()
    machine = of_gains("X").changed("predictor", {"recall": 2 * len(r)})
    plant, encoder = XiaoDrive(AXES["X"]), Encoder(NOISE_STD, 2)
    run = cosimulate(Controller(machine), plant, np.tile(r[:, 0], 4), encoder=encoder)
    errors = [ErrorSize.of(UM * (r[:, 0] - x)[judged]) for x in run.x.reshape(4, -1)]
    for before, after in pairwise(errors):
        assert after.largest < 1.05 * before.largest
        assert after.rms < before.rms
    assert errors[-1].largest < 20.9
    assert errors[-1].rms < 3.9
