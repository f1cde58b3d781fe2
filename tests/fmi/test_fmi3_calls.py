"""The FMI 3.0 functions of a native FMU, called one by one: legal sequences, values, states, resources, logging."""

from __future__ import annotations

import itertools
import math
import re
import shutil
from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_uint, c_void_p
from pathlib import Path
from typing import Any

import pytest
from fmi2_library import ERROR, OK
from fmi3_library import ABSENT, VALUE_TYPES, Library3, Logger

STATES = ("instantiated", "Initialization Mode", "Step Mode", "terminated")
ALWAYS, SETTABLE = set(STATES), set(STATES[:3])
LEGAL = {
    "SetDebugLogging": ALWAYS,
    "EnterInitializationMode": {"instantiated"},
    "ExitInitializationMode": {"Initialization Mode"},
    "Terminate": {"Step Mode"},
    "Reset": ALWAYS,
    "DoStep": {"Step Mode"},
    **{f"Get{kind}": ALWAYS for kind in (*VALUE_TYPES, "Binary")},
    **{f"Set{kind}": SETTABLE for kind in (*VALUE_TYPES, "Binary")},
}
PLACES: list[Any] = [c_bool(), c_bool(), c_bool(), c_double()]
ARGUMENTS = {
    "SetDebugLogging": (True, 0, None),
    "EnterInitializationMode": (False, 0.0, 0.0, False, 0.0),
    "DoStep": (0.0, 1e-3, True, *map(byref, PLACES)),
    **{f"{verb}{kind}": (None, 0, None, 0) for verb in ("Get", "Set") for kind in VALUE_TYPES},
    **{f"{verb}Binary": (None, 0, None, None, 0) for verb in ("Get", "Set")},
}


def library_of(folder: Path) -> Library3:
    """Return the functions of an unpacked FMU."""
    (path,) = (folder / "binaries" / "x86_64-linux").iterdir()
    return Library3(path, folder / "modelDescription.xml")


@pytest.fixture(scope="module")
def loaded(folders: Callable[[str], Path]) -> Library3:
    return library_of(folders("HybridPredictorFmi3"))


@pytest.fixture
def fmu(loaded: Library3) -> Library3:
    loaded.messages.clear()
    return loaded


def instance_in(fmu: Library3, state: str) -> int:
    """Return a new instance, brought into a state by legal calls."""
    instance = fmu.instantiate()
    assert instance is not None
    for name in ("EnterInitializationMode", "ExitInitializationMode", "Terminate")[: STATES.index(state)]:
        assert getattr(fmu, name)(instance, *ARGUMENTS.get(name, ())) == OK
    return instance


def steps(fmu: Library3, instance: int, first: int, last: int) -> None:
    """Step through samples ``first … last - 1`` of a made-up motion."""
    for k in range(first, last):
        assert fmu.set(instance, "x_d_ahead", 1e-3 * math.sin(0.02 * k)) == OK
        assert fmu.set(instance, "x_meas", 1e-3 * math.sin(0.02 * k - 2.1) + 1e-5 * math.cos(0.3 * k)) == OK
        assert fmu.do_step(instance, k * 1e-3, 1e-3) == OK


@pytest.mark.parametrize(("name", "state"), list(itertools.product(LEGAL, STATES)))
def test_the_table_of_legal_calls(fmu: Library3, name: str, state: str) -> None:
    instance = instance_in(fmu, state)
    before = fmu.reals(instance)
    status = getattr(fmu, name)(instance, *ARGUMENTS.get(name, ()))
    if state in LEGAL[name]:
        assert status == OK
    else:
        assert status == ERROR
        assert re.match(rf"fmi3{name} is not allowed in the state {state}; it is allowed in: ", fmu.messages[-1][2])
        assert fmu.reals(instance) == before
    fmu.FreeInstance(instance)


