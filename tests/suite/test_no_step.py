"""A modified command never steps: its differences are the command's, or within the limits, whatever comes in."""

import math

import numpy as np
import pytest
from driving import T_S
from properties import share
from scipy.ndimage import maximum_filter1d
from stream import COMPENSATOR, OUTPUTS, Array, Stream
from streams import StreamMaker, on_all

FADED = 20 + 60  # samples after which the change has faded: the window and the preview of the streams
HORIZON = 200  # of plans that are longer than the preview: the change fades within it

LIMITS = {"v_max": 0.1, "a_max": 16.0, "j_max": 5000.0}


def random_run(stream: Stream, seed: int) -> Array:
    """Step through rests, moves up to ten times as fast as the limit, jumps, gaps, trips and changed parameters."""
    rng = np.random.default_rng(seed)
    position = velocity = wanted = x = 0.0
    gap, outputs = 0, []
    for k in range(700):
        what = rng.integers(0, 150)
        if what < 3:
            wanted = rng.choice((0.0, 0.09, -0.09, 0.3, -1.0)) * rng.uniform(0.5, 1.0)
            velocity = wanted if what == 0 else velocity
        elif what == 3:
            position += rng.uniform(-0.02, 0.02)
        elif what == 4:
            gap = int(rng.integers(1, 120))
        elif what == 5:
            stream.set("compensate", int(rng.integers(0, 3)))
        elif what == 6:
            stream.set("change_max", float(10.0 ** rng.uniform(-6.0, -2.0)))
        elif what == 7:
            stream.set("following_error_max", float(10.0 ** rng.uniform(-3.5, -1.0)))
        elif what < 14:
            stream.set("reset", bool(what % 2))
        elif what < 17:
            stream.set("x_load", float(rng.choice((1e-5, 1e-3, 0.1)) * rng.standard_normal()))
        velocity += np.clip(wanted - velocity, -8.0 * T_S, 8.0 * T_S)
        position += float(velocity) * T_S
        stream.set("x_d_ahead", position)
        stream.set("x_meas", math.nan if gap > 0 else x + 1e-6 * float(rng.standard_normal()))
        stream.step(k * T_S, T_S)
        outputs.append(stream.outputs())
        x += 0.15 * (outputs[-1][0] - x)
        gap -= 1
    return np.array(outputs)


@on_all((COMPENSATOR,))
@pytest.mark.parametrize("seed", range(3, 3 + share(30)))
@pytest.mark.parametrize("horizon", [0, HORIZON])
def test_whatever_comes_in(new_stream: StreamMaker, seed: int, horizon: int) -> None:
    stream = new_stream.begun(measurement_timeout=0.05, horizon=horizon, **LIMITS)
    outputs = random_run(stream, seed)
    x_dm, x_d = (outputs[:, OUTPUTS[COMPENSATOR].index(name)] for name in ("x_dm", "x_d"))
    assert np.max(np.abs(x_dm - x_d)) > 0.0
    for order, limit in enumerate(LIMITS.values(), start=1):
        own, bound = np.abs(np.diff(x_d, order)), limit * T_S**order
        # Within a spline (4 spacings of 2) of a command that exceeds a limit the limit is only the change's
        exceeds = maximum_filter1d(own, 2 * 4 * 2 + 1, mode="constant") > bound
        allowed = bound + np.where(exceeds, own, 0.0)
        assert np.all(np.abs(np.diff(x_dm, order)) <= allowed * (1 + 1e-6) + 1e-12), order
    for begins in np.flatnonzero(np.diff(outputs[:, OUTPUTS[COMPENSATOR].index("alarm")]) > 0.0):
        alarm = outputs[begins + 1 :, OUTPUTS[COMPENSATOR].index("alarm")]
        ends = begins + 1 + (int(np.argmin(alarm)) if alarm.min() < 1.0 else len(alarm))
        assert np.all(np.abs(x_dm - x_d)[begins + FADED + horizon : ends] < (1e-5 if horizon else 1e-12))
