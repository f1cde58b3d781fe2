"""Compensation with the averaged model: its slope, what a plan gains, and what it must survive."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from compensator_cases import DRIVE_LIMITS, TS, beyond, turned
from predictor_cases import averaged_model

from hybridsep import load_machine
from hybridsep.base.errors import StateError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate import newton
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.compensate.newton import NewtonSearch, PlanModel
from hybridsep.compensate.planning import AveragedPlanning, ChosenPlan
from hybridsep.compensate.splines import SplineBasis
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run
from hybridsep.machines.machine import Machine
from hybridsep.online.look_ahead import SepState
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest
from hybridsep.predict.averaging.stacking import Stack
from hybridsep.predict.predictor import HybridPredictor

AVERAGED = PredictorSettings(Np=50, p=20)
STAGE = load_machine("als25010_x")
SETTINGS = CompensatorSettings(preview=200, spacing=2, limits=DRIVE_LIMITS)


def compensator(
    machine: Machine = STAGE, compensate: str = "hybrid", predictor: PredictorSettings = AVERAGED, **changes: object
) -> SepCompensator:
    settings = replace(SETTINGS, compensate=compensate, **changes)  # type: ignore[arg-type]
    return machine.new_compensator(settings, predictor=predictor)


def moves() -> Array:
    """Return one second of 7 mm moves, there and back."""
    return rest_to_rest([0.0, 0.007, 0.0, 0.007], PAPER_LIMITS, TS, start_times=[0.05, 0.35, 0.65], duration=1.0)


def run(sep: SepCompensator, machine: Machine = STAGE, **more: object) -> Run:
    assert machine.plant is not None
    return cosimulate(sep, machine.new_plant(), moves(), encoder=Encoder(machine.plant.noise_std, 0), **more)  # type: ignore[arg-type]


@cache
def cold(period: float = 0.0) -> tuple[Run, bytes]:
    """Return the run of a compensator that learns the moves, and the compensator after it."""
    sep = compensator(predictor=replace(AVERAGED, period=period))
    found = run(sep)
    sep.restart(0.0)
    return found, sep.to_bytes()


def learned(period: float = 0.0) -> bytes:
    """Return a compensator that has learned the moves."""
    return cold(period)[1]


def plan_model(sep: SepCompensator, x_d: Array, late: int = 0) -> PlanModel:
    """Return the model over commands of which the first ones are late."""
    physics, of_plan = sep.predictor.state.physics, x_d[late:]
    return PlanModel(averaged_model(sep.predictor), physics, x_d[:late], 0.0, of_plan, of_plan, np.zeros(len(of_plan)))


def follows_its_slope(sep: SepCompensator) -> None:
    x_d, size = moves()[:200], 1e-9
    model, basis = plan_model(sep, x_d), SplineBasis(200, 2, 200)
    changes = basis.values[:, 10:60:7]
    passed = basis.filtered(sep.predictor.physics_operator(200)[0])[:, 7:57:7]
    found = model.slope(model.predict(x_d), changes, passed, 0.0)

    def x_h(command: Array) -> Array:
        found = model.predict(command)
        return np.asarray(found.window.x_pb + found.e_h)

    for column, slope in zip(changes.T, found.T, strict=True):
        more, less = (x_h(x_d + sign * size * column) for sign in (1.0, -1.0))
        # Shrinking, stop operators and the second pass of the stiffness are held in the slope.
        expected = (more - less) / (2.0 * size)
        assert np.max(np.abs(slope - expected)) < 0.02 * np.max(np.abs(expected))


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.0, 2e-3])
def test_the_slope_is_that_of_the_prediction(period: float) -> None:
    follows_its_slope(SepCompensator.from_bytes(learned(period)))


@pytest.mark.slow
@pytest.mark.parametrize("late", [1, 30])
def test_late_commands_are_predicted_and_not_changed(late: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The preview after them is the end of a longer one, whose first commands stay as they are."""
    sep, n = SepCompensator.from_bytes(learned(2e-3)), 200  # kept for other tests: not with what is set next
    monkeypatch.setattr(newton, "_VARIANCE_STRIDE", 1)  # the window is another one, and what is after it
    x_d, basis = moves()[: late + n], SplineBasis(n, 2, n)
    whole, model = plan_model(sep, x_d), plan_model(sep, x_d, late)
    at, of_whole = model.predict(x_d[late:]), whole.predict(x_d)
    np.testing.assert_array_equal(model.position(at), whole.position(of_whole)[late:])
    changes = basis.values[:, 10:60:7]
    passed = basis.filtered(sep.predictor.physics_operator(n)[0])[:, 7:57:7]
    later = ((late, 0), (0, 0))
    expected = whole.slope(of_whole, np.pad(changes, later), np.pad(passed, later), 0.01)
    assert np.abs(expected[late:]).max() > 0.1
    np.testing.assert_array_equal(expected[:late], 0.0)
    np.testing.assert_allclose(model.slope(at, changes, passed, 0.01), expected[late:], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_samples_behind_the_window_share_a_variance(monkeypatch: pytest.MonkeyPatch) -> None:
    sep, x_d = SepCompensator.from_bytes(learned(2e-3)), moves()[:200]
    shared = plan_model(sep, x_d).predict(x_d)
    monkeypatch.setattr(newton, "_VARIANCE_STRIDE", 1)
    own = plan_model(sep, x_d).predict(x_d)
    np.testing.assert_array_equal(shared.e_h[:51], own.e_h[:51])  # the window, and one more
    assert 0.0 < np.std(shared.e_h - own.e_h) < 0.1 * np.std(own.e_h)


def test_plans_weigh_by_what_they_stacked_half_their_length_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each window is judged as it was predicted, and as the plan stacked it that began a window before it."""
    stacked, judged = list[Array](), list[tuple[Array, Array]]()
    choose, update = AveragedPlanning.choose, Stack.update

    def planned(self: AveragedPlanning, *arguments: Any) -> ChosenPlan:
        plan = choose(self, *arguments)
        stacked.append(self.ahead[-1].copy())
        return plan

    def updated(self: Stack, predicted: Array, measured: Array, least: float, like: Array | None = None) -> Stack:
        if like is not None:
            judged.append((predicted, measured))
        return update(self, predicted, measured, least, like)

    monkeypatch.setattr(AveragedPlanning, "choose", planned)
    monkeypatch.setattr(Stack, "update", updated)
    sep = compensator()
    run(sep)
    assert len(stacked) == 4 + len(judged) + 1  # windows: before the trajectory, learned, and the next
    before = stacked[3 : 3 + len(judged)]
    assert sum(np.isfinite(one).all() for one in before) > 5
    for (predicted, measured), ahead in zip(judged, before, strict=True):
        assert len(measured) == (100 if np.isfinite(ahead).all() else 50)
        np.testing.assert_array_equal(measured[50:], measured[: len(measured) - 50])
        np.testing.assert_array_equal(predicted[:, 50:], ahead[:, : len(measured) - 50])


@pytest.mark.slow
def test_slopes_of_disturbances_of_the_user_are_followed() -> None:
    """A sine of the position, and a friction by the commanded velocity."""
    given = (lambda x, v: np.sin(2.0 * np.pi / 2e-3 * x), lambda x, v: np.tanh(v / 0.01))
    own = SepCompensator(HybridPredictor(STAGE.model, AVERAGED, disturbances=given), SETTINGS)
    run(own)
    own.restart(0.0)
    follows_its_slope(SepCompensator.from_bytes(own.to_bytes(), given))
    with pytest.raises(StateError, match="learned with 2 disturbances of the user's own, got 0"):
        SepCompensator.from_bytes(own.to_bytes())


def test_without_anything_learned_the_physics_model_plans() -> None:
    x_d, none = np.concatenate((np.zeros(20), moves()[50:230])), compensator(no_reversal=False)
    plans = [sep.plan(x_d) for sep in (none, compensator(compensate="physics"))]
    assert plans[0].state is SepState.PHYSICS
    np.testing.assert_array_equal(plans[0].x_dm, plans[1].x_dm)
    assert compensator(compensate="off").plan(x_d).state is SepState.OFF


@pytest.mark.slow
def test_a_plan_takes_less_of_a_change_that_takes_back_the_last_one() -> None:
    """The same plan after a last one that changed nothing, the opposite in the near part, and the same."""
    x_d, sep = moves()[:200], SepCompensator.from_bytes(learned())
    assert sep.plan(x_d).state is SepState.HYBRID
    whole, planning = sep._pending.coefficients, sep._planning  # type: ignore[union-attr]
    for before, corrected, share in ((1.0, -whole, 0.8), (0.8, -whole, 0.7), (0.75, whole, 0.9), (0.9, whole, 1.0)):
        planning.share, planning.corrected = before, 1e-3 * corrected
        sep.plan(x_d)
        np.testing.assert_allclose(sep._pending.coefficients, share * whole, rtol=1e-9)  # type: ignore[union-attr]
    sep.update(x_d[:50])
    assert planning.share == 1.0
    np.testing.assert_allclose(planning.corrected[:-25], whole[25:], rtol=1e-9)  # the remainder of the last one was 0


@pytest.mark.slow
def test_a_way_back_in_few_windows_does_not_turn_the_command() -> None:
    """In the last tenth of a plan of four windows; where it may it does."""
    sep, x_d, turns = SepCompensator.from_bytes(learned()), moves()[460:660], []
    for more in (0, 20):
        sep._planning.n_turning += more  # type: ignore[attr-defined]
        sep.plan(x_d)
        turns.append(turned((x_d + sep._basis.values @ sep._pending.coefficients)[180:], x_d[180:]))  # type: ignore[union-attr]
    assert turns[0] == 0 < turns[1]


@pytest.mark.slow
def test_plans_follow_friction_that_follows_the_command() -> None:
    physics, (first, sep) = run(compensator(compensate="physics")), cold()
    warm = run(SepCompensator.from_bytes(sep), t_init=0.0)
    assert warm.state.max() == SepState.HYBRID
    assert first.tracking_rms < 0.6 * physics.tracking_rms
    assert warm.tracking_rms < 0.2 * physics.tracking_rms
    for found in (first, warm):
        assert beyond(found.x_dm, DRIVE_LIMITS) <= 1.0 + 1e-6
    # The averaged model predicts, whichever model plans
    assert rms((physics.x_meas - physics.x_h)[400:]) < 0.5 * rms((physics.x_meas - physics.x_pb)[400:])


@pytest.mark.slow
def test_a_plan_that_is_predicted_to_be_worse_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    x_d = moves()[:200]
    expected = SepCompensator.from_bytes(learned())
    expected.change(compensate="physics")
    sep = SepCompensator.from_bytes(learned())
    assert sep.plan(x_d).state is SepState.HYBRID
    worse = np.full(3 + sep._basis.n_free, 1e-3)
    for cost in (math.inf, math.nan):
        monkeypatch.setattr(
            *(NewtonSearch, "step"),
            lambda _, start, *__, cost=cost: (replace(start, coefficients=worse, cost=cost), 0.1),
        )
        plan = sep.plan(x_d)
        assert plan.state is SepState.PHYSICS
        np.testing.assert_array_equal(plan.x_dm, expected.plan(x_d).x_dm)


def test_where_no_length_of_a_step_is_better_the_next_one_looks_farther(monkeypatch: pytest.MonkeyPatch) -> None:
    sep = SepCompensator.from_bytes(learned())
    assert sep._planning.reach < 0.5
    monkeypatch.setattr(newton, "is_better", lambda *_: False)
    run(sep)
    assert sep._planning.reach >= 1.0


@pytest.mark.slow
def test_an_outlier_of_a_millimetre_hardly_moves_the_command() -> None:
    sound = cold()[0]
    other = run(compensator(), sensor=lambda k, x_meas: x_meas + (1e-3 if k == 430 else 0.0))
    assert np.max(np.abs(other.x_dm - sound.x_dm)) < 5e-6


@pytest.mark.slow
def test_positions_in_another_unit_are_commanded_the_same() -> None:
    def commands(unit: float) -> Array:
        settings = replace(SETTINGS, limits=Limits(*(unit * k for k in (0.1, 16.0, 5000.0))), change_max=1e-3 * unit)
        sep = SepCompensator(HybridPredictor(STAGE.model, replace(AVERAGED, lam=1e-12 * unit**2)), settings)
        x_d, found = np.concatenate((moves(), np.full(200, moves()[-1]))), []
        for k in range(0, 1000, 50):
            plan = sep.plan(unit * x_d[k : k + 200])
            friction = 1e-5 * np.tanh(np.gradient(x_d[k : k + 50]) / 2e-6)
            sep.update(plan.x_pb - unit * friction)
            found.append(plan.x_dm / unit)
        return np.concatenate(found)

    np.testing.assert_allclose(commands(1e3), commands(1.0), rtol=0, atol=1e-8)