@pytest.mark.parametrize("name", ABSENT)
def test_what_is_absent_is_refused_by_name_in_every_state(fmu: Library3, name: str) -> None:
    arguments = [None if kind is c_void_p or hasattr(kind, "contents") else kind(0) for kind in ABSENT[name]]
    for state in STATES:
        instance = instance_in(fmu, state)
        assert getattr(fmu, name)(instance, *arguments) == ERROR
        assert re.match(
            rf"fmi3{name} is not supported: .*(is false|is 0|there is no).* in modelDescription.xml",
            fmu.messages[-1][2],
        )
        fmu.FreeInstance(instance)
    assert getattr(fmu, name)(None, *arguments) == ERROR


@pytest.mark.parametrize(("kind", "n_callbacks"), [("ModelExchange", 0), ("ScheduledExecution", 3)])
def test_an_instance_of_another_kind_is_refused_by_name(fmu: Library3, kind: str, n_callbacks: int) -> None:
    heard: list[tuple[int, str]] = []

    def log(environment: Any, status: int, category: bytes, message: bytes) -> None:
        heard.append((status, message.decode()))

    create: Any = getattr(fmu, f"Instantiate{kind}")
    create.restype = c_void_p
    arguments = (c_char_p(b"one"), c_char_p(fmu.guid.encode()), None, c_bool(), c_bool(), None)
    for logger in (Logger(log), Logger()):
        assert not create(*arguments, logger, *[None] * n_callbacks)
    said = f"fmi3Instantiate{kind} is not supported: there is no {kind} in modelDescription.xml"
    assert heard == [(ERROR, said)]


def test_no_instance_is_refused_without_harm(fmu: Library3) -> None:
    for name in LEGAL:
        assert getattr(fmu, name)(None, *ARGUMENTS.get(name, ())) == ERROR
    fmu.FreeInstance(None)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"guid": "{%s}"}, r"instantiationToken must be \{.{36}\} as in modelDescription.xml, got \{%s\}"),
        ({"name": b""}, "instanceName must not be empty"),
        ({"name": None}, "instanceName must not be empty"),
        ({"event_mode": True}, "eventModeUsed must be false, as hasEventMode is in modelDescription.xml"),
        ({"intermediate": 2}, "nRequiredIntermediateVariables must be 0, as providesIntermediateUpdate is .*, got 2"),
    ],
)
def test_instantiation_is_refused_by_name(fmu: Library3, arguments: dict[str, object], expected: str) -> None:
    assert fmu.instantiate(**arguments) is None  # type: ignore[arg-type]
    assert re.search(f"fmi3InstantiateCoSimulation: {expected}", fmu.messages[-1][2])


def test_without_a_logger_everything_still_works(fmu: Library3) -> None:
    instance = fmu.instantiate(silent=True)
    assert instance is not None
    assert fmu.do_step(instance, 0.0, 1e-3) == ERROR
    assert fmu.begin(instance) == OK
    assert fmu.ExitInitializationMode(instance) == OK
    steps(fmu, instance, 0, 150)
    fmu.FreeInstance(instance)
    assert fmu.instantiate(b"", silent=True) is None
    assert not fmu.messages


