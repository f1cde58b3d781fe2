"""Commands that never turn back where the path moves."""

import numpy as np
import pytest
from built_once import BuiltFmus
from compensator_cases import DRIVE_LIMITS, TS, beyond, compensator, move, turned
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.base.settings import PARAMETERS, Limits
from hybridsep.base.signals import Array
from hybridsep.compensate.limits import DriveBounds
from hybridsep.compensate.splines import SplineBasis
from hybridsep.cosim.loop import cosimulate
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest, spiral


@pytest.mark.slow
@examples(12)
@given(st.integers(0, 2**31), st.sampled_from([1e-6, 1e-4, 1e-2]), st.sampled_from([PAPER_LIMITS, DRIVE_LIMITS]))
def test_a_command_never_turns_where_the_path_moves(seed: int, spread: float, limits: Limits) -> None:
    """Whatever is measured, from window to window, and within the limits."""
    rng = np.random.default_rng(seed)
    stops = np.cumsum(np.concatenate(([0.0], rng.uniform(-0.004, 0.004, 5))))
    r = rest_to_rest(stops, PAPER_LIMITS, TS, dwell=float(rng.uniform(0.0, 0.03)))
    x_d, commands = np.concatenate((r, np.full(300, r[-1]))), []
    sep = compensator(limits=limits, Np=50, p=10, q=3, t_init=0.0)
    for k in range(0, len(r), 50):
        plan = sep.plan(x_d[k : k + 200])
        commands.append(plan.x_dm)
        sep.update(plan.x_pb + spread * rng.normal(size=50))
    x_dm = np.concatenate((np.full(3, r[0]), *commands))  # from rest
    assert turned(x_dm[2:], np.concatenate((r[:1], x_d[: len(x_dm) - 3]))) == 0
    assert beyond(x_dm, limits) <= 1.0 + 1e-6
    assert np.max(np.abs(x_dm[3:] - x_d[: len(x_dm) - 3])) <= 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0, 70])
def test_only_the_velocity_where_the_path_moves_is_bounded_by_the_direction(turns: int) -> None:
    basis, n, step = SplineBasis(80, 4, 80), 80, 1e-5
    steps = np.concatenate((np.full(30, step), np.zeros(30), np.full(20, -step)))  # it moves from the first sample on
    x_d, before, rest = 0.01 + np.cumsum(steps), np.full(3, 0.01), np.zeros(basis.values.shape[1])
    both = (DriveBounds(basis, TS, DRIVE_LIMITS, 1e-3, no_reversal=keep) for keep in (False, True))
    free, kept = (one.bounds(x_d, before, np.zeros(3), rest, turns=turns) for one in both)
    forward, backward = np.zeros(4 * n, dtype=np.bool_), np.zeros(4 * n, dtype=np.bool_)
    forward[turns:30], backward[max(turns, 60) : 80] = True, True
    speed = step / (DRIVE_LIMITS.velocity * TS)  # share of the limit that the path takes
    np.testing.assert_allclose(kept.low[forward], -speed, rtol=1e-9)
    np.testing.assert_allclose(kept.high[backward], speed, rtol=1e-9)
    np.testing.assert_array_equal(kept.low[~forward], free.low[~forward])
    np.testing.assert_array_equal(kept.high[~backward], free.high[~backward])
    np.testing.assert_array_equal(kept.rows, free.rows)


@pytest.mark.slow
@examples(30)
@given(st.integers(0, 2**31))
def test_the_rest_of_a_plan_that_turned_is_still_a_plan(seed: int) -> None:
    rng = np.random.default_rng(seed)
    basis = SplineBasis(80, 4, 80)
    rest: Array = np.asarray(2e-4 * rng.normal(size=basis.values.shape[1]))
    bounds = DriveBounds(basis, TS, DRIVE_LIMITS, 1e-3, no_reversal=True)
    of_change = bounds.bounds(move(80), np.zeros(3), np.zeros(3), rest)
    assert np.all((of_change.low < 0.0) & (of_change.high > 0.0))
    assert np.min(np.diff(move(80) + basis.values @ rest)) < -1e-6  # it does turn


@pytest.mark.slow
def test_friction_that_follows_the_command_makes_turning_dear(fmus: BuiltFmus) -> None:
    """The stage's Y axis, physics model: 126.7 µm where the command keeps its direction, 128.4 where it need not."""
    # By the native FMUs, in a tenth of the library's time; they command as it does (cosim/test_loop.py)
    pair, found = (fmus("SepCompensator_als25010_y"), fmus("FeedDrive_als25010_y")), {}
    for keep in (True, False):
        values = {"averaging": False, "compensate": PARAMETERS["compensate"].to_fmi("physics"), "no_reversal": keep}
        found[keep] = cosimulate(*pair, spiral()[1], controller_values=values)
    assert 1e6 * found[True].tracking_rms == pytest.approx(126.65, abs=0.5)
    assert 1e6 * found[False].tracking_rms == pytest.approx(128.39, abs=0.5)
    assert turned(found[True].x_dm, found[True].x_d) == 0
    assert turned(found[False].x_dm, found[False].x_d) > 10
