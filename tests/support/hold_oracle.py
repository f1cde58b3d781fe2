"""Hold recomputed from columns that were published: what every implementation and command is compared with."""

import numpy as np
from stream import Array


def held(x_pb: Array, x_meas: Array, Np: int, *, delay: int = 0, first: int = 0) -> Array:
    """Return ``x_pb`` plus the residual of the last sample measured before each window, (n,), m.

    ``x_meas`` is what was measured at each sample, NaN where missing; it arrived ``delay`` samples later. What is
    measured before sample ``first`` does not count.
    """
    found: Array = x_pb.copy()
    for begin in range(0, len(x_pb), Np):
        known = first + np.flatnonzero(~np.isnan(x_meas[first : max(first, begin - delay)]))
        if len(known):
            found[begin : begin + Np] += x_meas[known[-1]] - x_pb[known[-1]]
    return found
