"""The FMI 2.0 functions of a native FMU, called one by one: legal call sequences, instantiation, logging."""

from __future__ import annotations

import ctypes
import itertools
import math
import re
from ctypes import byref, c_char_p, c_double, c_int, c_uint

import pytest
from fmi2_driving import STATES, component_in, steps
from fmi2_library import ERROR, OK, Allocate, Callbacks, Library, Logger

ALWAYS, SETTABLE, RUN = set(STATES), set(STATES[:3]), {"stepping", "terminated"}
LEGAL = {
    "SetDebugLogging": ALWAYS,
    "SetupExperiment": {"instantiated"},
    "EnterInitializationMode": {"instantiated"},
    "ExitInitializationMode": {"Initialization Mode"},
    "Terminate": {"stepping"},
    "Reset": ALWAYS,
    "GetReal": ALWAYS,
    "GetInteger": ALWAYS,
    "GetBoolean": ALWAYS,
    "GetString": ALWAYS,
    "SetReal": SETTABLE,
    "SetInteger": SETTABLE,
    "SetBoolean": SETTABLE,
    "SetString": SETTABLE,
    "DoStep": {"stepping"},
    "GetRealStatus": RUN,
    "GetBooleanStatus": RUN,
}


ARGUMENTS = {
    "SetDebugLogging": (1, 0, None),
    "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
    "DoStep": (0.0, 1e-3, 1),
    "GetRealStatus": (2, byref(c_double())),
    "GetBooleanStatus": (3, byref(c_int())),
    **{
        f"{verb}{kind}": (None, 0, None) for verb in ("Get", "Set") for kind in ("Real", "Integer", "Boolean", "String")
    },
}


@pytest.mark.parametrize(("name", "state"), list(itertools.product(LEGAL, STATES)))
def test_the_table_of_legal_calls(fmu: Library, name: str, state: str) -> None:
    component = component_in(fmu, state)
    before = fmu.reals(component)
    status = getattr(fmu, name)(component, *ARGUMENTS.get(name, ()))
    if state in LEGAL[name]:
        assert status == OK
    else:
        assert status == ERROR
        assert re.match(rf"fmi2{name} is not allowed in the state {state}.*; it is allowed in: ", fmu.messages[-1][2])
        assert fmu.reals(component) == before
    fmu.FreeInstance(component)