def test_wrong_references_types_and_sizes_are_refused_by_name(fmu: Library3) -> None:
    instance = instance_in(fmu, "Step Mode")
    n, one = len(fmu.references), byref(c_uint(0))
    window, few = byref(c_uint(fmu.references["x_h_window"])), (c_double * 101)()
    cases = [
        (fmu.GetFloat64(instance, byref(c_uint(n)), 1, few, 1), f"value reference must be 0 ... {n - 1}, got {n}"),
        (fmu.GetFloat64(instance, None, 1, few, 1), "valueReferences is NULL, but nValueReferences is 1"),
        (fmu.SetFloat64(instance, one, 1, None, 1), "fmi3SetFloat64: values is NULL, but nValueReferences is 1"),
        (fmu.GetFloat64(instance, window, 1, few, 99), "nValues must be 100, the number of values .*, got 99"),
        (fmu.GetFloat64(instance, window, 1, few, 101), "nValues must be 100, the number of values .*, got 101"),
        (fmu.GetFloat64(instance, one, 1, few, 0), "nValues must be 1, the number of values .*, got 0"),
        (fmu.GetInt32(instance, one, 1, None, 1), "fmi3GetInt32: values is NULL"),
        (fmu.GetInt32(instance, one, 1, (VALUE_TYPES["Int32"] * 1)(), 1), "x_d_ahead .* is of type Float64, not Int32"),
        (fmu.GetString(instance, one, 1, (c_char_p * 1)(), 1), "x_d_ahead .* is of type Float64, not String"),
        (fmu.set(instance, "x_h", 1.0), "x_h is an output and cannot be set"),
        (fmu.set(instance, "x_h_window", 1.0), "x_h_window is a local variable and cannot be set"),
        (fmu.set(instance, "time", 1.0), "time is the independent variable and cannot be set"),
        (fmu.set(instance, "hybrid_active", True), "hybrid_active is an output and cannot be set"),
        (fmu.set(instance, "Np", 10), "Np is a fixed parameter .* after the initialization; call fmi3Reset first"),
        (fmu.set(instance, "input_hold", 1), "input_hold is a fixed parameter"),
        (fmu.set(instance, "mode[1].zeta", 0.1), r"mode\[1\].zeta is a fixed parameter"),
    ]
    assert [status for status, _ in cases] == [ERROR] * len(cases)
    for (_, expected), (_, category, message) in zip(cases, fmu.messages, strict=True):
        assert re.search(expected, message)
        assert category == "logStatusError"
    fmu.FreeInstance(instance)


def test_a_refused_call_sets_nothing(fmu: Library3) -> None:
    instance = instance_in(fmu, "Step Mode")
    references = (c_uint * 2)(fmu.references["x_meas"], fmu.references["x_h"])
    assert fmu.SetFloat64(instance, references, 2, (c_double * 2)(7.0, 7.0), 2) == ERROR
    assert fmu.get(instance, "x_meas") == 0.0
    fmu.FreeInstance(instance)


def test_variables_of_several_sizes_in_one_call(fmu: Library3) -> None:
    instance = instance_in(fmu, "Step Mode")
    steps(fmu, instance, 0, 330)
    names = ("x_h_window", "time", "x_h", "x_d_window", "mode[1].f_n")
    references, values = (c_uint * 5)(*(fmu.references[name] for name in names)), (c_double * 203)()
    assert fmu.GetFloat64(instance, references, 5, values, 203) == OK
    expected = [fmu.get(instance, name) for name in names]
    flat = [number for value in expected for number in (value if isinstance(value, list) else [value])]
    assert list(values) == flat
    assert values[100] == pytest.approx(0.33)
    assert len(set(flat)) > 190
    fmu.FreeInstance(instance)


def test_enumerations_and_booleans_are_read_and_written(fmu: Library3) -> None:
    instance = instance_in(fmu, "Initialization Mode")
    assert (fmu.kinds["input_hold"], fmu.kinds["averaging"]) == ("Int64", "Boolean")
    for value in (1, 0):
        assert fmu.set(instance, "input_hold", value) == OK
        assert fmu.get(instance, "input_hold") == value
        assert fmu.set(instance, "averaging", bool(value)) == OK
        assert fmu.get(instance, "averaging") is bool(value)
    assert fmu.set(instance, "input_hold", 2**62) == OK
    assert fmu.ExitInitializationMode(instance) == ERROR
    assert "input_hold must be" in fmu.messages[-1][2]
    fmu.FreeInstance(instance)


