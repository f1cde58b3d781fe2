"""What the tests of FMUs share: signals and how an instance is driven."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from staircase_data import commanded, measured

from hybridsep import FmuInstance

Array = NDArray[np.float64]
TS = 1e-3


def drive(instance: FmuInstance, r: Array, x: Array, first: int, last: int, start_time: float = 0.0) -> Array:
    """Step samples ``first … last − 1``; return the outputs at ``t_{k+1}``, ``(n, 6)``."""
    write = instance.real_writer(["x_d_ahead", "x_meas"])
    read = instance.real_reader(["x_d", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h"])
    rows = []
    for k in range(first, last):
        write([float(r[k]), float(x[k])])
        instance.step(start_time + k * TS, TS)
        rows.append(read())
    return np.array(rows)


def delayed(shift: float = 0.0, n: int = 6101) -> tuple[Array, Array]:
    """Return ``r(k)`` and the measurement of a drive that gets it 100 samples later."""
    r = np.concatenate((commanded(), np.full(100, commanded()[-1])))[:n] + shift
    x = np.concatenate((np.full(100, commanded()[0]), measured(0)))[:n] + shift
    return r, x
