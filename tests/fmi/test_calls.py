"""FMI functions of a native FMU, of both versions, called one by one: legal sequences, refusals, logging, memory."""

import ctypes
import math
import re
import struct
import zlib
from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer
from pathlib import Path
from typing import Any

import pytest
from fmi_library import ABSENT, DISCARD, ERROR, OK, STATES, Library, Library3, library_of, steps

ALWAYS, SETTABLE, RUN = set(STATES), set(STATES[:3]), {"stepping", "terminated"}
LEGAL = {
    "SetDebugLogging": ALWAYS,
    "EnterInitializationMode": {"instantiated"},
    "ExitInitializationMode": {"Initialization Mode"},
    "Terminate": {"stepping"},
    "Reset": ALWAYS,
    "DoStep": {"stepping"},
}
OF_VERSION = {
    2: {"SetupExperiment": {"instantiated"}, "GetRealStatus": RUN, "GetBooleanStatus": RUN}
    | {f"Get{kind}": ALWAYS for kind in Library.values}
    | {f"Set{kind}": SETTABLE for kind in Library.values},
    3: {f"Get{kind}": ALWAYS for kind in (*Library3.values, "Binary")}
    | {f"Set{kind}": SETTABLE for kind in (*Library3.values, "Binary")}
    | {"SetUInt64": {"instantiated"}, "EnterConfigurationMode": {"instantiated"}, "ExitConfigurationMode": set()},
}
PLACES: list[Any] = [c_bool(), c_bool(), c_bool(), c_double()]
ARGUMENTS: dict[int, dict[str, tuple[Any, ...]]] = {
    2: {
        "SetDebugLogging": (True, 0, None),
        "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "DoStep": (0.0, 1e-3, 1),
        "GetRealStatus": (2, byref(c_double())),
        "GetBooleanStatus": (3, byref(c_int())),
        **{f"{verb}{kind}": (None, 0, None) for verb in ("Get", "Set") for kind in Library.values},
    },
    3: {
        "SetDebugLogging": (True, 0, None),
        "EnterInitializationMode": Library3.initialization,
        "DoStep": (0.0, 1e-3, True, *map(byref, PLACES)),
        **{f"{verb}{kind}": (None, 0, None, 0) for verb in ("Get", "Set") for kind in Library3.values},
        **{f"{verb}Binary": (None, 0, None, None, 0) for verb in ("Get", "Set")},
    },
}


def call(fmu: Library, name: str, instance: int | None) -> int:
    return int(getattr(fmu, name)(instance, *ARGUMENTS[fmu.version].get(name, ())))


@pytest.mark.parametrize("state", STATES)
def test_the_table_of_legal_calls(fmu: Library, state: str) -> None:
    shown = "Step Mode" if (fmu.version, state) == (3, "stepping") else state
    for name, states in (LEGAL | OF_VERSION[fmu.version]).items():
        instance = fmu.instance_in(state)
        before = fmu.reals(instance)
        if state in states:
            assert call(fmu, name, instance) == OK, name
        else:
            assert call(fmu, name, instance) == ERROR, name
            said = rf"fmi{fmu.version}{name} is not allowed in the state {shown}.*; it is allowed in: "
            assert re.match(said, fmu.messages[-1][2])
            assert fmu.reals(instance) == before
        fmu.FreeInstance(instance)
        assert call(fmu, name, None) == ERROR, name
    fmu.FreeInstance(None)


@pytest.mark.parametrize("state", STATES)
def test_what_is_absent_is_refused_by_name(loaded: dict[int, Library], state: str) -> None:
    fmu = loaded[3]
    instance = fmu.instance_in(state)
    for name in ABSENT:
        assert getattr(fmu, name)(instance) == ERROR
        said = rf"fmi3{name} is not supported: .*(is false|is 0|there is no).* in modelDescription.xml"
        assert re.match(said, fmu.messages[-1][2])
        assert getattr(fmu, name)(None) == ERROR
    fmu.FreeInstance(instance)


