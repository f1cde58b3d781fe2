"""Section 3.1 of the paper: disturbances that past residuals determine, and the innovation of others."""

import numpy as np
import pytest
from mechanism import Drive, response, simulate
from mechanism_cases import demonstrate

from hybridsep.model.physics import ModalModel

M, C, K, TS = 1.0, 15.7, 24674.0, 1e-3
N = 1500
DRIVE = Drive.spring_mass_damper(M, C, K, TS)
T = np.asarray(TS * np.arange(N), dtype=np.float64)
X_D = np.asarray(0.005 * (1 - np.cos(4 * np.pi * T)), dtype=np.float64)


def test_the_model_beside_the_disturbance_is_the_librarys() -> None:
    discrete = ModalModel.spring_mass_damper(M, C, K).discretise(TS)
    x_pb, _ = discrete.forced_response(discrete.rest(), X_D)
    run = simulate(DRIVE, X_D, lambda *_: 0.0)
    np.testing.assert_allclose(run.x_pb, x_pb, rtol=0, atol=1e-16)
    np.testing.assert_array_equal(run.e_pb, 0.0)


def test_response_is_eq_8() -> None:
    run = simulate(DRIVE, X_D, lambda k, *_: float(np.cos(k)))
    for k in (0, 1, 2, 3, 400):
        assert response(DRIVE, X_D, run.h, k) == pytest.approx(run.x[k], rel=0, abs=1e-15)


def test_demonstration() -> None:
    cases = demonstrate()
    alone, exact, stairs, friction, ripple, left_out, with_mode, *curves = cases
    for case in cases:
        assert case.closed_form_error < 1e-11 * case.residual_rms
        assert case.residual_rms > 1e-6
    assert exact.n_spikes == 0 < alone.n_spikes
    assert 20 < stairs.n_spikes < 200  # where the jerk of two moves switches
    assert friction.n_spikes == 16  # two after each of 8 changes of direction in 2 s, the start included
    assert ripple.n_spikes == 2  # at the start
    assert with_mode.n_spikes == 0
    assert left_out.n_spikes > 1900
    assert left_out.innovation_rms > 1e-2 * left_out.residual_rms
    assert [case.order for case in curves] == [3, 4, 5]
    for case, limit in zip(curves, (1e-3, 1e-4, 1e-5), strict=True):
        assert case.innovation_rms < limit * case.residual_rms
