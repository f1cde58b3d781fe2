"""States of the C models: exact to the last bit, and refused if they are foreign or damaged."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from c_core import TS, CModel, RefusedError


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