def test_what_fmi_2_has_besides_is_refused_by_name(fmu2: Library) -> None:
    instance = fmu2.instance_in("stepping")
    for name, given, said in (
        ("GetRealOutputDerivatives", (None, 0, None, None), "maxOutputDerivativeOrder is 0"),
        ("GetDirectionalDerivative", (None, 0, None, 0, None, None), "providesDirectionalDerivative is false"),
        ("CancelStep", (), "fmi2CancelStep is not allowed"),
    ):
        fmu2.refused(getattr(fmu2, name)(instance, *given), said)
    fmu2.FreeInstance(instance)


@pytest.mark.parametrize(("kind", "n_callbacks"), [("ModelExchange", 0), ("ScheduledExecution", 3)])
def test_instances_of_another_kind_are_refused_by_name(loaded: dict[int, Library], kind: str, n_callbacks: int) -> None:
    fmu = loaded[3]
    create: Any = getattr(fmu, f"Instantiate{kind}")
    create.argtypes, create.restype = None, c_void_p
    arguments = (c_char_p(b"one"), c_char_p(fmu.guid.encode()), None, c_bool(), c_bool(), None)
    fmu.messages.clear()
    for logger in (fmu.callbacks, None):
        assert not create(*arguments, logger, *[None] * n_callbacks)
    said = f"fmi3Instantiate{kind} is not supported: there is no {kind} in modelDescription.xml"
    assert [(status, message) for status, _, message in fmu.messages] == [(ERROR, said)]


def test_instantiation_is_refused_by_name(fmu: Library) -> None:
    token = "fmuGUID" if fmu.version == 2 else "instantiationToken"
    doubled = "{%%s%%n}" if fmu.version == 2 else "{%s%n}"  # FMI 2.0's text is a format
    cases: list[tuple[dict[str, Any], str]] = [
        ({"guid": "{%s%n}"}, f"{token} must be {re.escape(fmu.guid)} as in modelDescription.xml, got {doubled}"),
        ({"name": b""}, "instanceName must not be empty"),
        ({"name": None}, "instanceName must not be empty"),
    ]
    if fmu.version == 2:
        cases += [({"kind": 0}, "fmuType must be fmi2CoSimulation, got 0")]
    else:
        cases += [
            ({"event_mode": True}, "eventModeUsed must be false, as hasEventMode is in modelDescription.xml"),
            (
                {"intermediate": 2},
                "nRequiredIntermediateVariables must be 0, as providesIntermediateUpdate is .*, got 2",
            ),
        ]
    for arguments, expected in cases:
        assert fmu.instantiate(**arguments) is None
        assert re.search(expected, fmu.messages[-1][2])


def test_without_logger_or_callbacks_everything_still_works(fmu: Library) -> None:
    silent = [False]
    if fmu.version == 2:
        silent += [fmu.with_memory(fmu.callbacks.allocateMemory, type(fmu.callbacks.logger)())]
    for callbacks in silent:
        instance = fmu.instantiate(callbacks=callbacks)
        assert instance is not None
        assert fmu.do_step(instance, 0.0, 1e-3) == ERROR
        assert fmu.begin(instance) == fmu.ExitInitializationMode(instance) == OK
        steps(fmu, instance, 0, 250)
        fmu.FreeInstance(instance)
        assert fmu.instantiate(b"", callbacks=callbacks) is None
    assert not fmu.messages


# Variables ---------------------------------------------------------------------------------------------------------


