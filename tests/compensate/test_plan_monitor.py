"""When the hybrid model is trusted, and which measurements are learned."""

from __future__ import annotations

import math

import numpy as np
from compensator_cases import closed, compensator
from hypothesis import given, settings
from hypothesis import strategies as st

from hybridsep.compensate.compensator import SepState
from hybridsep.compensate.plan_monitor import PlanMonitor, has_stable_poles
from hybridsep.compensate.sensor import SensorWatch


@settings(max_examples=200)
@given(st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=6), st.floats(-3, 3), st.floats(-3, 3))
def test_step_down_recursion_agrees_with_the_roots(real: list[float], a: float, b: float) -> None:
    polynomial = np.convolve(np.poly(real), np.array([1.0, a, b]))
    radius = float(np.max(np.abs(np.roots(polynomial))))
    if abs(radius - 1.0) > 1e-2:  # multiple roots are known to a part of their digits only
        assert has_stable_poles(-polynomial[1:]) == (radius < 1.0)


def test_not_a_number_is_not_stable() -> None:
    assert not has_stable_poles(np.array([math.nan, 0.1]))
    assert not has_stable_poles(np.array([0.1, math.inf]))


def test_an_unstable_recursion_never_plans() -> None:
    sep = compensator(Np=50, p=2, q=0, t_init=0.0)
    sep.plan(np.zeros(200))
    sep.update(1e-4 * 1.1 ** np.arange(50))  # a residual that grows by 10 % a sample
    assert not has_stable_poles(sep.predictor.weights[2:])
    plan = sep.plan(np.zeros(200))
    assert plan.state is SepState.PHYSICS
    np.testing.assert_array_equal(plan.x_dm, np.zeros(50))


def test_trust_needs_more_than_noise_to_be_lost() -> None:
    rng = np.random.default_rng(2)
    monitor = PlanMonitor()
    for _ in range(50):
        noise = rng.normal(0, 5e-6, 100)
        monitor.observe(noise, rng.normal(0, 1e-6, 100), 25e-12)
    assert monitor.hybrid
    for _ in range(3):
        monitor.observe(noise, rng.normal(0, 20e-6, 100), 25e-12)
    assert not monitor.hybrid
    monitor.restart()
    assert monitor.hybrid
    monitor.observe(noise, np.full(100, np.inf), 25e-12)
    assert not monitor.hybrid
    assert math.isfinite(monitor.excess)


def test_trust_is_not_judged_before_the_warm_up_is_over() -> None:
    sep = compensator(Np=50, p=10, t_init=0.2)
    rng = np.random.default_rng(4)
    excess = []
    for _ in range(8):
        plan = sep.plan(np.zeros(200))
        sep.update(plan.x_pb + 1e-4 * rng.normal(size=50))
        excess.append(sep._planning.monitor.excess)
    assert excess[:4] == [0.0] * 4
    assert all(excess[4:])


def test_a_bad_start_is_not_remembered() -> None:
    """A seed whose few first rows predict badly: 8.0 µm if the warm-up counted."""
    assert 1e6 * closed(compensator(), 506).tracking_rms < 6.6


def test_a_held_value_is_noticed_once_the_drive_moves() -> None:
    rng = np.random.default_rng(0)
    still, moving = np.zeros(50), np.linspace(0, 1e-3, 50)
    watch = SensorWatch()
    assert not watch.misses(still + 1e-6 * rng.normal(size=50), still)
    assert not watch.misses(moving + 1e-6 * rng.normal(size=50), moving)
    assert watch.misses(np.full(50, 2e-4), moving)
    assert watch.misses(np.full(50, 2e-4), np.full(50, 1e-3))  # still held, at rest again
    assert not watch.misses(1e-3 + 1e-6 * rng.normal(size=50), np.full(50, 1e-3))


def test_a_coarse_sensor_at_rest_or_creeping_is_not_held() -> None:
    watch, creep = SensorWatch(), np.linspace(0, 5e-6, 100)
    assert not watch.misses(np.zeros(100), np.zeros(100))
    assert not watch.misses(np.round(creep / 1e-6) * 1e-6, creep)


def test_no_measurement_is_not_learned() -> None:
    sep = compensator(Np=50, p=10, t_init=0.0)
    rng = np.random.default_rng(0)
    learned = []
    for k in range(6):
        plan = sep.plan(np.zeros(200))
        measured = 1e-6 * rng.normal(size=50)
        if k == 2:
            measured[7] = np.nan
        sep.update(measured)
        learned.append(sep.predictor.regression.n_samples)
        assert np.isfinite(plan.x_dm).all()
    assert learned == [50, 100, 100, 100, 150, 200]
