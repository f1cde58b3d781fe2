"""The native FMUs' FMI 2.0 functions, called one by one through ctypes: what is legal when, and what is said if not."""

from __future__ import annotations

import ctypes
import itertools
import math
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path

import fuzz_fmi2
import pytest
from c_core import (
    C_SOURCES,
    FMI_HEADERS,
    address_sanitizer,
    include_flags,
    needs_sanitisers,
    run_compiler,
    sanitising_compiler,
)
from fuzz_fmi2 import DISCARD, ERROR, OK, Allocate, Callbacks, Library, Logger, repair_checksum

from hybridsep.fmi.archive import build_fmu, fmu_names
from hybridsep.fmi.native_backend import sources
from hybridsep.machine import Machine, load_machine

STATES = ("instantiated", "Initialization Mode", "stepping", "terminated")
FUZZED = {
    "HybridPredictor": 16,
    "SepCompensator": 12,
    "FeedDrive": 6,
    "FeedDrive_als25010_x": 6,
    "ReferenceTrajectory": 6,
}
"""How many seconds each model is called at random."""

SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The unpacked native FMUs by name, built for this machine."""
    out = tmp_path_factory.mktemp("native")

    def unpacked(job: tuple[str, Machine]) -> Path:
        name, machine = job
        with zipfile.ZipFile(build_fmu(machine, name, out, targets=("host",))) as archive:
            archive.extractall(out / name)
        return out / name

    machines = (load_machine("spring_mass_damper"), load_machine("als25010_x"))
    jobs = {name: machine for machine in machines for name in fmu_names(machine)}
    with ThreadPoolExecutor() as pool:
        return dict(zip(jobs, pool.map(unpacked, jobs.items()), strict=True))


def library_of(folder: Path) -> Library:
    """Return the functions of an unpacked FMU."""
    (path,) = (folder / "binaries" / "linux64").iterdir()
    return Library(path, folder / "modelDescription.xml")


@pytest.fixture(scope="module")
def loaded(folders: dict[str, Path]) -> Library:
    return library_of(folders["HybridPredictor"])


@pytest.fixture
def fmu(loaded: Library) -> Iterator[Library]:
    loaded.messages.clear()
    yield loaded
    assert not loaded.blocks, "memory was not given back"


def component_in(fmu: Library, state: str) -> int:
    """Return a new component, brought into a state by legal calls."""
    component = fmu.instantiate()
    assert component is not None
    calls = ("EnterInitializationMode", "ExitInitializationMode", "Terminate")
    for name in calls[: STATES.index(state)]:
        assert getattr(fmu, name)(component) == OK
    return component


def steps(fmu: Library, component: int, first: int, last: int, start: float = 0.0) -> None:
    """Step through samples ``first … last - 1`` of a made-up motion."""
    for k in range(first, last):
        assert fmu.set(component, "x_d_ahead", 1e-3 * math.sin(0.02 * k)) == OK
        assert fmu.set(component, "x_meas", 1e-3 * math.sin(0.02 * k - 2.1) + 1e-5 * math.cos(0.3 * k)) == OK
        assert fmu.DoStep(component, start + k * 1e-3, 1e-3, 1) == OK


# Which call is legal when ------------------------------------------------------------------------------------------

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


@pytest.mark.parametrize("state", STATES)
def test_the_state_can_be_saved_and_restored_at_any_time(fmu: Library, state: str) -> None:
    component, other = component_in(fmu, state), component_in(fmu, "stepping")
    assert fmu.restore(other, fmu.save(component)) == OK
    assert fmu.DoStep(other, 0.0, 1e-3, 1) == (OK if state == "stepping" else ERROR)
    fmu.FreeInstance(component)
    fmu.FreeInstance(other)


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


# Instantiation -----------------------------------------------------------------------------------------------------


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


# Variables ---------------------------------------------------------------------------------------------------------


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


def test_outputs_follow_the_start_value_before_and_after_the_initialization(fmu: Library) -> None:
    component = component_in(fmu, "instantiated")
    assert fmu.set(component, "x_d_ahead", 0.1) == OK
    for name in ("EnterInitializationMode", "ExitInitializationMode"):
        assert getattr(fmu, name)(component) == OK
        assert [fmu.get(component, name) for name in ("x_d", "x_pb", "x_h", "x_h_window[100]")] == [0.1] * 4
        assert [fmu.get(component, name) for name in ("e_servo", "rms_h", "batch", "hybrid_active")] == [0] * 4
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


# Steps -------------------------------------------------------------------------------------------------------------


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


# Logging -----------------------------------------------------------------------------------------------------------


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


# States ------------------------------------------------------------------------------------------------------------


def test_a_state_is_reused_in_place_and_freeing_nothing_is_fine(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    state = c_void_p()
    assert fmu.FreeFMUstate(component, byref(state)) == OK
    assert fmu.GetFMUstate(component, byref(state)) == OK
    first, blocks = state.value, len(fmu.blocks)
    steps(fmu, component, 0, 50)
    assert fmu.GetFMUstate(component, byref(state)) == OK
    assert (state.value, len(fmu.blocks)) == (first, blocks)
    assert fmu.FreeFMUstate(component, byref(state)) == OK
    assert state.value is None
    for name, arguments in (
        ("GetFMUstate", (None,)),
        ("SetFMUstate", (None,)),
        ("SerializedFMUstateSize", (None, byref(c_size_t()))),
        ("SerializeFMUstate", (None, None, 0)),
        ("DeSerializeFMUstate", (None, 0, byref(state))),
    ):
        assert getattr(fmu, name)(component, *arguments) == ERROR
        assert re.search(rf"fmi2{name}: .*NULL", fmu.messages[-1][2])
    fmu.FreeInstance(component)


def test_damaged_truncated_and_foreign_states_are_refused(fmu: Library, folders: dict[str, Path]) -> None:
    component = component_in(fmu, "stepping")
    steps(fmu, component, 0, 230)
    block = fmu.save(component)
    before = fmu.reals(component)
    for place in (*range(130), *range(130, len(block), 97)):
        damaged = bytearray(block)
        damaged[place] ^= 0x10
        assert fmu.restore(component, bytes(damaged)) == ERROR
    for length in (0, 1, 119, 120, 500, len(block) - 1):
        assert fmu.restore(component, block[:length]) == ERROR
    assert fmu.restore(component, block + b"\0") == ERROR
    other = library_of(folders["HybridPredictor_als25010_x"])
    theirs = other.instantiate()
    assert fmu.restore(component, other.save(theirs)) == ERROR
    other.FreeInstance(theirs)
    assert fmu.reals(component) == before
    assert fmu.restore(component, block) == OK
    fmu.FreeInstance(component)


def test_a_changed_state_with_a_right_checksum_is_checked_by_the_model(fmu: Library) -> None:
    component = component_in(fmu, "stepping")
    block = bytearray(fmu.save(component))
    place = 120 + 8 * fmu.references["Np"]
    block[place : place + 8] = bytes(8)
    repair_checksum(block)
    assert fmu.restore(component, bytes(block)) == ERROR
    assert re.search("the state cannot be used: .*Np", fmu.messages[-1][2])
    fmu.FreeInstance(component)


# Resources ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["uri", "one slash", "localhost", "plain path", "spaces not encoded"])
def test_resources_in_a_folder_with_an_odd_name(folders: dict[str, Path], tmp_path: Path, form: str) -> None:
    folder = tmp_path / "a b %41 100% größe 位置#1"
    folder.symlink_to(folders["ReferenceTrajectory"], target_is_directory=True)
    path = folder / "resources"
    uri = {
        "uri": path.as_uri(),
        "one slash": path.as_uri().replace("file:///", "file:/"),
        "localhost": path.as_uri().replace("file:///", "FILE://localhost/") + "/",
        "plain path": str(path),
        "spaces not encoded": path.as_uri().replace("%20", " "),
    }[form]
    fmu = library_of(folders["ReferenceTrajectory"])
    component = fmu.instantiate(resources=uri)
    assert component is not None
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == OK, fmu.messages
    for k in range(200):
        assert fmu.DoStep(component, k * 1e-3, 1e-3, 1) == OK
    assert fmu.get(component, "r") == pytest.approx(0.01, abs=1e-9)
    fmu.FreeInstance(component)
    assert not fmu.blocks


def test_unusable_resources_are_told_and_missing_when_needed(folders: dict[str, Path]) -> None:
    fmu = library_of(folders["ReferenceTrajectory"])
    component = fmu.instantiate(resources="http://example.org/%s")
    assert "must be a file: URI on this machine, got http://example.org/%%s" in fmu.messages[-1][2]
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == ERROR
    assert "trajectory" in fmu.messages[-1][2]
    fmu.FreeInstance(component)


def test_a_resource_that_grows_during_the_initialization_is_refused(folders: dict[str, Path], tmp_path: Path) -> None:
    """The importer's own allocation is what happens between the two looks at the file."""
    resources = shutil.copytree(folders["ReferenceTrajectory"] / "resources", tmp_path / "resources")
    file = resources / "trajectory_0.bin"
    content = file.read_bytes()
    count = int.from_bytes(content[8:16], "little")
    longer = content[:8] + (count + 4000).to_bytes(8, "little") + content[16:] + content[-8:] * 4000
    fmu = library_of(folders["ReferenceTrajectory"])

    def growing(number: int, size: int) -> int | None:
        if number * size > 8 * count:  # the state's block
            file.write_bytes(longer)
        return fmu.callbacks.allocate(number, size)  # type: ignore[no-any-return]

    callbacks = Callbacks(fmu.callbacks.logger, Allocate(growing), fmu.callbacks.free, None, None)
    component = fmu.instantiate(resources=resources.as_uri(), callbacks=callbacks)
    assert component is not None
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == ERROR
    assert "has changed meanwhile: initialise again" in fmu.messages[-1][2]
    assert fmu.ExitInitializationMode(component) == OK  # it has changed for good
    fmu.FreeInstance(component)
    assert not fmu.blocks


