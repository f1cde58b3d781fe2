"""When the paper's model plans, and what is measured over a plan."""

import math

import numpy as np
from compensator_cases import compensator
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.compensate.planning import has_stable_poles
from hybridsep.online.look_ahead import SepState


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
