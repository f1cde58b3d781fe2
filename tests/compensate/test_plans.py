"""Plans against independent oracles; limits, continuity and fall-back; when the paper's model plans; stops."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from compensator_cases import DRIVE_LIMITS, MODEL, TS, compensator, move, plant
from hypothesis import given
from hypothesis import strategies as st
from oracle import clarabel_minimum
from properties import examples
from scipy.interpolate import BSpline
from scipy.linalg import toeplitz
from staircase_data import commanded

from hybridsep.base.settings import Limits, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate.limits import Bounds, DriveBounds
from hybridsep.compensate.newton import TOLERANCE
from hybridsep.compensate.planning import has_stable_poles
from hybridsep.compensate.qp import EXACT, Minimum, Tolerance, solve
from hybridsep.compensate.splines import N_DECIDED, PlanCost, SplineBasis, solved_splines
from hybridsep.compensate.stop import Stop
from hybridsep.cosim.loop import cosimulate
from hybridsep.online.look_ahead import SepState
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest
from hybridsep.predict.predictor import HybridPredictor


def tracking_cost(g: Array, x_d: Array, delta: Array, weight: float) -> float:
    error = x_d - np.asarray(toeplitz(g, np.zeros(len(g)))) @ (x_d + delta)
    return float(error @ error + weight * np.sum(np.diff(np.concatenate((np.zeros(3), delta)), 3) ** 2))


def direct_samples(g: Array, x_d: Array, weight: float) -> Array:
    """Return the best change of a motion from rest with every sample free, by least squares on the full matrices."""
    G, third = toeplitz(g, np.zeros(len(g))), np.diff(np.eye(len(g) + 3), 3, axis=0)[:, 3:]
    A, b = np.concatenate((G, np.sqrt(weight) * third)), np.concatenate((x_d - G @ x_d, np.zeros(len(g))))
    return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])


def test_splines_approach_the_direct_samples() -> None:
    x_d, weight, rest = move(), 1.0, np.zeros(3)
    predictor = HybridPredictor(MODEL, PredictorSettings(averaging=False), start=0.0)
    g, free = predictor.operator(200).g_pb, np.zeros(200)
    direct = direct_samples(g, x_d, weight)
    least = tracking_cost(g, x_d, direct, weight)
    excess, distance = [], []
    for spacing in (10, 5, 2, 1):
        basis = SplineBasis(200, spacing, 200)
        cost = basis.cost(g, free, x_d, np.zeros(3 + basis.n_free), rest, weight)
        delta = basis.values[:, N_DECIDED:] @ np.linalg.solve(cost.P, cost.v)
        excess.append(tracking_cost(g, x_d, delta, weight) / least - 1.0)
        distance.append(float(np.max(np.abs((delta - direct)[:150])) / np.max(np.abs(direct))))
    assert min(excess) > -1e-6  # nothing is better than every sample free
    assert excess == sorted(excess, reverse=True)
    assert distance == sorted(distance, reverse=True)
    assert distance[-1] < 0.01


def test_one_filtered_spline_and_its_shifts_are_all_of_them() -> None:
    basis = SplineBasis(120, 5, 120)
    g = HybridPredictor(MODEL, PredictorSettings(averaging=False), start=0.0).operator(120).g_pb
    expected = toeplitz(g, np.zeros(120)) @ basis.values[:, N_DECIDED:]
    np.testing.assert_allclose(basis.filtered(g), expected, rtol=0, atol=1e-13)


def test_the_splines_end_so_that_what_follows_is_the_command_itself() -> None:
    for preview, spacing in ((200, 1), (120, 5), (64, 10)):
        values = SplineBasis(preview, spacing, 10).values
        assert not values[-3:].any()
        assert values[:, N_DECIDED:].any(axis=0).all()


@pytest.mark.parametrize(("what", "held"), [("held", True), ("smooth", False)])
def test_where_the_command_exceeds_a_limit_it_is_widened_by_as_much(what: str, held: bool) -> None:
    basis, before = SplineBasis(60, 2, 20), np.zeros(3)
    x_d = np.concatenate((np.zeros(20), 1e-6 * np.arange(40.0)))
    if held:
        x_d[31:33] += 3e-5  # for two samples
    limits, rest = Limits(0.1, 16.0, 5000.0), np.zeros(basis.values.shape[1])
    bounds = DriveBounds(basis, TS, limits, 1e-3).bounds(x_d, before, before, rest)
    for i, scale in enumerate((limits.velocity * TS, limits.acceleration * TS**2, limits.jerk * TS**3)):
        own = np.diff(np.concatenate((before, x_d)), i + 1)[2 - i :] / scale
        at_most = bounds.high[60 * i : 60 * (i + 1)] + own  # of x_dm
        exceeds = np.abs(own).max() > 1.0
        assert exceeds == (held and i > 0)
        np.testing.assert_allclose(at_most[:20], 1.0, rtol=1e-6)
        near = np.maximum(own, 0.0)[23:41] if exceeds else np.zeros(18)
        np.testing.assert_allclose(at_most[23:41], 1.0 + near, rtol=1e-6, err_msg=what)


@pytest.mark.parametrize(("n", "window"), [(90, 10), (90, 1), (47, 10), (24, 10), (12, 10), (111, 12), (3, 2)])
def test_splines_that_are_solved_for_have_knots_further_apart(n: int, window: int) -> None:
    basis = SplineBasis(2 * n + 9, 2, 20)
    assert basis.n_free == n
    splines = solved_splines(n, window)
    assert np.linalg.matrix_rank(splines) == splines.shape[1]
    k = np.arange(basis.horizon)
    for one in splines.T:
        begin, count = int(np.flatnonzero(one)[0]), int(np.count_nonzero(one))
        apart = 2 * {1: 1, 5: 2, 13: 4}[count]  # samples between knots
        spline = BSpline.basis_element(np.arange(5), extrapolate=False)((k - 2 * begin) / apart)
        np.testing.assert_allclose(basis.values[:, N_DECIDED:] @ one, np.nan_to_num(spline), rtol=0, atol=1e-15)
    assert np.array_equal(splines[:, : min(n, 2 * window)], np.eye(n)[:, : min(n, 2 * window)])
    assert np.flatnonzero(splines.any(axis=1))[-1] >= n - 4  # a change may last nearly as long as the plan


def at_the_limits(seed: int) -> tuple[PlanCost, Bounds, Array]:
    """Return the cost, bounds and remainder of a plan whose command is at the drive's limits."""
    rng = np.random.default_rng(seed)
    preview, basis = 120, SplineBasis(120, 2, 120)
    g = HybridPredictor(MODEL, PredictorSettings(averaging=False), start=0.0).operator(preview).g_pb
    path = rest_to_rest([0.0, 0.004 + 0.004 * rng.random()], PAPER_LIMITS, TS)
    x_d = np.concatenate((np.zeros(30), path, np.full(preview, path[-1])))[:preview]
    rest, before = np.zeros(basis.values.shape[1]), np.zeros(3)
    free = np.cumsum(1e-6 * rng.normal(size=preview))
    cost = basis.cost(g, free, x_d, rest, before, 1.0).regular()
    return cost, DriveBounds(basis, TS, PAPER_LIMITS, 1e-3).bounds(x_d, before, before, rest), rest[N_DECIDED:]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_few_steps_leave_a_plan_within_the_bounds(seed: int) -> None:
    """The remainder touches bounds: on the way from it a plan that exceeds one of them by a millionth would be none."""
    cost, bounds, rest = at_the_limits(seed)
    splines = np.eye(len(rest))[:, 4:]
    of_change = cost.by(splines)
    P, v = of_change.P, of_change.v
    least = clarabel_minimum(P, v, bounds.rows @ splines, bounds.low, bounds.high)

    def above_least(c: Array) -> float:
        return float(0.5 * (c @ P @ c - least @ P @ least) - v @ (c - least))

    found = solve(of_change, bounds.by(splines), tolerance=TOLERANCE)
    assert found is not None
    assert found.steps > 0  # bounds are active
    values = bounds.rows @ splines @ found.x
    assert np.max(np.maximum(values - bounds.high, bounds.low - values)) < 1e-9
    assert above_least(found.x) < 0.02 * above_least(np.zeros(len(v)))


