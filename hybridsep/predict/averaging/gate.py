"""Innovation gate: a measurement is believed, unless the axis cannot have got there.

The residual of an axis grows from sample to sample by no more than the axis and its model move. A value whose residual
is beyond twice the largest so far, by more than a few of the fastest steps of model or commands, is missing. So are
those after it, until as many within reach have followed as there were beyond it: an axis passes by the zero that its
sensor reads. After a second the axis has been moved, or its sensor set, and the value is believed.
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


def gated(
    gate: InnovationGate, e: Array, largest: float, fastest: float, T_s: float
) -> tuple[NDArray[np.bool_], InnovationGate]:
    """Return whether each sample of a window is believed, ``(n,)`` bool, and the gate's state after it.

    Before the first motion, and over the first window that has a residual, all are.

    ``e``, (n,), m: measured residuals, NaN where missing; ``largest``, m: largest residual believed before them;
    ``fastest``, m: largest change from sample to sample, of ``x_pb`` so far or of commands that are known; ``T_s``, s.
    """
    known = largest > 0.0 and fastest > 0.0
    believed, n_missing, n_beyond, farthest = np.isfinite(e), gate.n_missing, gate.n_beyond, gate.farthest
    sizes, patience = np.abs(e), math.ceil(CONSTANTS.patience / T_s)
    if n_beyond == 0 and sizes.max() <= CONSTANTS.gate * (largest + fastest):  # no NaN, and nothing beyond
        return believed, InnovationGate()
    for k, size in enumerate(sizes.tolist()):
        n_missing += 1
        if not believed[k]:
            continue
        beyond = size > CONSTANTS.gate * (largest + fastest)
        n_beyond = n_beyond + 1 if known and beyond else max(n_beyond - 1, 0)
        if n_beyond > 0 and n_missing <= patience:
            believed[k], farthest = False, max(farthest, min(size, PREDICTION_MAX))
        else:
            n_missing, n_beyond, farthest, largest = 0, 0, 0.0, max(largest, size)
    return believed, InnovationGate(n_missing, n_beyond, farthest)
