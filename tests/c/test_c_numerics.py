"""The C core's discretised modes and its regression against extended precision. Each test states its tolerance."""

import ctypes

import c_core
import mpmath
import numpy as np
import oracle
import pytest
import staircase_data as staircase
from c_core import TS, pointer
from stream import PREDICTOR

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

MODES = {
    "under-damped": (25.0, 0.05, 24674.0, 15.7),
    "lightly damped": (37.0, 0.01, 102687.3, 8.83),
    "critical": (19.0, 1.0, 14412.0, 0.0),
    "nearly critical": (19.0, 1.0 + 1e-9, 14412.0, 30.0),
    "over-damped": (30.0, 4.0, 35530.0, 10.0),
    "stiff": (300.0, 50.0, 3.5e6, 100.0),
    "slow": (1e-3, 0.7, 3.9e-5, 0.0),
    "near the sampling rate": (480.0, 0.1, 9.1e6, 0.0),
}


class DiscreteMode(ctypes.Structure):
    """hsep_discrete_mode."""

    _fields_ = tuple((name, ctypes.c_double * n) for name, n in (("A", 4), ("b", 2), ("c", 2), ("d", 1), ("s", 2)))


def exact_matrices(f_n: float, zeta: float, alpha: float, beta: float, hold: str) -> dict[str, Array]:
    """Return A, b, c, d of one mode between samples, eq. (15), from forty digits."""
    with mpmath.workdps(40):
        w = 2 * mpmath.pi * mpmath.mpf(f_n)
        M = mpmath.zeros(4)
        M[0, 1], M[1, 0], M[1, 1] = w * TS, -w * TS, -2 * mpmath.mpf(zeta) * w * TS
        M[1, 2], M[2, 3] = w * TS, 1
        exponential = mpmath.expm(M)
        A, g1, g2 = exponential[:2, :2], exponential[:2, 2], exponential[:2, 3]
        c = mpmath.matrix([[mpmath.mpf(alpha) / w**2, mpmath.mpf(beta) / w]])
        b, d = (g1, mpmath.zeros(1)) if hold == "zoh" else (A * g2 + g1 - g2, c * g2)
        return {name: np.array(list(map(float, part))) for name, part in (("A", A), ("b", b), ("c", c), ("d", d))}


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("damping", list(MODES))
def test_a_mode_is_discretised_to_the_last_digits(damping: str, hold: str) -> None:
    # Against forty digits: each matrix to 1e-14 of its largest entry, the entries that are not tiny to 1e-13 of
    # themselves.
    mode = DiscreteMode()
    c_core.library(PREDICTOR).hsep_discretise(
        ctypes.byref(mode), (ctypes.c_double * 4)(*MODES[damping]), ctypes.c_double(TS), ctypes.c_int(hold == "foh")
    )
    for name, entries in exact_matrices(*MODES[damping], hold).items():
        got, atol = np.array(getattr(mode, name)), 1e-14 * np.max(np.abs(entries))
        np.testing.assert_allclose(got, entries, rtol=1e-13, atol=atol, err_msg=name)
    np.testing.assert_array_equal(np.array(mode.s), 0.0)


class CRegression:
    """hsep_regression."""

    def __init__(self, n: int, lam: float) -> None:
        self.library, self.n = c_core.library(PREDICTOR), n
        self.block = np.zeros(int(self.library.hsep_regression_size(ctypes.c_uint64(n))) // 8)
        self._block = pointer(self.block)
        self.library.hsep_regression_init(self._block, ctypes.c_uint64(n), ctypes.c_double(lam))

    def fold(self, rows: Array, target: Array, repetitions: int = 1) -> None:
        stacked = np.ascontiguousarray(np.column_stack((rows, target)))
        count = ctypes.c_size_t(len(rows))
        self.library.test_fold(self._block, pointer(stacked), count, ctypes.c_size_t(repetitions))

    @property
    def weights(self) -> Array:
        w = np.empty(self.n)
        self.library.hsep_regression_solve(self._block, pointer(w))
        return w


def test_rows_that_outweigh_all_before_them_lose_nothing() -> None:
    # Each row a million times the one before and nearly parallel to it: rotations with a cosine near 0, where the
    # cheap form of the update would be wrong. 1e-9 relative.
    rng = np.random.default_rng(1)
    n, m = 6, 60
    base = rng.normal(size=n)
    rows = (base + 1e-3 * rng.normal(size=(m, n))) * (10.0 ** np.tile([-6.0, 0.0, 6.0], m // 3))[:, None]
    target = rows @ rng.normal(size=n) * (1 + 1e-2 * rng.normal(size=m))
    regression = CRegression(n, 1e-6)
    regression.fold(rows, target)
    exact = oracle.ridge_extended(rows, target, 1e-6).astype(float)
    assert np.linalg.norm(regression.weights - exact) <= 1e-9 * np.linalg.norm(exact)


def staircase_rows(p: int, q: int, n: int) -> tuple[Array, Array]:
    """Return rows of features, (n, 2 + q + p), and their targets, (n,), of the measured staircase."""
    discrete = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0).discretise(TS)
    x_pb, _ = discrete.forced_response(discrete.rest(), staircase.commanded())
    e_pb = staircase.measured(0) - x_pb
    rows, positions, residuals = range(200, 200 + n), x_pb.tolist(), e_pb.tolist()  # the lags before them are there
    return np.array([oracle.features(positions, residuals, k, p, q) for k in rows]), e_pb[rows]


@pytest.mark.slow
def test_the_weights_keep_their_digits_over_a_million_samples() -> None:
    # n = 55: 1e-9 relative against extended precision. m times the same rows are the rows times sqrt(m).
    rows, target = staircase_rows(50, 3, 5000)
    regression = CRegression(55, 1e-12)
    regression.fold(rows, target, repetitions=200)
    scale = np.sqrt(np.longdouble(200))
    exact = oracle.ridge_extended((rows * scale).astype(np.longdouble), (target * scale).astype(np.longdouble), 1e-12)
    error = np.linalg.norm((regression.weights - exact).astype(float)) / np.linalg.norm(exact.astype(float))
    assert error <= 1e-9