def test_uris_of_windows(tmp_path: Path) -> None:
    root = C_SOURCES / "fmi2"
    library = tmp_path / "uri.so"
    run_compiler(["-shared", "-fPIC", "-O1", *include_flags(), "-o", library, root / "hsep_uri.c"])
    convert = ctypes.CDLL(str(library)).hsep_uri_folder
    for uri, windows, expected in (
        ("file:///C:/a%20b/resources", 1, "C:/a b/resources/"),
        ("file:/c|/x/", 1, "c:/x/"),
        ("file://server/share/x", 1, "//server/share/x/"),
        ("file://server/share/x", 0, None),
        ("C:\\x\\", 1, "C:\\x\\"),
        ("file:///C:/x", 0, "/C:/x/"),
        ("file:///a%2", 0, "/a%2/"),
        ("file:///a%00b", 0, None),
        ("file:", 0, None),
        ("", 0, None),
    ):
        folder = ctypes.create_string_buffer(len(uri) + 2)
        assert convert(uri.encode(), windows, folder) == (expected is not None)
        if expected is not None:
            assert folder.value.decode() == expected


# Random calls ------------------------------------------------------------------------------------------------------


@needs_sanitisers
def test_random_calls_under_sanitizers(folders: dict[str, Path], tmp_path: Path) -> None:
    """All models at the same time, so that it takes no longer than one."""
    compiler = sanitising_compiler()
    environment = {
        **os.environ,
        "LD_PRELOAD": address_sanitizer(compiler),
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1",  # Python's own leaks; ours are counted
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }
    fuzzer = fuzz_fmi2.__file__

    def findings(name: str) -> str:
        folder = folders[name] / "sources"
        library = tmp_path / f"{name}.so"
        files: list[str | Path] = [f"-I{folder}", f"-I{FMI_HEADERS}", folder / "all.c", "-lm", "-o", library]
        run_compiler(["-O1", "-g", *SANITIZERS, "-fPIC", "-shared", *files], command=compiler)
        command = [sys.executable, fuzzer, str(library), str(folders[name] / "modelDescription.xml")]
        command += [(folders[name] / "resources").as_uri(), "--seconds", str(FUZZED[name]), "--seed", "1"]
        result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        held = result.returncode == 0 and "no finding" in result.stdout
        return "" if held else f"{name}: {result.stdout}{result.stderr}"

    with ThreadPoolExecutor(len(FUZZED)) as pool:
        assert not "".join(pool.map(findings, FUZZED))


