"""Innovation gate: a measurement is believed, unless the axis cannot have got there.

The residual of an axis grows from sample to sample by no more than the axis and its model move, and by a step of a
coarse sensor. A value whose residual is beyond twice the largest so far, by more than a few of these steps, is missing.
So are the values after it, until as many within reach have followed as there were beyond it: an axis passes by the zero
that its sensor reads. After a second the axis has been moved, or its sensor set, and the value is believed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.signals import PREDICTION_MAX, Array
from .constants import CONSTANTS


@dataclass(frozen=True)
class InnovationGate:
    """What is known of the samples before a window."""

    n_missing: int = 0  # samples since the last one that was believed
    n_beyond: int = 0  # of these, values beyond the gate, less the values within it that followed
    farthest: float = 0.0  # m: largest residual out of reach among them
    last: float = 0.0  # m: last measured position of the run; 0: none yet
    finest: float = 0.0  # m: the least change of it from sample to sample that is one; 0: none yet


def gated(
    gate: InnovationGate, x: Array, x_pb: Array, largest: float, fastest: float, T_s: float
) -> tuple[NDArray[np.bool_], InnovationGate]:
    """Return whether each sample of a window is believed, ``(n,)`` bool, and the gate's state after it.

    Before the first motion, and over the first window that has a residual, all are.

    ``x``, ``x_pb``, (n,), m: positions, measured, NaN where missing, and of the physics model; ``largest``, m: largest
    residual believed before them; ``fastest``, m: largest change of ``x_pb`` from sample to sample so far, of the
    window, too; ``T_s``, s.
    """
    known, patience = largest > 0.0 and fastest > 0.0, math.ceil(CONSTANTS.patience / T_s)
    believed, n_missing, n_beyond, farthest = np.isfinite(x), gate.n_missing, gate.n_beyond, gate.farthest
    sizes, measured, finest = np.abs(x - x_pb), x[believed], np.zeros(len(x))
    before = np.append(gate.last, measured)
    changes = np.where((before[:-1] != 0.0) & (np.diff(before) != 0.0), np.abs(np.diff(before)), np.inf)
    least = np.minimum.accumulate(np.append(gate.finest or np.inf, changes))
    least[np.isinf(least)] = 0.0
    finest[believed], last = least[1:], float(before[-1])
    if n_beyond == 0 and sizes.max() <= CONSTANTS.gate * (largest + fastest):  # no NaN, and nothing beyond
        return believed, InnovationGate(last=last, finest=float(least[-1]))
    for k, size in enumerate(sizes.tolist()):
        n_missing += 1
        if not believed[k]:
            continue
        beyond = size > CONSTANTS.gate * (largest + fastest + finest[k])
        n_beyond = n_beyond + 1 if known and beyond else max(n_beyond - 1, 0)
        if n_beyond > 0 and n_missing <= patience:
            believed[k], farthest = False, max(farthest, min(size, PREDICTION_MAX))
        else:
            n_missing, n_beyond, farthest, largest = 0, 0, 0.0, max(largest, size)
    return believed, InnovationGate(n_missing, n_beyond, farthest, last, float(least[-1]))
