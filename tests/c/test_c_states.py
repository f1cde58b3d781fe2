"""States of the C models: exact to the last bit, and refused if they are foreign or damaged."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import staircase_data as staircase
from c_core import TS, CModel, RefusedError, write_trajectory


def steppable(name: str, folder: Path) -> tuple[CModel, Callable[[int], None]]:
    """Return an initialised model and what steps it at sample k with inputs of its own."""
    write_trajectory(folder, staircase.commanded()[:2000])
    model = CModel(name, resources=folder).initialise()

    def step(k: int) -> None:
        for key, values in (("x_d_ahead", staircase.commanded()), ("x_d", staircase.commanded())):
            if key in model.place and not (key == "x_d" and "x_d_ahead" in model.place):
                model[key] = float(values[k])
        if "x_d_ahead" in model.place:
            model["x_meas"] = float(staircase.measured(0)[k])
        model.step(k * TS)

    return model, step


@pytest.mark.parametrize("name", ["predictor", "compensator", "feed_drive", "stage_drive", "trajectory"])
def test_foreign_truncated_and_damaged_states_are_refused(name: str, tmp_path: Path) -> None:
    model, step = steppable(name, tmp_path)
    step(0)
    blob = model.state.tobytes()
    with pytest.raises(RefusedError, match=f"must have {len(blob)} bytes, got {len(blob) - 8}; it is truncated"):
        model.check_state(blob[:-8])
    with pytest.raises(RefusedError, match=r"must have \d+ bytes, got 0"):
        model.check_state(b"")
    with pytest.raises(RefusedError, match="belongs to another model"):
        model.check_state(b"\x00" + blob[1:])
    with pytest.raises(RefusedError, match="must be of version 29, got 30"):
        model.check_state(blob[:8] + struct.pack("<Q", 30) + blob[16:])
    with pytest.raises(RefusedError, match="saved with other parameters"):
        model.check_state(blob[:24] + struct.pack("<Q", 2) + blob[32:])
    if name != "feed_drive":  # its state has no numbers that must fit together
        middle = {
            "predictor": 32 + 40 + 16,
            "compensator": 32 + 40 + 16,
            "stage_drive": 32 + 8 + 24 + 64 + 40 + 32,
            "trajectory": 32 + 40,
        }[name]
        with pytest.raises(RefusedError, match="the state is inconsistent: it is damaged"):
            model.check_state(blob[:middle] + struct.pack("<Q", 2**60) + blob[middle + 8 :])


def test_a_state_of_other_parameters_is_refused() -> None:
    blob = CModel("predictor", {"lambda": 1e-9}).initialise().state.tobytes()
    with pytest.raises(RefusedError, match="saved with other parameters"):
        CModel("predictor").initialise().check_state(blob)


@pytest.mark.slow
def test_damaged_states_with_averaging_are_refused_or_can_be_used() -> None:
    values = {"averaging": 1.0, "Np": 5, "p": 2, "q": 1, "dead_time": 2}
    model = CModel("predictor", values).initialise()
    for k in range(23):
        model["x_d_ahead"], model["x_meas"] = 1e-3 * np.sin(0.1 * k), 1e-3 * np.sin(0.1 * k - 0.7)
        model.step(k * TS)
    state = model.state.copy()
    refused = 0
    for place in (*range(4, 100), *range(100, len(state), 97)):  # structs, and some of all arrays
        for wrong in (2.0**60, -1.0, np.inf, np.nan, float(np.uint64(2**60).view(np.float64))):
            damaged = state.copy()
            damaged[place] = wrong
            try:
                model.check_state(damaged.tobytes())
            except RefusedError:
                refused += 1
                continue
            other = CModel("predictor", values)
            other.state = damaged
            with suppress(RefusedError):  # what was learned may be nonsense, but no memory is touched
                for k in range(23, 30):
                    other.step(k * TS)
    assert refused > 100
    model.check_state(state.tobytes())
