"""Arrays of an FMI 3.0 HybridPredictor: their size, a structural parameter, and directional derivatives of x_h."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from ctypes import c_double, c_uint
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from built_once import BuiltFmus
from fmi_library import ERROR, OK, Library, Library3, library_of, steps

from hybridsep.base.errors import FmuError
from hybridsep.cosim.fmu import FmuInstance

WINDOWS = ("x_d_window", "x_pb_window", "x_h_window", "x_h_std_window")


@pytest.fixture(scope="module")
def fmu(folders: Callable[[str], Path]) -> Library:
    return library_of(folders("HybridPredictorFmi3"))


def resize(fmu: Library, instance: int | None, Np: int) -> None:
    assert fmu.EnterConfigurationMode(instance) == fmu.set(instance, "Np", Np) == OK
    assert fmu.ExitConfigurationMode(instance) == OK
    fmu.sizes |= dict.fromkeys(WINDOWS, Np)


@pytest.mark.parametrize("Np", [60, 100, 230])
def test_arrays_have_the_size_that_was_configured(fmu: Library, Np: int) -> None:
    instance = fmu.instantiate()
    resize(fmu, instance, Np)
    assert [fmu.get(instance, name) for name in ("Np", "x_h_window")] == [Np, [0.0] * Np]
    assert fmu.begin(instance) == fmu.ExitInitializationMode(instance) == OK
    steps(fmu, instance, 0, 3 * Np)
    shown = []
    windows = [fmu.get(instance, name) for name in WINDOWS]
    for k in range(3 * Np, 4 * Np):
        shown.append([fmu.get(instance, name.removesuffix("_window")) for name in WINDOWS])
        steps(fmu, instance, k, k + 1)
    np.testing.assert_array_equal(np.transpose(shown), windows)
    assert len(np.unique(windows[2])) == Np
    state = fmu.save(instance)
    assert fmu.Reset(instance) == OK
    fmu.sizes |= dict.fromkeys(WINDOWS, 100)
    assert [fmu.get(instance, name) for name in ("Np", "x_h_window")] == [100, [0.0] * 100]
    assert fmu.restore(instance, state) == (OK if Np == 100 else ERROR)
    if Np != 100:
        assert "its Np is another one" in fmu.messages[-1][2] or "a state has at least" in fmu.messages[-1][2]
        resize(fmu, instance, Np)
        assert fmu.restore(instance, state) == OK
    assert fmu.save(instance) == state
    fmu.FreeInstance(instance)


def test_what_configuration_mode_refuses(fmu: Library) -> None:
    instance = fmu.instantiate()
    for Np in (0, 100_001, 2**64 - 1):
        assert fmu.set(instance, "Np", Np) == ERROR
        assert "fmi3SetUInt64: Np must be 1 … 100000, got" in fmu.messages[-1][2]
    assert fmu.EnterConfigurationMode(instance) == OK
    for name, arguments in (
        ("EnterConfigurationMode", ()),
        ("EnterInitializationMode", Library3.initialization),
        *((f"{verb}Float64", (None, 0, None, 0)) for verb in ("Get", "Set")),
        ("GetFMUState", (None,)),
    ):
        assert getattr(fmu, name)(instance, *arguments) == ERROR
        assert f"fmi3{name} is not allowed in the state Configuration Mode; it is" in fmu.messages[-1][2]
    assert fmu.Reset(instance) == OK
    assert fmu.get(instance, "Np") == 100
    assert fmu.begin(instance) == OK
    assert fmu.set(instance, "Np", 50) == ERROR
    assert "not allowed in the state Initialization Mode; it is allowed in: instantiated, Conf" in fmu.messages[-1][2]
    fmu.FreeInstance(instance)


def test_without_arrays_there_is_neither(folders: Callable[[str], Path]) -> None:
    fmu = library_of(folders("SepCompensatorFmi3"))
    instance = fmu.instantiate()
    assert fmu.EnterConfigurationMode(instance) == ERROR
    assert "there is no structural parameter in modelDescription.xml" in fmu.messages[-1][2]
    with pytest.raises(RuntimeError, match="providesDirectionalDerivatives is false in modelDescription"):
        derivative(fmu, instance, ["x_h"], ["x_d_ahead"], [1.0])
    fmu.FreeInstance(instance)


def test_importers_size_them(fmus: BuiltFmus) -> None:
    """By fmpy, which knows no Configuration Mode; what it records has the size as built."""
    path = fmus("HybridPredictorFmi3")
    small = {"Np": 60, "p": 20}
    assert len(fmpy.simulate_fmu(str(path), start_values=small, stop_time=0.1, output=["x_h"])) > 1
    with FmuInstance(path) as instance:
        instance.initialise(small)
        assert len(instance.get("x_h_window")) == len(instance.reader(["x_h_window"])()) == 60
        instance.reset()
        assert instance.get("Np") == len(instance.get("x_h_window")) == 100
        with pytest.raises(FmuError, match="Np must be a whole number"):
            instance.set("Np", 60.0)


# Directional derivatives -------------------------------------------------------------------------------------------


def derivative(fmu: Library, instance: int | None, of: Sequence[str], by: Sequence[str], seed: Sequence[float]) -> Any:
    """Return the derivatives; raise RuntimeError if they are refused."""
    n = sum(fmu.sizes[name] for name in of)
    unknowns, knowns = ((c_uint * len(names))(*(fmu.references[name] for name in names)) for names in (of, by))
    found, given = (c_double * n)(), (c_double * len(seed))(*seed)
    if fmu.GetDirectionalDerivative(instance, unknowns, len(of), knowns, len(by), given, len(seed), found, n) != OK:
        raise RuntimeError(fmu.messages[-1][2])
    return np.array(found)


@pytest.mark.parametrize("more", [{}, {"input_hold": 1, "dead_time": 7}, {"measurement_delay": 4}, {"t_init": 0.05}])
def test_the_derivative_by_the_commands_is_the_difference(fmu: Library, more: dict[str, Any]) -> None:
    """Of the paper's model, to rounding, as it is linear."""
    values, Np, now = {"averaging": 0, "p": 9, "q": 3, "t_init": 0.0} | more, 40, 133
    step = np.random.default_rng(3).standard_normal(Np)
    shown = []
    for change in (0.0, 1e-3):
        instance = fmu.instantiate()
        resize(fmu, instance, Np)
        assert fmu.begin(instance) == OK
        assert all(fmu.set(instance, name, value) == OK for name, value in values.items())
        assert fmu.ExitInitializationMode(instance) == OK
        for k in range(now):
            command = 1e-3 * math.sin(0.02 * k) + change * (step[k - 80] if 80 <= k < 120 else 0.0)
            assert fmu.set(instance, "x_d_ahead", command) == OK
            assert fmu.set(instance, "x_meas", 1e-3 * math.sin(0.02 * k - 0.9) + 1e-5 * math.cos(0.3 * k)) == OK
            assert fmu.do_step(instance, k * 1e-3, 1e-3) == OK
        shown.append(np.array([fmu.get(instance, "x_h"), *fmu.get(instance, "x_h_window")]))
        found = derivative(fmu, instance, ["x_h", "x_h_window"], ["x_meas", "x_d_window"], [1.0, *step])
        assert found[0] == found[1 + now % Np]
        fmu.FreeInstance(instance)
    assert np.abs(found[1:]).max() > 0.1
    np.testing.assert_allclose(found, (shown[1] - shown[0]) / 1e-3, rtol=0, atol=1e-10)