def test_wrong_references_types_and_sizes_are_refused_by_name(fmu: Library) -> None:
    instance = fmu.instance_in("stepping")
    n, one, some = len(fmu.references), byref(c_uint(0)), (c_double * 101)()
    real, whole = fmu.real, "Integer" if fmu.version == 2 else "Int32"
    vr, values, count = (
        ("vr", "value", "nvr") if fmu.version == 2 else ("valueReferences", "values", "nValueReferences")
    )
    of = f"fmi{fmu.version}"
    window = "x_h_window[3]" if fmu.version == 2 else "x_h_window"
    array, wrong = (fmu.values[kind] * 1 for kind in (whole, "String"))
    cases = [
        (
            fmu.access("Get", real, instance, byref(c_uint(n)), 1, some, 1),
            f"value reference must be 0 ... {n - 1}, got {n}",
        ),
        (fmu.access("Get", real, instance, None, 1, some, 1), f"{of}Get{real}: {vr} is NULL, but {count} is 1"),
        (fmu.access("Set", real, instance, one, 1, None, 1), f"{of}Set{real}: {values} is NULL, but {count} is 1"),
        (fmu.access("Get", whole, instance, one, 1, None, 1), f"{of}Get{whole}: {values} is NULL"),
        (fmu.access("Get", whole, instance, one, 1, array(), 1), f"x_d_ahead .* is of type {real}, not {whole}"),
        (fmu.access("Get", "String", instance, one, 1, wrong(), 1), f"x_d_ahead .* is of type {real}, not String"),
        (fmu.set(instance, "x_h", 1.0), "x_h is an output and cannot be set"),
        (fmu.set(instance, window, 1.0), f"{re.escape(window)} is a calculated variable and cannot be set"),
        (fmu.set(instance, "hybrid_active", True), "hybrid_active is an output and cannot be set"),
        (fmu.set(instance, "p", 10), "p is a fixed parameter and cannot be set after the initialization"),
        (fmu.set(instance, "input_hold", 1), "input_hold is a fixed parameter"),
        (fmu.set(instance, "mode[1].zeta", 0.1), r"mode\[1\].zeta is a fixed parameter"),
    ]
    if fmu.version == 3:
        place = byref(c_uint(fmu.references[window]))
        cases += [
            (
                fmu.access("Get", real, instance, where, 1, some, given),
                f"nValues must be {due}, the number .*, got {given}",
            )
            for where, due, given in ((place, 100, 99), (place, 100, 101), (one, 1, 0))
        ]
        cases += [(fmu.set(instance, "time", 1.0), "time is the independent variable and cannot be set")]
    assert [status for status, _ in cases] == [ERROR] * len(cases)
    for (_, expected), (_, category, message) in zip(cases, fmu.messages, strict=True):
        assert re.search(expected, message)
        assert category == "logStatusError"
    references = (c_uint * 2)(fmu.references["x_meas"], fmu.references["x_h"])
    assert fmu.access("Set", real, instance, references, 2, (c_double * 2)(7.0, 7.0), 2) == ERROR
    assert fmu.get(instance, "x_meas") == 0.0  # a refused call sets nothing
    fmu.FreeInstance(instance)


def test_values_are_read_and_written(fmu: Library) -> None:
    instance = fmu.instance_in("Initialization Mode")
    for value in (1, 0):
        for name in ("input_hold", "averaging"):
            assert fmu.set(instance, name, value) == OK
            assert fmu.get(instance, name) == value
    assert fmu.set(instance, "input_hold", 2**30) == OK
    fmu.refused(fmu.ExitInitializationMode(instance), "input_hold must be")
    assert fmu.set(instance, "input_hold", 0) == OK
    assert fmu.ExitInitializationMode(instance) == OK  # what was wrong can be corrected
    steps(fmu, instance, 0, 330)
    names = ("x_h_window", "time", "x_h", "x_d_window", "mode[1].f_n")
    if fmu.version == 3:  # of several sizes in one call
        references, values = (c_uint * 5)(*(fmu.references[name] for name in names)), (c_double * 203)()
        assert fmu.access("Get", "Float64", instance, references, 5, values, 203) == OK
        found = [fmu.get(instance, name) for name in names]
        flat = [number for value in found for number in (value if isinstance(value, list) else [value])]
        assert list(values) == flat
        assert values[100] == pytest.approx(0.33)
        assert len(set(flat)) > 190
    fmu.FreeInstance(instance)


