"""Observer of the position from an accelerometer and a slow reference."""

from __future__ import annotations

import numpy as np
import pytest
from identification_cases import moves

from hybridsep import ModalModel, Mode
from hybridsep.base.errors import ParameterError
from hybridsep.base.signals import Array
from hybridsep.identify.position_observer import PositionObserver, observe_position

T_S = 1e-3
LOAD = ModalModel([Mode(20.0, 0.03, (40 * np.pi) ** 2)])


def vibrating() -> tuple[Array, Array, Array]:
    """Return position and acceleration of a load on a spring, and the position of the motor that moves it."""
    motor = moves(4000)
    discrete = LOAD.discretise(T_S, "foh")
    load = discrete.forced_response(discrete.rest(), motor)[0]
    omega, zeta = 40 * np.pi, 0.03
    velocity = np.gradient(load, T_S)
    acceleration = omega**2 * (motor - load) - 2 * zeta * omega * velocity
    return load, acceleration, motor


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_vibration_is_seen_with_offset_and_noise() -> None:
    load, acceleration, motor = vibrating()
    rng = np.random.default_rng(0)
    sensed = acceleration + 0.2 + 0.02 * rng.standard_normal(len(load))
    observed = observe_position(sensed, motor, T_S)
    assert rms((observed - load)[1000:]) < 0.2 * rms((motor - load)[1000:])


def test_the_offset_is_estimated() -> None:
    _, acceleration, motor = vibrating()
    observer = PositionObserver(T_S, 2.0)
    for pair in zip(acceleration + 0.2, motor, strict=True):
        observer.step(*pair)
    assert observer.bias == pytest.approx(0.2, abs=0.05)


def test_exact_for_a_constant_acceleration() -> None:
    t = np.arange(500) * 1e-2
    observed = observe_position(np.full(500, 0.3), 0.15 * t**2 + 0.1, 1e-2, crossover=0.5)
    np.testing.assert_allclose(observed[200:], (0.15 * t**2 + 0.1)[200:], atol=2e-3)
    assert observed[0] == 0.1


def test_a_slow_crossover_needs_a_sampled_signal() -> None:
    with pytest.raises(ParameterError, match="at most 100 Hz, got 200"):
        PositionObserver(T_S, 200)
    with pytest.raises(ParameterError, match="3 finite numbers"):
        observe_position([1.0], [0.0, 1.0, 2.0], T_S)
