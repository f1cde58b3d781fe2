"""Every parameter out of its range is refused in words that name it, its range and what came."""

import math
import re
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from hybridsep.base import errors
from hybridsep.base.errors import HybridSepError, ParameterError, SignalError
from hybridsep.base.parameters import Parameter
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, Limits, PredictorSettings, check, samples_before
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


NUMBERS = {name: parameter for name, parameter in PARAMETERS.items() if parameter.kind in (int, float)}
OUTSIDE = [(name, value) for name, parameter in NUMBERS.items() for value in outside(parameter)]
INSIDE = [(name, value) for name, parameter in NUMBERS.items() for value in inside(parameter)]


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


@pytest.mark.parametrize("name", ["Np", "T_s"])
@pytest.mark.parametrize("value", ["fast", "100", None, [1.0], True, 10**400, pytest.param(10**5000, id="10**5000")])
def test_not_a_number(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"^{name} must be a number, got "):
        check(name, value)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *((name, value, f"must be finite, got {value!r}") for name in ("Np", "T_s") for value in (math.nan, math.inf)),
        ("Np", 1.5, "must be a whole number, got 1.5"),
        ("seed", 2**31, "must be 0 … 2147483647, got 2147483648"),
        ("period", 1e-10, "must be 0 or 1e-09 … 100 m, got 1e-10"),
        ("input_hold", "second", "must be one of zoh, foh, got 'second'"),
        ("compensate", 2, "must be one of off, physics, hybrid, got 2"),
        ("no_reversal", "no", "must be true or false, got 'no'"),
        ("no_reversal", math.nan, "must be true or false, got nan"),
    ],
)
def test_what_a_parameter_cannot_be(name: str, value: object, message: str) -> None:
    for label in ("", "mode[2].it"):
        with pytest.raises(ParameterError, match=f"^{re.escape(f'{label or name} {message}')}$"):
            check(name, value, label=label or name)


def test_all_problems_at_once() -> None:
    with pytest.raises(ParameterError) as caught:
        PredictorSettings(averaging=False, Np=0, p=0, q=-1, lam=0.0, T_s=-1.0, t_init=-0.5)
    assert [part.split()[0] for part in str(caught.value).split("; ")] == ["Np", "p", "q", "lambda", "T_s", "t_init"]


@pytest.mark.parametrize(("Np", "preview", "spacing", "n_problems"), [
    (50, 61, 2, 0), (50, 60, 2, 1), (50, 200, 3, 1), (50, 200, 100, 2), (1, 8, 1, 0), (75, 98, 5, 0), (75, 97, 5, 1),
])  # fmt: skip
def test_a_preview_that_does_not_fit_a_window_is_refused(Np: int, preview: int, spacing: int, n_problems: int) -> None:
    settings = CompensatorSettings(preview=preview, spacing=spacing, horizon=preview)
    predictor = HybridPredictor(
        ModalModel.spring_mass_damper(1.0, 15.7, 24674.0), PredictorSettings(averaging=False, Np=Np, p=1, q=0)
    )
    if not n_problems:
        assert SepCompensator(predictor, settings).settings == settings
        return
    with pytest.raises(ParameterError) as caught:
        SepCompensator(predictor, settings)
    assert len(str(caught.value).split("; ")) == n_problems


@pytest.mark.parametrize(("Np", "preview", "spacing", "given", "horizon"), [
    (20, 60, None, None, 240), (20, 60, 2, None, 240), (20, 60, 2, 100, 100), (20, 60, 2, 0, 60), (20, 42, 2, None, 42),
    (20, 43, 2, None, 240), (20, 400, None, None, 400), (20, None, None, None, 345),
])  # fmt: skip
def test_a_plan_goes_on_behind_a_preview_that_is_shorter_than_the_drive_needs(
    Np: int, preview: int | None, spacing: int | None, given: int | None, horizon: int
) -> None:
    # at most 120 spacings, and only where a stop fits into the preview: 20 + 10 + 5·2 + 3 = 43
    settings = CompensatorSettings(preview=preview, spacing=spacing, horizon=given).for_window(Np, 345, 1e-3)
    assert settings.horizon == horizon


def test_a_plan_is_longer_where_the_limits_are_slow_to_take_the_error_back() -> None:
    given = [CompensatorSettings(limits=Limits(1.0, 10.0, jerk), change_max=0.04) for jerk in (1e3, 100.0, 1.0)]
    assert [one.for_window(20, 200, 1e-3).horizon for one in given] == [200, 386, 400]


@pytest.mark.parametrize(("t_init", "T_s", "count"), [
    (0.0, 1e-3, 0), (0.3, 1e-3, 300), (0.3, 1e-4, 3000), (0.29995, 1e-3, 300), (1.24205, 1e-3, 1243),
    (0.1 + 0.2, 0.1, 3), (4e-3 * (1 - 1e-12), 1e-3, 4), (1e-8, 1e-3, 1),  # (0.1 + 0.2) / 0.1 is just over three
])  # fmt: skip
def test_warm_up_is_counted_in_samples(t_init: float, T_s: float, count: int) -> None:
    assert samples_before(t_init, T_s) == count


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0, math.nan], "x must be finite, got nan at sample 1"),
        ([[1.0, 2.0]], "x must be one-dimensional, got shape (1, 2)"),
        ([1.0], "x must have 2 samples, got 1"),
        (["a", "b"], "x must be numbers, got <U1"),
    ],
)
def test_samples_that_cannot_be_used(values: Any, message: str) -> None:
    with pytest.raises(SignalError) as caught:
        as_samples(values, "x", 2)
    assert str(caught.value) == message
    taken = np.arange(4.0)
    assert as_samples(taken, "x") is taken
    assert as_samples(taken[::2], "x").flags.c_contiguous


def test_every_error_is_of_this_library() -> None:
    found = [value for name, value in vars(errors).items() if name.endswith("Error")]
    assert len(found) > 6
    assert all(issubclass(error, HybridSepError) for error in found)


def test_settings_and_an_fmus_values_are_the_same() -> None:
    predictor = PredictorSettings(averaging=False, Np=60, p=7, q=2, lam=1e-9, T_s=2e-3, t_init=0.0, input_hold="foh")
    limits = Limits(0.2, 3.0, 40.0)
    compensator = CompensatorSettings(
        preview=90, spacing=3, limits=limits, no_reversal=False, compensate="physics", horizon=120
    )
    values = {**predictor.to_fmi(), **compensator.to_fmi()}
    assert values.keys() == {*PredictorSettings.fmi_parameters(), *CompensatorSettings.fmi_parameters()}
    assert (values["input_hold"], values["compensate"], values["v_max"]) == (1, 1, 0.2)
    assert PredictorSettings.from_fmi(values) == predictor
    assert CompensatorSettings.from_fmi(values) == compensator
    assert PredictorSettings.from_table(asdict(predictor)) == predictor
    assert CompensatorSettings.from_table(asdict(compensator)) == compensator
    said = r"^v_max must be 1e-09 … 10000 m/s, got 0; compensate must be 0 … 2, got 3$"
    with pytest.raises(ParameterError, match=said):
        CompensatorSettings.from_fmi({**values, "compensate": 3, "v_max": 0})


def test_a_table_of_settings_has_all_of_them_and_nothing_else() -> None:
    table = asdict(PredictorSettings(averaging=False))
    for wrong in ({**table, "more": 1}, {name: value for name, value in table.items() if name != "q"}):
        with pytest.raises(ParameterError, match=f"settings must be {', '.join(table)}, got"):
            PredictorSettings.from_table(wrong)
