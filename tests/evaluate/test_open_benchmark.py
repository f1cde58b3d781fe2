"""A method of one's own in benchmarks/fit.py: what it sees when, and the samples that judge it."""

import numpy as np

from benchmarks.fit import errors_of
from hybridsep.base.signals import Array


class Hold:
    """The last servo error, held over the window."""

    def fit(self, x_d: Array, x: Array, T_s: float, Np: int) -> None:
        self.seen, self.late = [len(x)], float(x[-1] - x_d[-1])

    def predict(self, x_d: Array) -> Array:
        self.x_d = x_d
        return x_d + self.late

    def update(self, x: Array) -> None:
        self.seen.append(len(x))
        self.late = float(x[-1] - self.x_d[-1])


def test_a_method_sees_the_first_half_and_then_each_window_behind_its_prediction() -> None:
    k, method = np.arange(95.0), Hold()
    errors = errors_of(method, k, k + 0.01 * k, 1e-3, 10)
    assert method.seen == [50, *[10] * 4, 5]
    expected = 0.01 * (k[50:] - (k[50:] // 10 * 10 - 1))  # since the last sample before each window
    np.testing.assert_allclose(errors, expected, atol=1e-12)
