"""Hold recomputed from columns that were published: what every implementation and command is compared with."""

from __future__ import annotations

import math

import numpy as np
from stream import Array


def held(x_pb: Array, x_meas: Array, Np: int, *, delay: int = 0, first: int = 0) -> Array:
    """Return ``x_pb`` plus the residual of the last sample measured before each window, (n,), m.

    ``x_meas`` is what was measured at each sample, NaN where missing; it arrived ``delay`` samples later. What is
    measured before sample ``first`` does not count.
    """
    found = []
    for k in range(len(x_pb)):
        known = [i for i in range(first, k // Np * Np - delay) if not math.isnan(x_meas[i])]
        found.append(x_pb[k] + (x_meas[known[-1]] - x_pb[known[-1]] if known else 0.0))
    return np.array(found)
