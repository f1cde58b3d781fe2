"""The C core's compensator, sample by sample, against the library's. Each test states its tolerance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import staircase_data as staircase
from c_core import TS, CModel, sep_look_ahead
from numpy.typing import NDArray

from hybridsep.machine import load_machine
from hybridsep.plants.encoder import Encoder
from hybridsep.predict.look_ahead import LookAhead

Array = NDArray[np.float64]

OUTPUTS = ("x_dm", "x_d", "x_pb", "x_h", "e_servo", "rms_e", "rms_pb", "rms_h")


def compare_loops(
    ahead: LookAhead,
    model: CModel,
    r: Array,
    tolerance: float,
    *,
    noise_std: float = 5e-6,
    sensor: Callable[[int, float], float] = lambda k, x: x,
    machine: str = "spring_mass_damper",
) -> Array:
    """Run the library in closed loop with a drive, the C model beside it; return the state of every sample."""
    plant, encoder = load_machine(machine).new_plant(), Encoder(noise_std, 1)
    period = float(model["T_s"])
    plant.reset(float(r[0]))
    states = []
    for k in range(len(r)):
        for name in OUTPUTS:
            assert abs(model[name] - getattr(ahead, name)) <= tolerance, (name, k)
        assert model["batch"] == ahead.batch
        assert model["sep_state"] == ahead.sep_state, k
        states.append(model["sep_state"])
        x_meas = sensor(k, encoder.measure(plant.x))
        plant.step(ahead.x_dm, period)
        ahead.sample(float(r[k]), x_meas)
        model["x_d_ahead"], model["x_meas"] = float(r[k]), x_meas
        model.step(k * period, period)
    return np.array(states)


@pytest.mark.parametrize("start", [0.0, 0.1])
def test_the_staircase_is_compensated_as_by_the_library(start: float) -> None:
    # 1e-11 m at every sample; the limits act in some windows.
    ahead, model = sep_look_ahead("compensator", start=start)
    states = compare_loops(ahead, model, staircase.commanded()[:4000] + start, 1e-11)
    assert set(states) == {1, 2}
    assert 4e-6 < model["rms_e"] < 1.5e-5


@pytest.mark.parametrize(
    "parameters",
    [
        {"Np": 50, "p": 50, "q": 40, "lambda": 1e-8, "t_init": 0.1},
        {"v_max": 0.08, "a_max": 8.0, "j_max": 1000.0},  # those of the trajectory: nearly every plan is bounded
        {"Np": 50, "p": 20, "v_max": 0.08, "a_max": 8.0, "j_max": 1000.0, "t_init": 0.1},
        {"change_max": 2e-4, "t_init": 0.1},
        {"v_friction": 0.0},
        {"no_reversal": 0, "t_init": 0.1},
        {"compensate": 0},
        {"compensate": 1, "spacing": 5},
        {"spacing": 1, "preview": 130, "p": 7, "q": 0},
        {"spacing": 20, "preview": 207, "p": 7, "q": 99},
        {"Np": 12, "p": 7, "q": 5, "spacing": 3, "preview": 77, "t_init": 0.05, "v_friction": 0.0},
        {"Np": 20, "p": 10, "q": 5, "preview": 160, "v_friction": 5e-3},
        {"Np": 8, "p": 5, "q": 2, "preview": 160, "lambda": 1e-8},
        {"Np": 1, "p": 1, "q": 0, "spacing": 1, "preview": 60, "t_init": 0.05, "v_friction": 0.0},
        {"input_hold": 1, "dead_time": 3, "p": 10},
        {"jerk_weight": 0.0, "t_init": 0.0, "p": 10},
        {"jerk_weight": 300.0, "lambda": 1e-6},
    ],
    ids=lambda values: ",".join(f"{key}={value:g}" for key, value in values.items()),
)
def test_every_parameter_acts_as_in_the_library(parameters: dict[str, float]) -> None:
    # 1e-9 m: what is rounded apart comes back through the loop.
    ahead, model = sep_look_ahead("compensator", **parameters)
    compare_loops(ahead, model, staircase.commanded()[: 1600 if parameters.get("Np") != 1 else 500], 1e-9)


def test_the_stage_is_compensated_as_by_the_library() -> None:
    ahead, model = sep_look_ahead("compensator_2", q=20)
    compare_loops(ahead, model, 0.3 * staircase.commanded()[:2500], 1e-9, machine="als25010_x", noise_std=1e-6)


@pytest.mark.parametrize("first", [800, 1050, 1200])
def test_a_held_sensor_is_not_learned_either(first: int) -> None:
    held = [0.0]

    def hold(k: int, x_meas: float) -> float:
        if not first <= k < first + 500:
            held[0] = x_meas
        return held[0]

    ahead, model = sep_look_ahead("compensator", t_init=0.1)
    states = compare_loops(ahead, model, staircase.commanded()[:2500], 1e-10, sensor=hold)
    assert set(states) == {1, 2}


def test_an_unstable_recursion_never_plans() -> None:
    ahead, model = sep_look_ahead("compensator", Np=50, p=2, q=0, t_init=0.0)

    def grow(k: int, x_meas: float) -> float:
        return x_meas + (1e-6 * 1.1 ** (k - 250) if 250 <= k < 300 else 0.0)

    states = compare_loops(ahead, model, np.zeros(700), 1e-9, sensor=grow)
    assert (states[300:350] == 1).all()


def test_a_copied_state_goes_on_bit_for_bit_while_a_plan_is_solved() -> None:
    _, model = sep_look_ahead("compensator", v_max=0.08, a_max=8.0, j_max=1000.0, t_init=0.1)
    r = staircase.commanded()[850:]
    plant = load_machine("spring_mass_damper").new_plant()

    def run(first: int, last: int, log: list[bytes] | None = None) -> None:
        for k in range(first, last):
            model["x_d_ahead"], model["x_meas"] = float(r[k]), float(1e-5 * np.sin(k)) + float(r[max(k - 205, 0)])
            model.step(k * TS, TS)
            if log is not None:
                log.append(model.values.tobytes())

    plant.reset(0.0)
    run(0, 302)
    state, values = model.state.copy(), model.values.copy()
    model.check_state(state.tobytes())
    logs: list[list[bytes]] = [[], []]
    run(302, 700, logs[0])
    model.state[:], model.values[:] = state, values
    run(302, 700, logs[1])
    assert logs[0] == logs[1]
    # The block is data alone: a copy at another address is the same state.
    other = CModel("compensator", {"v_max": 0.08, "a_max": 8.0, "j_max": 1000.0, "t_init": 0.1}).initialise()
    other.state[:], other.values[:] = state, values
    model = other
    logs.append([])
    run(302, 700, logs[2])
    assert logs[2] == logs[0]
