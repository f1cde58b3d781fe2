"""Stops of plans beyond the preview: least squares solved directly, and what is carried out where a plan has none."""

import numpy as np
import pytest

from hybridsep.base.settings import Limits
from hybridsep.base.signals import Array
from hybridsep.compensate.qp import DriveBounds
from hybridsep.compensate.splines import N_DECIDED, SplineBasis
from hybridsep.compensate.stop import Stop

T_S, NP, PREVIEW, HORIZON, SPACING, PINNED = 1e-3, 20, 60, 200, 2, 5
LIMITS = Limits(0.1, 8.0, 900.0)
REST = np.zeros(3)


def stop_of(limits: Limits | None = LIMITS, change_max: float | None = 1e-3) -> tuple[Stop, DriveBounds]:
    basis = SplineBasis(HORIZON, SPACING, NP)
    bounds = DriveBounds(basis, T_S, limits, change_max)
    return Stop(basis, bounds, PREVIEW, NP, PINNED), bounds


@pytest.mark.parametrize("limits", [LIMITS, None], ids=["limits", "none"])
def test_a_stop_takes_the_least_of_the_limits(limits: Limits | None) -> None:
    stop, bounds = stop_of(limits, 1.0)
    n, last = N_DECIDED + stop.n_shared, N_DECIDED + (PREVIEW - 3) // SPACING - 2
    shared = 1e-6 * np.random.default_rng(3).standard_normal(n).cumsum().cumsum()
    plan = np.concatenate((shared, np.zeros((HORIZON - 4 * SPACING - 3) // SPACING + 1 - stop.n_shared)))
    _, found = stop.carried_out(plan, np.zeros(stop.n), *bounds.hard(np.zeros(PREVIEW), REST, REST))
    if limits is not None:  # the plan may be too fast, and is shortened
        shared = found[:n]

    def cost(c: Array) -> float:
        """Return the sum of squares of the differences, in limits, behind the shared coefficients."""
        shares = enumerate(bounds.shares(SPACING), start=1)
        held = np.concatenate((c, np.full(3, c[-1])))
        return float(sum(share**2 * np.sum(np.diff(held, order)[n - order :] ** 2) for order, share in shares))

    np.testing.assert_array_equal(found[:n], shared)
    for j in range(n, last):
        for step in (-1e-3, 1e-3):
            other = found.copy()
            other[j : last if j < last - 1 else None] += step * np.ptp(found)
            assert cost(other) > cost(found)
    assert np.all(found[last:] == found[last - 1])


def test_a_plan_without_a_stop_is_shortened_to_the_last_one_and_fades() -> None:
    stop, bounds = stop_of(change_max=1e-2)
    n = N_DECIDED + stop.n_shared
    # A change that gathers half of the largest velocity, under a command that has 0.7 of it
    k = np.maximum(0.0, np.arange(N_DECIDED + 96) - N_DECIDED)
    plan = 0.5 * 0.2 * LIMITS.acceleration * (T_S * SPACING * k) ** 2
    step = 0.7 * LIMITS.velocity * T_S
    ramp = step * np.arange(-2.0, PREVIEW + 1, dtype=np.float64)
    before, command = np.split(ramp, [3])
    low, high = bounds.hard(command, before, REST)
    carried, found = stop.carried_out(plan, np.zeros(stop.n), low, high)
    rows = stop.rows @ found
    assert np.all(rows >= low - 1e-8)
    assert np.all(rows <= high + 1e-8)
    assert 0.0 < np.max(np.abs(carried[:n])) < np.max(np.abs(plan[:n]))
    assert np.max(np.abs(carried[-5:])) < 0.1 * np.max(np.abs(carried))


def test_the_last_stop_goes_on_where_nothing_of_a_plan_is_possible() -> None:
    stop, bounds = stop_of()
    plan = np.full(N_DECIDED + 97, 1.0)  # m
    plan[: N_DECIDED + PINNED] = 0.0
    carried, found = stop.carried_out(plan, np.zeros(stop.n), *bounds.hard(np.zeros(PREVIEW), REST, REST))
    assert not carried.any()
    assert not found.any()
