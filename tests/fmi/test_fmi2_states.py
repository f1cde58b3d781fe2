"""States of a native FMU through its FMI 2.0 functions, damaged and foreign ones too."""

from __future__ import annotations

import re
from collections.abc import Callable
from ctypes import byref, c_size_t, c_void_p
from pathlib import Path

import pytest
from fmi2_driving import STATES, component_in, library_of, steps
from fmi2_library import ERROR, OK, Library, repair_checksum


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


@pytest.mark.slow
def test_damaged_truncated_and_foreign_states_are_refused(fmu: Library, folders: Callable[[str], Path]) -> None:
    component = component_in(fmu, "stepping")
    steps(fmu, component, 0, 230)
    block = fmu.save(component)
    before = fmu.reals(component)
    for place in (*range(130), *range(130, len(block), 487)):
        damaged = bytearray(block)
        damaged[place] ^= 0x10
        assert fmu.restore(component, bytes(damaged)) == ERROR
    for length in (0, 1, 119, 120, 500, len(block) - 1):
        assert fmu.restore(component, block[:length]) == ERROR
    assert fmu.restore(component, block + b"\0") == ERROR
    other = library_of(folders("HybridPredictor_als25010_x"))
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