@pytest.mark.parametrize(
    ("names", "orders", "values", "message"),
    [
        (["x_d_ahead", "x_h"], [1, 1], [1.0, 1.0], "x_h takes no derivative, only x_d_ahead and x_meas do"),
        (["x_d_ahead", "p"], [1, 1], [1.0, 1.0], "p (value reference {p}) is of type Integer, not Real"),
        (["x_d_ahead", "x_meas"], [1, 2], [1.0, 1.0], "the order of x_meas must be 1, got 2"),
        (["x_d_ahead", "x_meas"], [1, 1], [1.0, math.nan], "the derivative of x_meas must be finite, got nan"),
    ],
)
def test_derivatives_that_cannot_be_are_refused_and_none_is_taken(
    fmu2: Library, names: list[str], orders: list[int], values: list[float], message: str
) -> None:
    instance = fmu2.instance_in("stepping")
    before = fmu2.save(instance)
    references = (c_uint * 2)(*(fmu2.references[name] for name in names))
    given = (c_int * 2)(*orders), (c_double * 2)(*values)
    fmu2.refused(fmu2.SetRealInputDerivatives(instance, references, 2, *given), message.format(p=fmu2.references["p"]))
    assert fmu2.save(instance) == before
    assert fmu2.SetRealInputDerivatives(instance, references, 2, None, given[1]) == ERROR
    fmu2.FreeInstance(instance)


def test_bad_experiments_and_steps_are_refused(fmu: Library) -> None:
    instance = fmu.instance_in("instantiated")
    fmu.refused(fmu.begin(instance, math.nan), "startTime must be finite")
    fmu.refused(fmu.begin(instance, 1.0, 0.5), "stopTime must be >= startTime = 1 s, got 0.5 s")
    assert fmu.begin(instance, 1.0, 2.0) == fmu.ExitInitializationMode(instance) == OK
    assert fmu.time(instance) == 1.0
    if fmu.version == 3:
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


def test_status_functions(fmu2: Library) -> None:
    instance, ended = fmu2.instance_in("stepping"), c_int(7)
    steps(fmu2, instance, 0, 3)
    assert fmu2.time(instance) == pytest.approx(3e-3)
    assert fmu2.GetBooleanStatus(instance, 3, byref(ended)) == OK
    assert ended.value == 0
    for name, value in (("", c_int()), ("Integer", c_int()), ("Real", c_double()), ("String", c_char_p())):
        assert getattr(fmu2, f"Get{name}Status")(instance, 1, byref(value)) == DISCARD
        assert f"fmi2Get{name}Status" in fmu2.messages[-1][2]
        fmu2.refused(getattr(fmu2, f"Get{name}Status")(instance, 1, None), "value is NULL")
    fmu2.FreeInstance(instance)


def test_log_categories_can_be_switched(fmu: Library) -> None:
    instance = fmu.instantiate(logging_on=True)

    def heard() -> list[str]:
        fmu.messages.clear()
        fmu.do_step(instance, 0.0, 1e-3)
        fmu.begin(instance)
        fmu.ExitInitializationMode(instance)
        if fmu.version == 2:
            fmu.GetIntegerStatus(instance, 1, byref(c_int()))
        fmu.Reset(instance)
        return [category for _, category, _ in fmu.messages]

    everything = ["logStatusError", "logAll", *(["logStatusDiscard"] if fmu.version == 2 else [])]
    assert heard() == everything
    for on, categories, expected in (
        (False, (b"logStatusError",), everything[1:]),
        (True, (b"logStatusError",), everything[:1]),
        (False, (b"logEvents", None), everything[:1]),  # not ours: nothing changes
        (True, (b"logAll",), everything),
        (False, (), [everything[0], *everything[2:]]),
        (False, (b"logAll",), []),
        (True, (), everything),
    ):
        assert fmu.SetDebugLogging(instance, on, len(categories), (c_char_p * len(categories))(*categories)) == OK
        assert heard() == expected
    fmu.refused(fmu.SetDebugLogging(instance, True, 1, None), "categories is NULL")
    fmu.FreeInstance(instance)


# Memory and states -------------------------------------------------------------------------------------------------


