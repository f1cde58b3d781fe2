"""Input shapers and zero-phase error tracking as peers; the contour error."""

from __future__ import annotations

import numpy as np
import pytest
from compensator_cases import MODEL, TS, move

from benchmarks.compensation.peers import input_shaper, shape, zero_phase_command
from hybridsep.machines.machine import load_machine


@pytest.mark.parametrize("kind", ["zv", "zvd"])
def test_a_shaper_leaves_no_vibration_in_its_model(kind: str) -> None:
    discrete = MODEL.discretise(TS, "zoh")
    step = np.concatenate((np.zeros(10), np.full(400, 0.01)))
    shaper = input_shaper(MODEL, TS, kind)
    assert np.sum(shaper) == pytest.approx(1.0)
    plain, _ = discrete.forced_response(discrete.rest(), step)
    shaped, _ = discrete.forced_response(discrete.rest(), shape(step, shaper))
    assert np.ptp(shaped[100:]) < 0.02 * np.ptp(plain[100:])


@pytest.mark.parametrize("name", ["spring_mass_damper", "als25010_x", "als25010_y"])
def test_zero_phase_error_tracking_follows_on_its_model(name: str) -> None:
    discrete = load_machine(name).new_predictor().discrete
    x_d = move(600)
    reached, _ = discrete.forced_response(discrete.rest(), zero_phase_command(x_d, discrete))
    # What is left is the zero-phase filter B⁻(z) B⁻(1/z) / B⁻(1)² of the zeros outside the unit circle.
    den, impulse = np.poly(discrete.A), discrete.impulse_response(len(discrete.b) + 1)
    num = np.convolve(den, impulse)[1 : len(den)]
    zeros = np.roots(num)
    outside = np.atleast_1d(np.poly(zeros[np.abs(zeros) > 1.0]))
    m = len(outside) - 1
    padded = np.pad(x_d, m, mode="edge")
    expected = np.convolve(padded, np.convolve(outside, outside[::-1]) / np.sum(outside) ** 2, "valid")
    plain, _ = discrete.forced_response(discrete.rest(), x_d)
    error = np.std(plain - x_d)
    assert np.max(np.abs(reached - expected)) < 1e-4 * error
    assert np.std(reached - x_d) < 0.102 * error
