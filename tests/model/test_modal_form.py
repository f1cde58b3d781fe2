"""Modal models: eq. (11), frequency response, conversion from and to python-control, ranges."""

import math
from collections.abc import Callable
from typing import Any

import control
import numpy as np
import pytest
from modal_cases import CASES, CRITICAL, LIGHT, OVER, TS, UNDER, transfer_function

from hybridsep.base.errors import ModelError, ParameterError
from hybridsep.model.discrete import DiscreteModel
from hybridsep.model.physics import ModalModel, Mode


def test_spring_mass_damper_is_eq_11() -> None:
    m, c, k = 2.0, 15.7, 24674.0
    model = ModalModel.spring_mass_damper(m, c, k)
    omega = 2 * np.pi * np.array([0.0, 1.0, 20.0, 25.0, 300.0])
    s = 1j * omega
    np.testing.assert_allclose(model.frequency_response(omega), (c * s + k) / (m * s**2 + c * s + k), rtol=1e-13)
    assert model.dc_gain == pytest.approx(1.0, rel=1e-14)
    (mode,) = model.modes
    assert mode.omega**2 == pytest.approx(k / m, rel=1e-14)
    assert 2 * mode.zeta * mode.omega == pytest.approx(c / m, rel=1e-14)
    assert (mode.alpha, mode.beta) == (k / m, c / m)


@pytest.mark.parametrize("model", CASES.values(), ids=CASES.keys())
def test_frequency_response_is_that_of_python_control(model: ModalModel) -> None:
    omega = 2 * np.pi * np.geomspace(0.1, 400.0, 60)
    expected = np.asarray(control.tf(*transfer_function(model)).frequency_response(omega, squeeze=True).complex)
    np.testing.assert_allclose(model.frequency_response(omega), expected, rtol=1e-11)


def test_frequency_response_keeps_its_shape_and_delays() -> None:
    omega = 2 * np.pi * np.array([[1.0, 10.0], [20.0, 200.0]])
    plain = ModalModel([UNDER]).frequency_response(omega)
    late = ModalModel([UNDER], 4).frequency_response(omega, TS)
    np.testing.assert_allclose(late, plain * np.exp(-1j * omega * 4 * TS), rtol=1e-13)
    with pytest.raises(ParameterError, match=r"^T_s is needed: dead_time = 4 is counted in samples$"):
        ModalModel([UNDER], 4).frequency_response(omega)


def assert_same_modes(actual: ModalModel, expected: ModalModel, rtol: float) -> None:
    def key(mode: Mode) -> tuple[float, float]:
        return mode.f_n, mode.zeta

    assert len(actual.modes) == len(expected.modes)
    for here, there in zip(sorted(actual.modes, key=key), sorted(expected.modes, key=key), strict=True):
        assert (here.f_n, here.zeta) == pytest.approx((there.f_n, there.zeta), rel=rtol)
        # The numerator counts by its size at the natural frequency.
        size = abs(complex(there.alpha, there.beta * there.omega))
        assert here.alpha == pytest.approx(there.alpha, rel=0, abs=rtol * size)
        assert here.beta * here.omega == pytest.approx(there.beta * there.omega, rel=0, abs=rtol * size)


@pytest.mark.parametrize(
    ("model", "rtol"),
    [
        (ModalModel([UNDER]), 1e-12),
        (ModalModel([OVER]), 1e-12),
        (ModalModel([CRITICAL]), 1e-9),
        (ModalModel([UNDER, OVER, LIGHT]), 1e-9),
        (ModalModel([Mode(f, 0.02, f, 0.0) for f in (20.0, 20.2, 20.4, 50.0, 51.0, 300.0)]), 1e-7),
        (ModalModel([Mode(f, 0.02, 10.0 * f, 0.1) for f in (3.0, 30.0, 33.0, 400.0)], dead_time=2), 1e-9),
    ],
)
@pytest.mark.parametrize("kind", ["state space", "transfer function"])
def test_round_trip_through_python_control(model: ModalModel, rtol: float, kind: str) -> None:
    A, b, c = model.state_space()
    system = control.ss(A, b[:, None], c[None, :], [[0.0]])
    back = ModalModel.from_control(system if kind == "state space" else control.tf(system), model.dead_time)
    assert back.dead_time == model.dead_time
    assert_same_modes(back, model, rtol)