def test_bad_experiments_and_steps_are_refused(fmu: Library3) -> None:
    instance = instance_in(fmu, "instantiated")
    assert fmu.begin(instance, math.nan) == ERROR
    assert "fmi3EnterInitializationMode: startTime must be finite" in fmu.messages[-1][2]
    assert fmu.begin(instance, 1.0, 0.5) == ERROR
    assert "stopTime must be >= startTime = 1 s, got 0.5 s" in fmu.messages[-1][2]
    assert fmu.begin(instance, 1.0, 2.0) == OK
    assert fmu.ExitInitializationMode(instance) == OK
    assert fmu.time(instance) == 1.0
    for k in range(4):
        places = [None if i == k else byref(place) for i, place in enumerate(PLACES)]
        assert fmu.DoStep(instance, 1.0, 1e-3, True, *places) == ERROR
        assert "fmi3DoStep: a place for what it returns is NULL" in fmu.messages[-1][2]
    reached = c_double(7.0)
    assert fmu.DoStep(instance, 1.5, 1e-3, True, *map(byref, PLACES[:3]), byref(reached)) == ERROR
    assert reached.value == 1.0  # where it still is
    assert fmu.do_step(instance, 1.0, 1e-3) == OK
    assert fmu.time(instance) == 1.001
    fmu.FreeInstance(instance)


@pytest.mark.parametrize("state", STATES)
def test_the_state_can_be_saved_and_restored_at_any_time(fmu: Library3, state: str) -> None:
    instance, other = instance_in(fmu, state), instance_in(fmu, "Step Mode")
    assert fmu.restore(other, fmu.save(instance)) == OK
    assert fmu.do_step(other, 0.0, 1e-3) == (OK if state == "Step Mode" else ERROR)
    fmu.FreeInstance(instance)
    fmu.FreeInstance(other)


@pytest.mark.parametrize("form", ["path", "without a slash", "none", "empty", "nowhere", "another file"])
def test_resources_are_found_by_path_or_beside_the_library(
    folders: Callable[[str], Path], tmp_path: Path, form: str
) -> None:
    folder = tmp_path / "a b %41 100% größe 位置#1 :// x"
    folder.parent.mkdir(parents=True, exist_ok=True)
    shutil.copytree(folders("ReferenceTrajectoryFmi3"), folder)
    fmu = library_of(folder)
    resources = {
        "path": f"{folder}/resources/",
        "without a slash": f"{folder}/resources",
        "none": None,
        "empty": "",
        "nowhere": str(tmp_path / "none"),
        "another file": "http://example.org/%s",
    }[form]
    instance = fmu.instantiate(resources=resources)
    assert instance is not None, fmu.messages
    unusable = "resourcePath must be a folder on this machine"
    expected = {"nowhere": "no variables.bin in resourcePath", "empty": unusable, "another file": unusable}.get(form)
    assert len(fmu.messages) == (expected is not None)
    assert all(expected and expected in message for _, _, message in fmu.messages)
    assert fmu.begin(instance) == OK
    assert fmu.ExitInitializationMode(instance) == OK
    for k in range(200):
        assert fmu.do_step(instance, k * 1e-3, 1e-3) == OK
    assert fmu.get(instance, "r") == pytest.approx(0.01, abs=1e-9)
    fmu.FreeInstance(instance)


def test_log_categories_can_be_switched(fmu: Library3) -> None:
    instance = fmu.instantiate(logging_on=True)

    def heard() -> list[str]:
        fmu.messages.clear()
        fmu.do_step(instance, 0.0, 1e-3)
        fmu.begin(instance)
        fmu.ExitInitializationMode(instance)
        fmu.Reset(instance)
        return [category for _, category, _ in fmu.messages]

    assert heard() == ["logStatusError", "logAll"]
    assert fmu.SetDebugLogging(instance, False, 1, (c_char_p * 1)(b"logStatusError")) == OK
    assert heard() == ["logAll"]
    assert fmu.SetDebugLogging(instance, False, 0, None) == OK
    assert heard() == ["logStatusError"]
    assert fmu.SetDebugLogging(instance, True, 1, None) == ERROR
    fmu.FreeInstance(instance)
