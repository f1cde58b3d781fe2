"""Variables, parameters and steps of a native FMU through its FMI 2.0 functions, with the calls that are refused."""

from __future__ import annotations

import math
import re
from ctypes import byref, c_char_p, c_double, c_int, c_uint

import pytest
from fmi2_driving import component_in, steps
from fmi2_library import DISCARD, ERROR, OK, Library


def test_wrong_references_types_and_times_are_refused_by_name(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    n = len(fmu.references)
    value = c_double(1.0)
    cases = [
        (fmu.GetReal(component, byref(c_uint(n)), 1, byref(value)), f"value reference must be 0 ... {n - 1}, got {n}"),
        (fmu.GetReal(component, None, 1, byref(value)), "fmi2GetReal: vr is NULL, but nvr is 1"),
        (fmu.SetReal(component, byref(c_uint(0)), 1, None), "fmi2SetReal: value is NULL, but nvr is 1"),
        (fmu.GetInteger(component, byref(c_uint(0)), 1, byref(c_int())), "x_d_ahead .* is of type Real, not Integer"),
        (fmu.GetString(component, byref(c_uint(0)), 1, byref(c_char_p())), "x_d_ahead .* is of type Real, not String"),
        (fmu.set(component, "x_h", 1.0), "x_h is an output and cannot be set"),
        (fmu.set(component, "x_h_window[3]", 1.0), r"x_h_window\[3\] is a local variable and cannot be set"),
        (fmu.set(component, "hybrid_active", 1), "hybrid_active is an output and cannot be set"),
        (fmu.set(component, "Np", 10), "Np is a fixed parameter and cannot be set after the initialization"),
        (fmu.set(component, "mode[1].zeta", 0.1), r"mode\[1\].zeta is a fixed parameter"),
    ]
    assert [status for status, _ in cases] == [ERROR] * len(cases)
    for (_, expected), (_, category, message) in zip(cases, fmu.messages, strict=True):
        assert re.search(expected, message)
        assert category == "logStatusError"
    fmu.FreeInstance(component)


def test_a_refused_call_sets_nothing(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    references = (c_uint * 2)(fmu.references["x_meas"], fmu.references["x_h"])
    assert fmu.SetReal(component, references, 2, (c_double * 2)(7.0, 7.0)) == ERROR
    assert fmu.get(component, "x_meas") == 0.0
    fmu.FreeInstance(component)


def test_bad_parameters_are_named_and_can_be_corrected(fmu: Library) -> None:
    component = component_in(fmu, "Initialization Mode")
    fmu.set(component, "p", 120)
    fmu.set(component, "lambda", 0.0)
    assert fmu.ExitInitializationMode(component) == ERROR
    assert "lambda must be 1e-40 … 1e+12 m2, got 0" in fmu.messages[-1][2]
    fmu.set(component, "lambda", 1e-12)
    assert fmu.ExitInitializationMode(component) == ERROR
    assert re.search(r"p must be 1 (…|\.\.\.) Np = 100, got 120", fmu.messages[-1][2])
    fmu.set(component, "p", 50)
    assert fmu.ExitInitializationMode(component) == OK
    fmu.FreeInstance(component)


def test_a_bad_experiment_is_refused(fmu: Library) -> None:
    component = component_in(fmu, "instantiated")
    assert fmu.SetupExperiment(component, 0, 0.0, math.nan, 0, 0.0) == ERROR
    assert "startTime must be finite" in fmu.messages[-1][2]
    assert fmu.SetupExperiment(component, 0, 0.0, 1.0, 1, 0.5) == ERROR
    assert "stopTime must be >= startTime = 1 s, got 0.5 s" in fmu.messages[-1][2]
    fmu.FreeInstance(component)


def test_status_functions(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    steps(fmu, component, 0, 3)
    time, ended = c_double(), c_int(7)
    assert fmu.GetRealStatus(component, 2, byref(time)) == OK
    assert time.value == pytest.approx(3e-3)
    assert fmu.GetBooleanStatus(component, 3, byref(ended)) == OK
    assert ended.value == 0
    for name, value in (("", c_int()), ("Integer", c_int()), ("Real", c_double()), ("String", c_char_p())):
        assert getattr(fmu, f"Get{name}Status")(component, 1, byref(value)) == DISCARD
        assert f"fmi2Get{name}Status" in fmu.messages[-1][2]
        assert getattr(fmu, f"Get{name}Status")(component, 1, None) == ERROR
        assert "value is NULL" in fmu.messages[-1][2]
    fmu.FreeInstance(component)


def test_steps_take_no_memory_and_reset_gives_it_back(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    outputs = []
    for _ in range(5):
        allocations, blocks = fmu.allocations, len(fmu.blocks)
        steps(fmu, component, 0, 420)
        assert (fmu.allocations, len(fmu.blocks)) == (allocations, blocks)
        outputs.append(fmu.reals(component))
        assert fmu.Reset(component) == OK
        assert fmu.get(component, "x_h") == 0.0
        assert fmu.EnterInitializationMode(component) == OK
        assert fmu.ExitInitializationMode(component) == OK
        assert len(fmu.blocks) == blocks
    assert len(set(outputs)) == 1
    fmu.FreeInstance(component)
