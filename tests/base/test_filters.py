"""The filter is SciPy's, to the byte."""

import numpy as np
import scipy.signal

from hybridsep.base.filters import lfilter


def test_filters_are_scipys() -> None:
    x, zi = np.random.default_rng(1).normal(size=(40, 3)), np.ones(2)
    for b, a in (([0.5, 0.2], [1.0, -0.9]), ([0.3, 0.1, 0.4], [1.0]), ([1.0], [2.0, -0.5, 0.1])):
        np.testing.assert_array_equal(lfilter(b, a, x, axis=0), scipy.signal.lfilter(b, a, x, axis=0))
    np.testing.assert_array_equal(lfilter(b, a, x[:, 0], zi=zi)[1], scipy.signal.lfilter(b, a, x[:, 0], zi=zi)[1])
