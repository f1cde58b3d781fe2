"""The C core's physics model against the library and extended precision. Each test states its tolerance."""

import ctypes
from typing import Any

import c_core
import mpmath
import numpy as np
import pytest
import staircase_data as staircase
from c_core import TS
from numpy.typing import NDArray

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode

LongArray = NDArray[np.longdouble]

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


def c_mode(*numbers: float) -> Any:
    return (ctypes.c_double * len(numbers))(*numbers)


class CPhysics:
    """hsep_physics."""

    def __init__(self, modes: list[tuple[float, float, float, float]], dead_time: int, hold: str) -> None:
        self.library = c_core.library("predictor")
        n, d = ctypes.c_uint64(len(modes)), ctypes.c_uint64(dead_time)
        self.block = np.zeros(int(self.library.hsep_physics_size(n, d)) // 8)
        flat = c_mode(*(number for mode in modes for number in mode))
        self.library.hsep_physics_init(self._block, flat, n, d, ctypes.c_double(TS), ctypes.c_int(hold == "foh"))

    @property
    def _block(self) -> Any:
        return self.block.ctypes.data_as(ctypes.c_void_p)

    def forced_response(self, x_d: Array) -> Array:
        x_pb = np.empty_like(x_d)
        pointers = (x_d.ctypes.data_as(ctypes.c_void_p), x_pb.ctypes.data_as(ctypes.c_void_p))
        self.library.hsep_physics_forced_response(self._block, *pointers, ctypes.c_size_t(len(x_d)))
        return x_pb


def exact_matrices(f_n: float, zeta: float, alpha: float, beta: float, hold: str) -> dict[str, LongArray]:
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
        texts = {name: [mpmath.nstr(x, 30) for x in part] for name, part in (("A", A), ("b", b), ("c", c), ("d", d))}
    shapes = {"A": (2, 2), "b": (2,), "c": (2,), "d": (1,)}
    return {name: np.array([np.longdouble(x) for x in part]).reshape(shapes[name]) for name, part in texts.items()}


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("damping", list(MODES))
def test_a_mode_is_discretised_to_the_last_digits(damping: str, hold: str) -> None:
    # Against forty digits: each matrix to 1e-14 of its largest entry, the entries that are not tiny to 1e-13 of
    # themselves.
    f_n, zeta, alpha, beta = MODES[damping]
    mode = DiscreteMode()
    c_core.library("predictor").hsep_discretise(
        ctypes.byref(mode), c_mode(f_n, zeta, alpha, beta), ctypes.c_double(TS), ctypes.c_int(hold == "foh")
    )
    for name, entries in exact_matrices(f_n, zeta, alpha, beta, hold).items():
        got, expected = np.array(getattr(mode, name)), entries.ravel().astype(float)
        np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-14 * np.max(np.abs(expected)), err_msg=name)
    np.testing.assert_array_equal(np.array(mode.s), 0.0)


@pytest.mark.parametrize("dead_time", [0, 7])
@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("damping", list(MODES))
def test_the_physics_model_answers_as_the_library_does(damping: str, hold: str, dead_time: int) -> None:
    # 1e-14 of the largest position for each ten samples that a mode remembers, rounding of A accumulating over them;
    # 1e-12 for the stiff mode, where SciPy's expm is the one that loses digits (2e-13, the core 2e-15).
    modes = [MODES[damping], (98.0, 0.05, 5000.0, 0.0)]
    x_d = staircase.commanded()[:1200]
    discrete = ModalModel([Mode(*mode) for mode in modes], dead_time).discretise(TS, hold)
    expected, _ = discrete.forced_response(discrete.rest(), x_d)
    core = CPhysics(modes, dead_time, hold)
    got = np.concatenate(
        (core.forced_response(x_d[:1]), core.forced_response(x_d[1:500]), core.forced_response(x_d[500:]))
    )
    tolerance = 1e-12 if damping == "stiff" else remembered(modes)
    assert np.max(np.abs(got - expected)) <= tolerance * np.max(np.abs(expected))


def remembered(modes: list[tuple[float, float, float, float]]) -> float:
    """Return 1e-14 for each ten samples of the slowest decay, of at most 1200."""
    slowest = [min(zeta, 1 / (2 * zeta)) * 2 * np.pi * f_n * TS for f_n, zeta, _, _ in modes]
    return 1e-14 * max(1.0, min(1200.0, 1 / min(slowest)) / 10)