GCC = pytest.param(["gcc"], marks=pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc"), id="gcc")
CLANG = pytest.param([sys.executable, "-m", "ziglang", "cc"], id="clang")


@pytest.mark.parametrize("compiler", [GCC, CLANG])
@pytest.mark.parametrize("model", ["HybridPredictor", "SepCompensator", "FeedDrive"])
def test_each_source_compiles_alone_without_warnings(tmp_path: Path, compiler: list[str], model: str) -> None:
    parameters: dict[str, object] = dict.fromkeys(("f", "kappa", "noise_std", "seed"), 0) | {"T_s": 1e-3}
    mode = {"f_n": 25.0, "zeta": 0.05, "alpha": 1.0, "beta": 0.0}
    description = {"model": "FeedDrive", "name": "Stage", "parameters": parameters, "modes": [mode]}
    if model != "FeedDrive":
        machine = load_machine("spring_mass_damper")
        fmi = machine.fmi_parameters() if model == "HybridPredictor" else machine.fmi_compensator_parameters()
        description = {"model": model, "name": model, "parameters": fmi, "modes": [mode]}
    for file, content in sources(description, "{}").items():
        (tmp_path / file).write_bytes(content)

    def compile_alone(path: Path) -> None:
        run_compiler(["-O2", f"-I{FMI_HEADERS}", "-c", path, "-o", path.with_suffix(".o")], command=compiler)

    with ThreadPoolExecutor() as pool:
        list(pool.map(compile_alone, sorted(tmp_path.glob("*.c"))))
