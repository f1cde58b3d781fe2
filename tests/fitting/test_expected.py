"""What a compensator is expected to leave on a recorded command, by its FMU or, where none runs, by the library."""

from dataclasses import replace

import numpy as np
import pytest
from identification_cases import T_S

from hybridsep import ModalModel, Mode, rest_to_rest
from hybridsep.base.settings import Limits
from hybridsep.fitting import expected
from hybridsep.fitting.expected import Trial
from hybridsep.fmi.compile import libraries
from hybridsep.identify.model import machine_of

SERVO = ModalModel([Mode(12.0, 0.8, (24 * np.pi) ** 2)])
MOVES = rest_to_rest([0.0, 0.01, -0.008], Limits(0.1, 1.0, 50.0), T_S, start_times=[0.3, 0.7], duration=1.2)
LIMITS = {"velocity": 0.3, "acceleration": 3.0, "jerk": 500.0, "change_max": 0.02}
MACHINE = machine_of(
    SERVO, "zoh", T_S, "axis", "Axis", unit="m", sources=["drawn"], predictor={"Np": 50}, drive_limits=LIMITS
)


@pytest.mark.parametrize(
    ("late", "compensate", "apart"), [(0, "hybrid", 1e-10), (3, "hybrid", 1e-11), (0, "physics", 1e-11)]
)
def test_fmu_and_library_leave_the_same(
    late: int, compensate: str, apart: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a command 2 mm from zero, measured with friction and an offset, samples missing."""
    # Plans are longer than the preview, in which rounding may grow further: to 3e-11 m in one
    friction = 1e-5 * np.tanh(np.gradient(MOVES) / T_S / 1e-3)
    discrete = SERVO.discretise(T_S)
    x = discrete.forced_response(discrete.rest(), MOVES)[0] - friction + 0.00201
    x[:2] = x[500:520] = np.nan
    late_x = np.concatenate((np.full(late, 0.00201), x))[: len(x)]
    settings = replace(MACHINE.compensator_settings, compensate=compensate)
    given = replace(MACHINE.compensator_predictor, measurement_delay=late), settings, [(MOVES + 0.002, late_x)]
    libraries("SepCompensator", ["host"])  # compiled, where they are not yet
    with Trial.of(MACHINE) as trial:
        assert trial.fmu is not None
        (by_fmu,) = trial.expected(*given)
    monkeypatch.setattr(expected, "kept", lambda library: None)
    with Trial.of(MACHINE) as trial:
        assert trial.fmu is None
        (by_library,) = trial.expected(*given)
    np.testing.assert_allclose(by_fmu, by_library, rtol=0.0, atol=apart)
    assert np.nanmax(np.abs(by_fmu.compensated[600:])) < 0.3 * np.nanmax(np.abs(by_fmu.without[600:]))


def test_a_command_that_ends_in_motion_is_followed_to_its_end() -> None:
    x_d = MOVES[:450]
    discrete, physics = SERVO.discretise(T_S), replace(MACHINE.compensator_settings, compensate="physics")
    x = discrete.forced_response(discrete.rest(), x_d)[0]
    (found,) = Trial(MACHINE).expected(MACHINE.compensator_predictor, physics, [(x_d, x)])
    assert abs(found.without[-1]) > 5e-4
    assert np.abs(found.compensated[350:]).max() < 0.01 * abs(found.without[-1])