def test_steps_take_no_memory_and_reset_gives_it_back(fmu2: Library) -> None:
    instance, outputs = fmu2.instance_in("stepping"), []
    for _ in range(3):
        allocations, blocks = fmu2.allocations, len(fmu2.blocks)
        steps(fmu2, instance, 0, 420)
        assert (fmu2.allocations, len(fmu2.blocks)) == (allocations, blocks)
        outputs.append(fmu2.reals(instance))
        assert fmu2.Reset(instance) == OK
        assert fmu2.get(instance, "x_h") == 0.0
        assert fmu2.begin(instance) == fmu2.ExitInitializationMode(instance) == OK
        assert len(fmu2.blocks) == blocks
    assert len(set(outputs)) == 1
    fmu2.FreeInstance(instance)


def test_an_instance_asks_for_little_more_than_its_arrays(fmu2: Library) -> None:
    """With the paper's model; each learns a little and is saved, restored and reset."""
    # Of its n = 2 + p + q features it has a factor, each entry with what rounding took from it, and windows
    Np, p, q = 100, 50, 3
    n = 2 + p + q
    least = 8 * (n * (n + 1) + 14 * Np + len(fmu2.references))
    for _ in range(20):
        instance = fmu2.instantiate()
        assert fmu2.set(instance, "averaging", 0) == OK
        assert fmu2.begin(instance) == fmu2.ExitInitializationMode(instance) == OK
        assert least < sum(fmu2.blocks.values()) < 1.2 * least
        steps(fmu2, instance, 0, 2)
        assert fmu2.restore(instance, fmu2.save(instance)) == fmu2.Reset(instance) == OK
        fmu2.FreeInstance(instance)
        assert not fmu2.blocks


@pytest.mark.parametrize("n_blocks", [0, 1, 2])
def test_an_importer_without_memory_gets_no_instance(fmu2: Library, n_blocks: int) -> None:
    left = iter(range(n_blocks))

    def few(count: int, size: int) -> int | None:
        return None if next(left, None) is None else fmu2.callbacks.allocateMemory(count, size)

    assert fmu2.instantiate(callbacks=fmu2.with_memory(few), resources="file:///tmp") is None
    assert "fmi2Instantiate: no memory for" in fmu2.messages[-1][2]


def test_an_importer_that_runs_out_of_memory_keeps_what_it_has(fmu2: Library) -> None:
    memory = [True]

    def allocate(count: int, size: int) -> int | None:
        return fmu2.callbacks.allocateMemory(count, size) if memory[0] else None

    instance, large = fmu2.instance_in("stepping"), fmu2.instance_in("Initialization Mode")
    for name, value in (("Np", 100_000), ("p", 5000), ("q", 5000)):
        fmu2.set(large, name, value)
    assert fmu2.ExitInitializationMode(large) == ERROR
    assert re.search(r"memory|bytes", fmu2.messages[-1][2])
    fmu2.FreeInstance(large)
    block, state = fmu2.save(instance), c_void_p()
    assert fmu2.GetFMUstate(instance, byref(state)) == OK
    callbacks = fmu2.with_memory(allocate)
    poor = fmu2.instantiate(callbacks=callbacks)
    before, place, given = fmu2.reals(poor), c_void_p(), create_string_buffer(block, len(block))
    calls: tuple[Callable[[], int], ...] = (
        lambda: fmu2.GetFMUstate(poor, byref(place)),
        lambda: fmu2.DeSerializeFMUstate(poor, given, len(block), byref(place)),
        lambda: fmu2.SetFMUstate(poor, state),
    )
    memory[0] = False
    for one in calls:
        fmu2.refused(one(), "no memory for")
        assert (place.value, fmu2.reals(poor)) == (None, before)
    memory[0] = True
    assert [one() for one in calls] == [OK] * 3
    assert fmu2.FreeFMUstate(poor, byref(place)) == fmu2.FreeFMUstate(instance, byref(state)) == OK
    steps(fmu2, poor, 0, 20)
    fmu2.FreeInstance(poor)
    fmu2.FreeInstance(instance)


@pytest.mark.parametrize("state", STATES)
def test_the_state_can_be_saved_and_restored_at_any_time(fmu: Library, state: str) -> None:
    instance, other = fmu.instance_in(state), fmu.instance_in("stepping")
    assert fmu.restore(other, fmu.save(instance)) == OK
    assert fmu.do_step(other, 0.0, 1e-3) == (OK if state == "stepping" else ERROR)
    fmu.FreeInstance(instance)
    fmu.FreeInstance(other)


