"""A window that diverges, on every implementation: refused with the output's name, and none of it shown."""

import re

import numpy as np
import pytest
from driving import T_S, steps
from library_models import runaway_predictor
from stream import CANNOT, PREDICTOR, WINDOWS, RefusedStreamError
from streams import StreamMaker, on_all

from hybridsep.fmi.weights import weights_file

SAID = re.escape("x_h must stay within ±1e+100 m: the learned recursion diverges; raise lambda, lower p or reset")


@on_all((PREDICTOR,))
def test_a_window_that_diverges_is_refused_until_another_state_is_set(new_stream: StreamMaker) -> None:
    stream, other = (new_stream.planted(weights_file(runaway_predictor())) for _ in range(2))
    stream.initialise({"t_init": 0.0, "x_d_ahead": 0.01})
    beginning = stream.save()
    first = steps(stream, 0, 99)
    before, outputs = stream.save(), stream.outputs()
    windows = [stream.window(name) for name in WINDOWS]
    for k in range(99, 103):
        with pytest.raises(RefusedStreamError, match=SAID):
            stream.step(k * T_S, T_S)
        if (new_stream.implementation, "outputs kept") not in CANNOT:
            assert stream.outputs() == outputs
        np.testing.assert_array_equal([stream.window(name) for name in WINDOWS], windows)
    diverged = stream.save()
    # It may be saved, and stays what it is.
    for state in (before,) if (new_stream.implementation, "diverged states") in CANNOT else (diverged, before):
        other.restore(state)
        with pytest.raises(RefusedStreamError, match=SAID):
            other.step(99 * T_S, T_S)
    stream.restore(beginning)
    assert steps(stream, 0, 99) == first


@on_all((PREDICTOR,))
def test_the_warm_up_hides_what_diverges(new_stream: StreamMaker) -> None:
    stream = new_stream.planted(weights_file(runaway_predictor()))
    stream.initialise({"t_init": 0.1})
    for row in steps(stream, 0, 199):
        assert row[1] == row[2]
        assert np.isfinite(row).all()
    with pytest.raises(RefusedStreamError, match=SAID):
        stream.step(199 * T_S, T_S)
    stream.reset()
    stream.initialise({"t_init": 1e3})
    steps(stream, 0, 300)
