"""States of a native FMU through its FMI 2.0 functions, damaged and foreign ones too."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from ctypes import byref, c_size_t, c_void_p, create_string_buffer
from pathlib import Path

import pytest
from fmi2_driving import STATES, component_in, library_of, steps
from fmi2_library import ERROR, OK, Allocate, Callbacks, Library, repair_checksum


@pytest.mark.parametrize("state", STATES)
def test_the_state_can_be_saved_and_restored_at_any_time(fmu: Library, state: str) -> None:
    component, other = component_in(fmu, state), component_in(fmu, "stepping")
    assert fmu.restore(other, fmu.save(component)) == OK
    assert fmu.DoStep(other, 0.0, 1e-3, 1) == (OK if state == "stepping" else ERROR)
    fmu.FreeInstance(component)
    fmu.FreeInstance(other)


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


def test_calls_with_no_component_no_room_or_a_handle_of_another_are_refused_by_name(
    fmu: Library, folders: Callable[[str], Path]
) -> None:
    component, other = component_in(fmu, "stepping"), library_of(folders("HybridPredictor_als25010_x"))
    state, foreign, size = c_void_p(), c_void_p(), c_size_t()
    theirs = other.instantiate()
    assert fmu.GetFMUstate(component, byref(state)) == other.GetFMUstate(theirs, byref(foreign)) == OK
    assert fmu.SerializedFMUstateSize(component, state, byref(size)) == OK
    room, unknown = create_string_buffer(size.value), create_string_buffer(512)
    nothing = c_void_p(ctypes.addressof(unknown))
    for name, arguments, expected in (
        ("SerializedFMUstateSize", (state, None), "size is NULL"),
        ("SerializeFMUstate", (state, room, size.value - 1), rf"room for {size.value} bytes, got {size.value - 1}$"),
        ("SerializeFMUstate", (state, None, size.value), rf"room for {size.value} bytes, got {size.value} and NULL"),
        ("DeSerializeFMUstate", (room, size.value, None), "the place of the state is NULL"),
        ("GetFMUstate", (byref(nothing),), "the state is none of this FMU"),
        ("SetFMUstate", (nothing,), "the state is none of this FMU"),
        ("FreeFMUstate", (byref(nothing),), "the state is none of this FMU"),
        ("SetFMUstate", (foreign,), rf"the state belongs to the FMU {re.escape(other.guid)}, not to "),
    ):
        before = fmu.reals(component)
        assert getattr(fmu, name)(component, *arguments) == ERROR
        assert re.search(rf"fmi2{name}: .*{expected}", fmu.messages[-1][2])
        assert fmu.reals(component) == before
        assert getattr(fmu, name)(None, *arguments) == ERROR
    assert other.FreeFMUstate(theirs, byref(foreign)) == OK
    other.FreeInstance(theirs)
    assert fmu.FreeFMUstate(component, byref(state)) == OK
    fmu.FreeInstance(component)


def test_an_importer_that_runs_out_of_memory_keeps_what_it_has(fmu: Library) -> None:
    memory = [True]

    def allocate(count: int, size: int) -> int | None:
        return fmu.callbacks.allocate(count, size) if memory[0] else None

    component = component_in(fmu, "stepping")
    block, state = fmu.save(component), c_void_p()
    assert fmu.GetFMUstate(component, byref(state)) == OK
    callbacks = Callbacks(fmu.callbacks.logger, Allocate(allocate), fmu.callbacks.free, None, None)
    poor = fmu.instantiate(callbacks=callbacks)
    assert poor is not None
    before, place = fmu.reals(poor), c_void_p()
    calls: tuple[Callable[[], int], ...] = (
        lambda: fmu.GetFMUstate(poor, byref(place)),
        lambda: fmu.DeSerializeFMUstate(poor, block, len(block), byref(place)),
        lambda: fmu.SetFMUstate(poor, state),
    )
    memory[0] = False
    for call in calls:
        assert call() == ERROR
        assert "no memory for" in fmu.messages[-1][2]
        assert (place.value, fmu.reals(poor)) == (None, before)
    memory[0] = True
    assert [call() for call in calls] == [OK] * 3
    assert fmu.FreeFMUstate(poor, byref(place)) == fmu.FreeFMUstate(component, byref(state)) == OK
    steps(fmu, poor, 0, 20)
    fmu.FreeInstance(poor)
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