@pytest.mark.parametrize(
    ("zeros", "poles"),
    [
        ([], [-30.0]),
        ([-5.0], [-200.0, -40.0, -3.0]),
        ([], [-60.0, -40.0, -40.0]),
        ([], [-60.0, -60.0, -40.0]),
        ([-7.0], [-90.0, -50.0, -50.0, -10.0]),
        ([20.0], [-70.0, -10 + 150j, -10 - 150j]),
        ([-100.0, -80.0], [-300.0, -200.0, -90.0, -20 + 100j, -20 - 100j]),
    ],
)
def test_real_poles_in_any_number(zeros: list[float], poles: list[complex]) -> None:
    system = control.tf(1e3 * np.real(np.poly(zeros)), np.real(np.poly(poles)))
    model = ModalModel.from_control(system)
    assert len(model.modes) == (len(poles) + 1) // 2
    omega = 2 * np.pi * np.geomspace(0.05, 200.0, 40)
    np.testing.assert_allclose(model.frequency_response(omega), np.asarray(system(1j * omega)), rtol=1e-6)


UNSTABLE = control.tf([1.0], [1.0, -1.0, 3.0])


REFUSED: list[tuple[Any, str]] = [
    (UNSTABLE, "G_pb must be stable, got a pole at 0.5"),
    (control.tf([1.0], [1.0, 0.0]), "G_pb must be stable, got a pole at 0"),
    (control.tf([2.0], [1.0]), "numerator of degree 0 over a denominator of degree 0"),
    (control.tf([1.0, 0.0, 0.0], [1.0, 1.0, 3.0]), "numerator of degree 2 over a denominator of degree 2"),
    (control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.5]]), "G_pb must be strictly proper"),
    (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "one input and one output, got 2 and 2"),
    (control.tf([1.0], [1.0, 0.5], TS), "G_pb must be continuous, got a discrete system"),
    (control.tf([1.0], np.polymul([1.0, 1.0, 3.0], [1.0, 1.0, 3.0])), "G_pb has repeated modes"),
    *((control.tf([1.0], np.poly([-3.0] * n)), "G_pb has repeated modes") for n in (3, 8)),
    *((control.tf([1.0], np.real(np.poly([-1 + 5j, -1 - 5j] * n))), "G_pb has repeated modes") for n in (3, 8)),
    (control.tf([0.0], [1.0, 1.0]), "G_pb must not be zero, got a zero transfer function"),
    (control.tf([math.nan], [1.0, 1.0]), "must have finite coefficients"),
    (control.ss([[math.nan]], [[1.0]], [[1.0]], [[0.0]]), "must have finite coefficients"),
    (control.frd([1.0, 2.0], [1.0, 2.0]), "must be a TransferFunction or StateSpace, got FrequencyResponseData"),
]


@pytest.mark.parametrize(("system", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_systems_that_are_no_sum_of_modes(system: Any, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        ModalModel.from_control(system)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ModalModel([]), "a modal model needs at least one mode, got none"),
        (lambda: ModalModel([UNDER], -1), "dead_time must be 0 … 100000, got -1"),
        (lambda: Mode(25.0, -0.1, 1.0, 0.0), "zeta must be 1e-06 … 10000, got -0.1"),
        (lambda: ModalModel.spring_mass_damper(1.0, 1.0, -1.0), "k must be 1e-06 … 1e+15 N/m, got -1.0"),
        (
            lambda: ModalModel.spring_mass_damper(1.0, 1.0, 1e-6),
            "m = 1 kg, c = 1 N.s/m, k = 1e-06 N/m give a mode out of range: f_n must be 0.001 … 100000 Hz, "
            "got 0.00015915494309189535",
        ),
        (lambda: ModalModel([UNDER]).discretise(0.0), "T_s must be 1e-05 … 1 s, got 0.0"),
        (lambda: DiscreteModel(ModalModel([UNDER]).state_space(), 0, -1.0), "T_s must be 1e-05 … 1 s, got -1.0"),
        (lambda: ModalModel([UNDER]).discretise(TS, "soh"), "input_hold must be one of zoh, foh, got 'soh'"),
    ],
)
def test_models_out_of_range(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        make()
    assert str(caught.value) == message