def test_a_state_is_reused_in_place_and_freeing_nothing_is_fine(fmu2: Library) -> None:
    instance, state = fmu2.instance_in("stepping"), c_void_p()
    assert fmu2.FreeFMUstate(instance, byref(state)) == OK
    assert fmu2.GetFMUstate(instance, byref(state)) == OK
    first, blocks = state.value, len(fmu2.blocks)
    steps(fmu2, instance, 0, 50)
    assert fmu2.GetFMUstate(instance, byref(state)) == OK
    assert (state.value, len(fmu2.blocks)) == (first, blocks)
    assert fmu2.FreeFMUstate(instance, byref(state)) == OK
    assert state.value is None
    fmu2.FreeInstance(instance)


def test_calls_with_no_room_or_a_handle_of_another_are_refused_by_name(
    fmu2: Library, folders: Callable[[str], Path]
) -> None:
    instance, other = fmu2.instance_in("stepping"), library_of(folders("HybridPredictor_als25010_x"))
    state, foreign, size = c_void_p(), c_void_p(), c_size_t()
    theirs = other.instantiate()
    assert fmu2.GetFMUstate(instance, byref(state)) == other.GetFMUstate(theirs, byref(foreign)) == OK
    assert fmu2.SerializedFMUstateSize(instance, state, byref(size)) == OK
    n, room, unknown = size.value, create_string_buffer(size.value), create_string_buffer(512)
    nothing = c_void_p(ctypes.addressof(unknown))
    for name, arguments, expected in (
        ("GetFMUstate", (None,), "NULL"),
        ("SetFMUstate", (None,), "NULL"),
        ("SerializedFMUstateSize", (None, byref(c_size_t())), "NULL"),
        ("SerializedFMUstateSize", (state, None), "size is NULL"),
        ("SerializeFMUstate", (None, None, 0), "NULL"),
        ("SerializeFMUstate", (state, room, n - 1), rf"room for {n} bytes, got {n - 1}$"),
        ("SerializeFMUstate", (state, None, n), rf"room for {n} bytes, got {n} and NULL"),
        ("DeSerializeFMUstate", (None, 0, byref(state)), "NULL"),
        ("DeSerializeFMUstate", (room, n, None), "the place of the state is NULL"),
        ("GetFMUstate", (byref(nothing),), "the state is none of this FMU"),
        ("SetFMUstate", (nothing,), "the state is none of this FMU"),
        ("FreeFMUstate", (byref(nothing),), "the state is none of this FMU"),
        ("SetFMUstate", (foreign,), rf"the state belongs to the FMU {re.escape(other.guid)}, not to "),
    ):
        before = fmu2.reals(instance)
        assert getattr(fmu2, name)(instance, *arguments) == ERROR
        assert re.search(rf"fmi2{name}: .*{expected}", fmu2.messages[-1][2])
        assert fmu2.reals(instance) == before
        assert getattr(fmu2, name)(None, *arguments) == ERROR
    assert other.FreeFMUstate(theirs, byref(foreign)) == OK
    other.FreeInstance(theirs)
    assert fmu2.FreeFMUstate(instance, byref(state)) == OK
    fmu2.FreeInstance(instance)


def test_a_changed_state_with_a_right_checksum_is_checked_by_the_model(fmu: Library) -> None:
    instance = fmu.instance_in("stepping")
    block, head = bytearray(fmu.save(instance)), 120  # bytes before the values; the checksum stands in them from 72 on
    place = head + 8 * fmu.references["Np"]
    block[place : place + 8] = block[72:80] = bytes(8)
    block[72:80] = struct.pack("<2I", zlib.crc32(block[head:]), zlib.crc32(block[:head]))
    assert fmu.restore(instance, bytes(block)) == ERROR
    assert re.search("the state cannot be used: .*Np", fmu.messages[-1][2])
    fmu.FreeInstance(instance)
