"""Every parameter out of its range is refused in words that name it, its range and what came."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hybridsep.base.errors import HybridSepError, ParameterError, SignalError
from hybridsep.base.parameters import (
    PARAMETERS,
    Parameter,
    check,
    check_lags,
    check_preview,
    check_together,
    samples_before,
)
from hybridsep.base.settings import CompensatorSettings, PredictorSettings
from hybridsep.base.signals import as_samples
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.model.physics import ModalModel
from hybridsep.predict.predictor import HybridPredictor

GOOD: dict[str, Any] = {"Np": 100, "p": 50, "q": 3, "lam": 1e-12, "T_s": 1e-3, "t_init": 0.3}


def outside(parameter: Parameter) -> list[float]:
    """Return values next to each bound, on the wrong side."""
    if parameter.kind is int:
        return [parameter.minimum - 1, parameter.maximum + 1]
    values = [math.nextafter(parameter.minimum, -math.inf), math.nextafter(parameter.maximum, math.inf)]
    return values + ([math.nextafter(parameter.nonzero, 0.0), 5e-324] if parameter.nonzero else [])


def inside(parameter: Parameter) -> list[float]:
    """Return the bounds themselves and the default."""
    bounds = (parameter.minimum, parameter.maximum, parameter.nonzero or None, parameter.default)
    return [bound for bound in bounds if bound is not None]


OUTSIDE = [(name, value) for name, parameter in PARAMETERS.items() for value in outside(parameter)]
INSIDE = [(name, value) for name, parameter in PARAMETERS.items() for value in inside(parameter)]


@pytest.mark.parametrize(("name", "value"), OUTSIDE)
def test_out_of_range_names_parameter_range_and_value(name: str, value: float) -> None:
    with pytest.raises(ParameterError) as caught:
        check(name, value)
    message = str(caught.value)
    assert message.startswith(f"{name} must be {PARAMETERS[name].range_text}")
    assert message.endswith(f"got {value!r}")
    assert PARAMETERS[name].unit == "1" or f" {PARAMETERS[name].unit}, got" in message


@pytest.mark.parametrize(("name", "value"), INSIDE)
def test_the_bounds_belong_to_the_range(name: str, value: float) -> None:
    answer = check(name, value)
    assert answer == value
    assert type(answer) is PARAMETERS[name].kind


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_not_finite(name: str, value: float) -> None:
    with pytest.raises(ParameterError, match=f"^{name} must be finite, got {value!r}$"):
        check(name, value)


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("value", ["fast", "100", None, [1.0], True, 10**400, pytest.param(10**5000, id="10**5000")])
def test_not_a_number(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"^{name} must be a number, got "):
        check(name, value)


@pytest.mark.parametrize("value", [1.5, -0.25])
@pytest.mark.parametrize("name", [name for name, parameter in PARAMETERS.items() if parameter.kind is int])
def test_not_a_whole_number(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"^{name} must be a whole number, got {value!r}$"):
        check(name, value)


def test_the_message_can_say_which_mode() -> None:
    with pytest.raises(ParameterError, match=r"^mode\[2\]\.zeta must be 1e-06 … 10000, got 0$"):
        check("zeta", 0, label="mode[2].zeta")


def test_the_largest_seed_is_in_its_message() -> None:
    with pytest.raises(ParameterError, match=r"^seed must be 0 … 2147483647, got 2147483648$"):
        check("seed", 2**31)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("lambda", "ridge penalty on the weights [m2], 1e-40 … 1e+12"),
        ("p", "past residuals e_pb in the features, 1 … 5000"),
        ("alpha", "numerator of the mode, constant term [1/s2], -1e+15 … 1e+15"),
        ("k_nl", "quadratic stiffness, force k_nl·x·|x| [N/m2], 0 … 1e+15"),
        ("jerk_weight", "weight of the change's jerk against the tracking error, 0 … 1e+12"),
        ("no_reversal", "1: x_dm never turns while the commanded position moves, 0 … 1"),
    ],
)
def test_help(name: str, text: str) -> None:
    assert PARAMETERS[name].help == text


def test_a_range_in_which_0_stands_apart() -> None:
    assert PARAMETERS["v_friction"].range_text == "0 or 1e-09 … 10000"


def test_lags_fit() -> None:
    check_together(**GOOD)
    check_together(**{**GOOD, "Np": 1, "p": 1, "q": 0})
    check_together(**{**GOOD, "Np": 100, "p": np.int64(100), "q": 99.0})


def test_lower_p_or_raise_np() -> None:
    with pytest.raises(ParameterError) as caught:
        check_together(**{**GOOD, "p": 120})
    assert str(caught.value) == "p must be 1 … Np = 100, got 120; lower p or raise Np"


def test_lower_q_or_raise_np() -> None:
    with pytest.raises(ParameterError) as caught:
        check_together(**{**GOOD, "q": 100})
    assert str(caught.value) == "q must be 0 … Np − 1 = 99, got 100; lower q or raise Np"


def test_all_problems_at_once() -> None:
    with pytest.raises(ParameterError) as caught:
        check_together(Np=0, p=0, q=-1, lam=0.0, T_s=-1.0, t_init=-0.5)
    assert [part.split()[0] for part in str(caught.value).split("; ")] == ["Np", "p", "q", "lambda", "T_s", "t_init"]


def test_both_lags_at_once() -> None:
    assert len(check_lags(Np=4, p=5, q=4)) == 2
    with pytest.raises(ParameterError, match=r"p must be 1 … Np = 4, got 5; .*; q must be 0 … Np − 1 = 3, got 4"):
        check_together(**{**GOOD, "Np": 4, "p": 5, "q": 4})


@pytest.mark.parametrize(("Np", "preview", "spacing", "n_problems"), [
    (50, 61, 2, 0), (50, 60, 2, 1), (50, 200, 3, 1), (50, 200, 100, 2), (1, 8, 1, 0), (75, 98, 5, 0), (75, 97, 5, 1),
])  # fmt: skip
def test_a_preview_is_refused_as_the_compensator_refuses_it(
    Np: int, preview: int, spacing: int, n_problems: int
) -> None:
    problems = check_preview(Np=Np, preview=preview, spacing=spacing)
    assert len(problems) == n_problems
    predictor = HybridPredictor(ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), PredictorSettings(Np=Np, p=1, q=0))
    if not problems:
        SepCompensator(predictor, CompensatorSettings(preview=preview, spacing=spacing))
        return
    with pytest.raises(ParameterError) as caught:
        SepCompensator(predictor, CompensatorSettings(preview=preview, spacing=spacing))
    assert str(caught.value) == "; ".join(problems)


@pytest.mark.parametrize(
    ("t_init", "T_s", "count"),
    [
        (0.0, 1e-3, 0),
        (0.3, 1e-3, 300),
        (0.3, 1e-4, 3000),
        (0.29995, 1e-3, 300),
        (1.24205, 1e-3, 1243),
        (0.1 + 0.2, 0.1, 3),  # 0.30000000000000004 / 0.1 is just over three
        (4e-3 * (1 - 1e-12), 1e-3, 4),
        (1e-8, 1e-3, 1),
    ],
)
def test_warm_up_is_counted_in_samples(t_init: float, T_s: float, count: int) -> None:
    assert samples_before(t_init, T_s) == count


def test_samples_are_taken_as_they_are() -> None:
    values = np.arange(4.0)
    assert as_samples(values, "x") is values
    np.testing.assert_array_equal(as_samples([1, 2], "x"), [1.0, 2.0])
    strided = as_samples(values[::2], "x")
    assert strided.flags.c_contiguous
    np.testing.assert_array_equal(strided, [0.0, 2.0])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0, math.nan], "x must be finite, got nan at sample 1"),
        ([math.inf, 1.0], "x must be finite, got inf at sample 0"),
        ([[1.0, 2.0]], "x must be one-dimensional, got shape (1, 2)"),
        ([1.0], "x must have 2 samples, got 1"),
        (["a", "b"], "x must be numbers, got <U1"),
    ],
)
def test_samples_that_cannot_be_used(values: Any, message: str) -> None:
    with pytest.raises(SignalError) as caught:
        as_samples(values, "x", 2)
    assert str(caught.value) == message


def test_every_error_is_of_this_library() -> None:
    for error in (ParameterError, SignalError):
        assert issubclass(error, HybridSepError)
        assert issubclass(error, ValueError)
