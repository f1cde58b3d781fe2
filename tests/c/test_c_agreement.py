"""The C core's compensator and the library's in closed loops of their own, with random parameters, within 1 nm.

Without an accurate minimum in every bounded window a rounding grows a thousandfold in some of them.
"""

from pathlib import Path

import numpy as np
import pytest
from library_stream import LookAheadStream
from random_loops import random_loop, run
from stream import COMPENSATOR
from streams import CoreStream

LOOPS = [
    # change_max of 0.1 mm: nearly every plan is bounded by it
    (202, COMPENSATOR, {"change_max": 1e-4}),
    # and others, with the trajectory's limits for the drive, or anything between
    (38, COMPENSATOR, {}),
    # with averaging
    (6, f"{COMPENSATOR}_als25010_x", {"averaging": 1}),
    (202, COMPENSATOR, {"averaging": 1, "change_max": 1e-4}),
    # and a part that is recalled again and again, from the fourth repeat on by a share
    (75, f"{COMPENSATOR}_als25010_y", {"averaging": 1, "recall": 360}),
]
AT_NIGHT = [
    *((seed, COMPENSATOR, {"change_max": 1e-4}) for seed in (213, 225, 231, 233)),
    *((seed, f"{COMPENSATOR}_als25010_x", {"change_max": 1e-4}) for seed in (261, 264)),
    *((seed, f"{COMPENSATOR}_als25010_y", {"averaging": 1}) for seed in (4, 7)),
    (25, f"{COMPENSATOR}_als25010_y", {"averaging": 1, "recall": 400}),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "model", "fixed"),
    [*LOOPS, *(pytest.param(*loop, marks=pytest.mark.nightly) for loop in AT_NIGHT)],
    ids=lambda value: str(value),
)
def test_random_loops_command_the_same(seed: int, model: str, fixed: dict[str, float], tmp_path: Path) -> None:
    loop = random_loop(seed, 1000, **fixed)
    (x_library, states_library), (x_c, states_c) = (
        run(one, loop) for one in (LookAheadStream(model), CoreStream(model, tmp_path))
    )
    assert float(np.max(np.abs(x_library - x_c))) <= 1e-10
    np.testing.assert_array_equal(states_library, states_c)
    assert set(states_c) - {0}  # something was planned


@pytest.mark.parametrize(
    ("seed", "model", "start", "n_rest", "n", "fixed"),
    [
        # Limits on third differences of positions that are far from 0
        (20, f"{COMPENSATOR}_als25010_y", -3.3, 10, 400, {}),
        (13, f"{COMPENSATOR}_als25010_y", -3.3, 100, 700, {}),
        (149, COMPENSATOR, 0.1745, 200, 500, {}),  # a plan does not depend on the splines that it does not change
        # A stop takes no large multiple of the last one's own part, which may be rounding
        (10020, f"{COMPENSATOR}_als25010_x", -3.3, 45, 300, {"preview": 112, "horizon": 254}),
        # Wide splines count in nothing that regularises a programme
        (10305, COMPENSATOR, 0.17453292, 143, 262, {}),
    ],
)
def test_rounded_and_shifted_loops_differ_as_one_binary_place_of_the_measurement_does(
    seed: int, model: str, start: float, n_rest: int, n: int, fixed: dict[str, float], tmp_path: Path
) -> None:
    loop = random_loop(seed, n, averaging=1, **fixed).at_rest_at(start, n_rest)
    (x, states), (x_c, states_c) = (run(one, loop) for one in (LookAheadStream(model), CoreStream(model, tmp_path)))
    x_nudged, _ = run(LookAheadStream(model), loop, nudged=True)
    differ, twin = (float(np.max(np.abs(other - x)) / np.ptp(loop.r)) for other in (x_c, x_nudged))
    assert differ <= max(1e-11, 10 * twin)
    np.testing.assert_array_equal(states, states_c)
    assert 2 in states
