"""Decimation of drawn lines: the minimum and the maximum of each stretch stay, so that no peak is lost."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..base.signals import Indices

__all__ = ["drawn_places"]


def drawn_places(columns: int, *rows: ArrayLike) -> Indices:
    """Return the indices at which lines are drawn: the extremes in each of so many columns of pixels.

    Parameters
    ----------
    columns : int
        Columns of pixels that the lines take.
    *rows : (n,) array_like
        Lines over one abscissa; unknown where NaN. A column without any known sample stays a gap.

    Returns
    -------
    (m,) array
        Ascending, the first and the last among them; all where there are at most two for each column.
    """
    lines = [np.asarray(row, dtype=np.float64) for row in rows]
    n = len(lines[0])
    if n <= 2 * columns:
        return np.arange(n)
    keep = {0, n - 1}
    for begin, end in pairwise(np.linspace(0, n, columns + 1).astype(np.intp).tolist()):
        for line in lines:
            stretch = line[begin:end]
            if np.isnan(stretch).all():
                keep.add(begin)
            else:
                keep |= {begin + int(np.nanargmin(stretch)), begin + int(np.nanargmax(stretch))}
    return np.array(sorted(keep))
