"""The C core's compensator and the library's in closed loops of their own, with random parameters, within 1 nm.

Without an accurate minimum in every bounded window a rounding grows a thousandfold in some of them.
"""

import numpy as np
import pytest
from random_loops import random_loop, run_c, run_library

LOOPS = [
    # change_max of 0.1 mm: nearly every plan is bounded by it
    (202, "spring_mass_damper", {"change_max": 1e-4}),
    # and others, with the trajectory's limits for the drive, or anything between
    (38, "spring_mass_damper", {}),
    # with averaging
    (6, "als25010_x", {"averaging": 1}),
    (202, "spring_mass_damper", {"averaging": 1, "change_max": 1e-4}),
]
AT_NIGHT = [
    *((seed, "spring_mass_damper", {"change_max": 1e-4}) for seed in (213, 225, 231, 233)),
    *((seed, "als25010_x", {"change_max": 1e-4}) for seed in (261, 264)),
    *((seed, "als25010_y", {"averaging": 1}) for seed in (4, 7)),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "machine", "fixed"),
    [*LOOPS, *(pytest.param(*loop, marks=pytest.mark.nightly) for loop in AT_NIGHT)],
    ids=lambda value: str(value),
)
def test_random_loops_command_the_same(seed: int, machine: str, fixed: dict[str, float]) -> None:
    loop = random_loop(seed, 1500, machine, **fixed)
    (x_library, states_library), (x_c, states_c) = run_library(loop), run_c(loop)
    assert float(np.max(np.abs(x_library - x_c))) <= 1e-9
    np.testing.assert_array_equal(states_library, states_c)
    assert set(states_c) - {0}  # something was planned


@pytest.mark.parametrize(
    ("seed", "machine", "start", "n_rest", "n"),
    [
        (20, "als25010_y", -3.3, 10, 400),  # limits on third differences of positions that are far from 0
        (13, "als25010_y", -3.3, 100, 700),
        (149, "spring_mass_damper", 0.1745, 200, 500),  # a plan does not depend on the splines that it does not change
    ],
)
def test_rounded_and_shifted_loops_differ_as_one_binary_place_of_the_measurement_does(
    seed: int, machine: str, start: float, n_rest: int, n: int
) -> None:
    loop = random_loop(seed, n, machine, averaging=1).at_rest_at(start, n_rest)
    (x, states), (x_c, states_c), (x_nudged, _) = run_library(loop), run_c(loop), run_library(loop, nudged=True)
    travel = float(np.ptp(loop.r))
    differ, twin = (float(np.max(np.abs(other - x))) / travel for other in (x_c, x_nudged))
    assert differ <= max(1e-11, 10 * twin)
    np.testing.assert_array_equal(states, states_c)
    assert 2 in states