@pytest.mark.slow
def test_a_bounded_plan_costs_what_another_solver_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    bounded = []

    def compare(cost: PlanCost, bounds: Bounds, n_pinned: int, *, tolerance: Tolerance) -> Minimum | None:
        assert tolerance == EXACT
        found = solve(cost, bounds, n_pinned)
        assert found is not None
        c = found.x
        assert np.max(np.maximum(bounds.rows @ c - bounds.high, bounds.low - bounds.rows @ c)) <= 1e-12
        free = np.asarray(np.linalg.solve(cost.P, cost.v), dtype=np.float64)
        if bounds.step(np.zeros_like(free), free) == 1.0:
            np.testing.assert_allclose(c, free, rtol=0, atol=1e-9)
            return found
        assert not c[:n_pinned].any()
        P, v, rows = cost.P[n_pinned:, n_pinned:], cost.v[n_pinned:], bounds.rows[:, n_pinned:]
        other = clarabel_minimum(P, v, rows, bounds.low, bounds.high)

        def value(x: Array) -> float:
            return float(0.5 * x @ P @ x - v @ x)

        bounded.append((value(c[n_pinned:]) - value(other)) / float(cost.v @ free))
        return found

    monkeypatch.setattr("hybridsep.compensate.qp.solve", compare)
    cosimulate(compensator(limits=PAPER_LIMITS), plant(), commanded()[:3500], encoder=Encoder(5e-6, 0))
    assert len(bounded) >= 15
    assert np.max(np.abs(bounded)) <= 1e-5


