"""A motion faster than all before is compensated with at most half of the largest change, in every implementation."""

import numpy as np
import pytest
from driving import T_S, initialise
from stream import COMPENSATOR, OUTPUTS
from streams import StreamMaker, on_all

CHANGE_MAX = 5e-6  # m: every plan of the physics model is at it


@on_all((COMPENSATOR,))
def test_half_of_the_largest_change_until_the_motion_was_measured(new_stream: StreamMaker) -> None:
    stream = new_stream()
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
    # At 20 mm/s for the first time; later; and behind what is left of the plans from before 200 mm/s came in sight
    found = [max(changes[first:last]) / CHANGE_MAX for first, last in ((0, 120), (120, 340), (380, 480))]
    assert found == pytest.approx([0.5, 1.0, 0.5], rel=1e-3)