def test_no_output_follows_an_input_at_once_but_where_it_begins(fmu: Library) -> None:
    instance = fmu.instantiate()
    resize(fmu, instance, 20)
    outputs = [name for name, what in fmu.causalities.items() if what == "output" and fmu.kinds[name] == "Float64"]
    assert fmu.begin(instance) == fmu.set(instance, "x_d_ahead", 0.3) == OK
    found = derivative(fmu, instance, outputs, ["x_meas", "x_d_ahead"], [7.0, 2.0])
    begins = ("x_d", "x_pb", "x_h", "x_d_window", "x_pb_window", "x_h_window")
    assert found.tolist() == [2.0 * (name in begins) for name in outputs for _ in range(fmu.sizes[name])]
    assert fmu.get(instance, "x_h") == 0.3
    assert fmu.set(instance, "p", 9) == OK
    assert fmu.ExitInitializationMode(instance) == OK
    steps(fmu, instance, 0, 70)
    assert not derivative(fmu, instance, outputs, ["x_meas", "x_d_ahead"], [7.0, 2.0]).any()
    fmu.FreeInstance(instance)


@pytest.mark.parametrize(
    ("of", "by", "n", "said"),
    [
        (["x_h"], ["x_d_window"], 20, "x_h is linear in x_d_window with averaging = false alone, got averaging = true"),
        (["x_pb"], ["x_d_window"], 20, "unknowns must be x_h or x_h_window where x_d_window is known, got x_pb"),
        (["x_meas"], ["x_d_ahead"], 1, "unknowns must be outputs, got x_meas"),
        (["time"], ["x_d_ahead"], 1, "unknowns must be outputs, got time"),
        (["x_h"], ["x_h"], 1, "knowns must be inputs or, in Step Mode, x_d_window, got x_h"),
        (["x_h"], ["x_d_window"], 19, "knowns: nValues must be 20, the number of values of all variables, got 19"),
        (["batch"], ["x_d_ahead"], 1, "unknowns: batch .* is of type Int32, not Float64"),
    ],
)
def test_derivatives_that_there_are_not(fmu: Library, of: list[str], by: list[str], n: int, said: str) -> None:
    instance = fmu.instantiate()
    resize(fmu, instance, 20)
    assert fmu.begin(instance) == fmu.set(instance, "p", 9) == fmu.ExitInitializationMode(instance) == OK
    with pytest.raises(RuntimeError, match=f"^fmi3GetDirectionalDerivative: {said}"):
        derivative(fmu, instance, of, by, [1.0] * n)
    fmu.FreeInstance(instance)