def test_a_refused_solve_falls_back_to_physics_then_to_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    sep = compensator(Np=50, p=10, t_init=0.0)
    ahead = np.zeros(2000)
    rng = np.random.default_rng(0)
    for _ in range(3):
        state = sep.plan(ahead[:200]).state
        sep.update(1e-5 + 1e-6 * rng.normal(size=50))
    assert state is SepState.HYBRID
    answers: list[Callable[..., Any]] = [lambda *_, **__: None, solve]
    monkeypatch.setattr("hybridsep.compensate.qp.solve", lambda *a, **more: answers.pop(0)(*a, **more))
    assert sep.plan(ahead[:200]).state is SepState.PHYSICS
    monkeypatch.setattr("hybridsep.compensate.qp.solve", lambda *_, **__: None)
    assert sep.plan(ahead[:200]).state is SepState.OFF


@pytest.mark.parametrize("limits", [DRIVE_LIMITS, None], ids=["limits", "none"])
@pytest.mark.parametrize(("averaging", "n_pinned"), [(True, 5), (False, 4)])
def test_compensation_ends_by_the_least_change_that_its_jerk_allows(
    limits: Limits | None, averaging: bool, n_pinned: int
) -> None:
    sep = compensator(limits=limits, averaging=averaging, Np=20, p=5)
    for _ in range(2):  # of a command that moves away
        sep.plan(move(240)[20:220])
        sep.update(np.zeros(20))
    basis, last = sep._basis, sep._previous_plan
    sep.change(compensate="off", change_max=None)
    sep.plan(np.zeros(200))
    assert sep._pending is not None
    found = sep._pending.coefficients
    n, new = 3 + n_pinned, 10  # splines that are decided or pinned, and the ones after the last plan
    third = np.diff(np.concatenate((np.zeros((3, basis.values.shape[1])), basis.values)), 3, axis=0)
    before = np.diff(np.concatenate((sep._before[1], np.zeros(200))), 3)
    weight = (2.0 * np.sin(np.pi * 5.0 / 200)) ** -3.0
    A, b = np.concatenate((basis.values, weight * third)), np.concatenate((np.zeros(200), -weight * before))
    least = np.linalg.lstsq(A[:, n:-new], b - A[:, :n] @ last[:n], rcond=None)[0]
    np.testing.assert_array_equal(found[:n], last[:n])
    if limits is None:
        np.testing.assert_allclose(found[n:-new], least, rtol=0, atol=1e-7 * np.abs(last).max())
    np.testing.assert_allclose(found[-new:], 0.0, atol=1e-12)
    changes = np.abs(basis.values @ found), np.abs(basis.values @ last)
    assert changes[0][:20].max() > 1e-5
    assert changes[0][100:].max() < 0.05 * changes[1][100:].max()
    sep.update(np.zeros(20))
    sep.plan(np.zeros(200))  # the rest of it follows
    np.testing.assert_array_equal(sep._pending.coefficients[:-10], found[10:])