def test_what_is_not_supported_is_refused_by_name(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    assert fmu.GetRealOutputDerivatives(component, None, 0, None, None) == ERROR
    assert "maxOutputDerivativeOrder is 0" in fmu.messages[-1][2]
    assert fmu.GetDirectionalDerivative(component, None, 0, None, 0, None, None) == ERROR
    assert "providesDirectionalDerivative is false" in fmu.messages[-1][2]
    assert fmu.CancelStep(component) == ERROR
    assert "fmi2CancelStep is not allowed" in fmu.messages[-1][2]
    fmu.FreeInstance(component)


@pytest.mark.parametrize(
    ("names", "orders", "values", "message"),
    [
        (["x_d_ahead", "x_h"], [1, 1], [1.0, 1.0], "x_h takes no derivative, only inputs do"),
        (["x_d_ahead", "p"], [1, 1], [1.0, 1.0], "p (value reference {p}) is of type Integer, not Real"),
        (["x_d_ahead", "x_meas"], [1, 2], [1.0, 1.0], "the order of x_meas must be 1, got 2"),
        (["x_d_ahead", "x_meas"], [0, 1], [1.0, 1.0], "the order of x_d_ahead must be 1, got 0"),
        (["x_d_ahead", "x_meas"], [1, 1], [1.0, math.nan], "the derivative of x_meas must be finite, got nan"),
    ],
)
def test_derivatives_that_cannot_be_are_refused_and_none_is_taken(
    fmu: Library, names: list[str], orders: list[int], values: list[float], message: str
) -> None:
    component = component_in(fmu, "stepping")
    before = fmu.save(component)
    references = (c_uint * 2)(*(fmu.references[name] for name in names))
    given = (c_int * 2)(*orders), (c_double * 2)(*values)
    assert fmu.SetRealInputDerivatives(component, references, 2, *given) == ERROR
    assert message.format(p=fmu.references["p"]) in fmu.messages[-1][2]
    assert fmu.save(component) == before
    assert fmu.SetRealInputDerivatives(component, references, 2, None, given[1]) == ERROR
    fmu.FreeInstance(component)


def test_no_component_is_refused_without_harm(fmu: Library) -> None:
    for name in LEGAL:
        assert getattr(fmu, name)(None, *ARGUMENTS.get(name, ())) == ERROR
    fmu.FreeInstance(None)


def test_instantiation_is_refused_by_name(fmu: Library) -> None:
    for arguments, expected in (
        ({"guid": "{0}"}, rf"fmuGUID must be {re.escape(fmu.guid)} as in modelDescription.xml, got {{0}}"),
        ({"name": b""}, "instanceName must not be empty"),
        ({"name": None}, "instanceName must not be empty"),
        ({"kind": 0}, "fmuType must be fmi2CoSimulation, got 0"),
    ):
        assert fmu.instantiate(**arguments) is None
        assert re.search(expected, fmu.messages[-1][2])


def test_without_logger_or_callbacks_everything_still_works(fmu: Library) -> None:
    silent = Callbacks(Logger(), fmu.callbacks.allocate, fmu.callbacks.free, None, None)
    for component in (fmu.instantiate(callbacks=silent), fmu.instantiate_bare()):
        assert component is not None
        assert fmu.DoStep(component, 0.0, 1e-3, 1) == ERROR
        assert fmu.EnterInitializationMode(component) == OK
        assert fmu.ExitInitializationMode(component) == OK
        steps(fmu, component, 0, 250)
        fmu.FreeInstance(component)
    assert not fmu.messages


def test_no_memory_is_an_error_with_the_amount(fmu: Library) -> None:
    component = component_in(fmu, "Initialization Mode")
    for name, value in (("Np", 100_000), ("p", 5000), ("q", 5000)):
        fmu.set(component, name, value)
    assert fmu.ExitInitializationMode(component) == ERROR
    assert re.search(r"memory|bytes", fmu.messages[-1][2])
    assert fmu.Reset(component) == OK
    fmu.FreeInstance(component)


@pytest.mark.parametrize("n_blocks", [0, 1, 2])
def test_an_importer_without_memory_gets_no_instance(fmu: Library, n_blocks: int) -> None:
    left = iter(range(n_blocks))

    def few(count: int, size: int) -> int | None:
        return None if next(left, None) is None else fmu.callbacks.allocate(count, size)

    callbacks = Callbacks(fmu.callbacks.logger, Allocate(few), fmu.callbacks.free, None, None)
    assert fmu.instantiate(callbacks=callbacks, resources="file:///tmp") is None
    assert "fmi2Instantiate: no memory for" in fmu.messages[-1][2]


def test_log_categories_can_be_switched(fmu: Library) -> None:
    component = fmu.instantiate(logging_on=True)
    assert component is not None

    def names(*categories: bytes | None) -> ctypes.Array[c_char_p]:
        return (c_char_p * len(categories))(*categories)

    def heard() -> list[str]:
        fmu.messages.clear()
        fmu.DoStep(component, 0.0, 1e-3, 1)
        fmu.Reset(component)
        fmu.EnterInitializationMode(component)
        fmu.ExitInitializationMode(component)
        fmu.GetIntegerStatus(component, 1, byref(c_int()))
        fmu.Reset(component)
        return [category for _, category, _ in fmu.messages]

    everything = ["logStatusError", "logAll", "logStatusDiscard"]
    assert heard() == everything
    assert fmu.SetDebugLogging(component, 0, 1, names(b"logStatusError")) == OK
    assert heard() == ["logAll", "logStatusDiscard"]
    assert fmu.SetDebugLogging(component, 1, 1, names(b"logStatusError")) == OK
    assert heard() == ["logStatusError"]
    assert fmu.SetDebugLogging(component, 0, 2, names(b"logEvents", None)) == OK  # not ours: nothing changes
    assert heard() == ["logStatusError"]
    assert fmu.SetDebugLogging(component, 1, 1, names(b"logAll")) == OK
    assert heard() == everything
    assert fmu.SetDebugLogging(component, 0, 0, None) == OK
    assert heard() == ["logStatusError", "logStatusDiscard"]
    assert fmu.SetDebugLogging(component, 0, 1, names(b"logAll")) == OK
    assert heard() == []
    assert fmu.SetDebugLogging(component, 1, 0, None) == OK
    assert heard() == everything
    assert fmu.SetDebugLogging(component, 1, 1, None) == ERROR
    assert "categories is NULL" in fmu.messages[-1][2]
    fmu.FreeInstance(component)


def test_percent_signs_reach_the_logger_doubled(fmu: Library) -> None:
    assert fmu.instantiate(guid="{%s%n}") is None
    assert "{%%s%%n}" in fmu.messages[-1][2]
