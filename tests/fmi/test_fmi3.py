"""FMUs of FMI 3.0: arrays, Configuration Mode, and the same values as FMI 2.0."""

from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from built_once import BuiltFmus
from fmi_library import ERROR, OK, Library, Library3, library_of, steps
from stream import WINDOWS

from hybridsep.base.errors import FmuError
from hybridsep.cosim.fmu import FmuInstance


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
        fmu.refused(fmu.set(instance, "Np", Np), "fmi3SetUInt64: Np must be 1 … 100000, got")
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
    fmu.refused(fmu.EnterConfigurationMode(instance), "there is no structural parameter in modelDescription.xml")
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


def test_a_state_of_the_twin_is_refused(fmus: BuiltFmus) -> None:
    """Both compute the same: suite/test_rollback.py, test_reference.py."""
    with FmuInstance(fmus("HybridPredictorFmi3")) as new, FmuInstance(fmus("HybridPredictor")) as old:
        new.initialise()
        with pytest.raises(FmuError, match="another FMU: the GUID differs"):
            old.restore(new.save())