# When the paper's model plans ----------------------------------------------------------------------------------------


@examples(200)
@given(st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=6), st.floats(-3, 3), st.floats(-3, 3))
def test_step_down_recursion_agrees_with_the_roots(real: list[float], a: float, b: float) -> None:
    polynomial = np.convolve(np.poly(real), np.array([1.0, a, b]))
    radius = float(np.max(np.abs(np.roots(polynomial))))
    if abs(radius - 1.0) > 1e-2:  # multiple roots are known to a part of their digits only
        assert has_stable_poles(-polynomial[1:]) == (radius < 1.0)


def test_not_a_number_is_not_stable() -> None:
    assert not has_stable_poles(np.array([math.nan, 0.1]))
    assert not has_stable_poles(np.array([0.1, math.inf]))


def test_it_plans_once_the_warm_up_is_over_and_rows_were_learned() -> None:
    rng, states = np.random.default_rng(0), []
    sep = compensator(Np=50, p=10, t_init=0.1)
    for _ in range(4):
        plan = sep.plan(np.zeros(200))
        states.append(plan.state)
        sep.update(plan.x_pb + 1e-6 * rng.normal(size=50))
    assert states == [SepState.PHYSICS, SepState.PHYSICS, SepState.HYBRID, SepState.HYBRID]
    unlearned = compensator(Np=50, p=10, t_init=0.0)
    assert unlearned.plan(np.zeros(200)).state is SepState.PHYSICS


# Stops of plans beyond the preview: least squares solved directly, and what is carried out where a plan has none ----


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
        """Return the sum of squares of the differences, in limits, after the shared coefficients."""
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


@pytest.mark.parametrize("speed", [0.7, 0.99])  # relative to the limit: of the second one a fiftieth is left
def test_a_plan_without_a_stop_is_shortened_to_the_last_one_and_fades(speed: float) -> None:
    stop, bounds = stop_of(change_max=1e-2)
    n = N_DECIDED + stop.n_shared
    # A change that gathers half of the largest velocity
    k = np.maximum(0.0, np.arange(N_DECIDED + 95) - N_DECIDED)
    plan = 0.5 * 0.2 * LIMITS.acceleration * (T_S * SPACING * k) ** 2
    step = speed * LIMITS.velocity * T_S
    ramp = step * np.arange(-2.0, PREVIEW + 1, dtype=np.float64)
    before, command = np.split(ramp, [3])
    low, high = bounds.hard(command, before, REST)
    carried, found = stop.carried_out(plan, np.zeros(stop.n), low, high)
    rows = stop.rows @ found
    assert np.all(rows >= low - 1e-8)
    assert np.all(rows <= high + 1e-8)
    length = carried[n - 1] / plan[n - 1]
    moves = np.abs(rows) > 1e-12  # the last stop is nothing
    longest = length * np.min((np.where(rows > 0.0, high, low) / np.where(moves, rows, 1.0))[moves])
    assert longest - 2.0**-11 < length <= longest + 1e-8
    assert np.max(np.abs(carried[-5:])) < 0.1 * np.max(np.abs(carried))
    # What is left of it has a stop in the next window, too
    kept, delta = NP // SPACING, SplineBasis(HORIZON, SPACING, NP).values @ carried
    left, old = np.pad(carried[kept:], (0, kept)), np.pad(found[kept:], (0, kept), mode="edge")
    next_bounds = bounds.hard(command + NP * step, command[NP - 3 : NP], delta[NP - 3 : NP])
    assert stop.carried_out(left, old, *next_bounds)[0] is left


def test_the_last_stop_goes_on_where_nothing_of_a_plan_is_possible() -> None:
    stop, bounds = stop_of()
    plan = np.full(N_DECIDED + 97, 1.0)  # m
    plan[: N_DECIDED + PINNED] = 0.0
    carried, found = stop.carried_out(plan, np.zeros(stop.n), *bounds.hard(np.zeros(PREVIEW), REST, REST))
    assert not carried.any()
    assert not found.any()
