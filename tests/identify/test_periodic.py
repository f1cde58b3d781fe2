"""Spectrum of a residual over position."""

import numpy as np
import pytest
from scipy.signal import lombscargle

from hybridsep.identify.periodic import _spectrum


def test_the_spectrum_is_lomb_and_scargles() -> None:
    rng = np.random.default_rng(0)
    s, lowest, width = rng.uniform(0.0, 0.3, 500), 10.0, 0.7
    e = np.sin(2.0 * np.pi * s / 0.0113) + rng.normal(0.0, 0.3, 500)
    lines = 2.0 * np.pi * (lowest + width * np.arange(300))
    # what a wave explains of the residual's square is twice that power
    np.testing.assert_allclose(_spectrum(s, e, lowest, width, 300), 2.0 * lombscargle(s, e, lines), rtol=1e-9)


@pytest.mark.parametrize("lowest", [500.0, 1000.0])
def test_positions_on_a_grid_have_a_finite_spectrum(lowest: float) -> None:
    s = 1e-3 * np.arange(400.0)  # sine or cosine of these lines is 0 at all of them
    found = _spectrum(s, np.sin(2.0 * np.pi * s / 0.0113), lowest, 0.5, 3)
    assert np.isfinite(found).all()
    assert found.max() <= 400.0
