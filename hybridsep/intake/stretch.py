"""Stretches of a log that relations are fitted to, and their pictures."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from ..base.signals import Array
from ..logs.log import Log
from .finding import Picture
from .motion import moves
from .relation import Line, shifted

__all__ = ["against_command", "averaged", "over_time", "stretch"]

_STRETCH = 8000
"""Number of samples, with most motion, that relations are fitted to."""

_SPAN = 10 * _STRETCH
"""Samples whose averages relations are fitted to at most: means of ten still show a mode of 50 Hz at 1 kHz."""


def stretch(log: Log) -> slice:
    """Return the samples of one segment, at most :data:`_STRETCH`, in which the command moves most."""
    ends = (*log.starts[1:], len(log.t))
    moved = np.concatenate((np.cumsum(moves(log)) if len(log.x_d) > 1 else [], [0]))
    best, most = slice(0, len(log.t)), -1.0
    for start, end in zip(log.starts, ends, strict=True):
        for first in range(start, max(end - _STRETCH, start) + 1, 1000):
            last = min(end, first + _STRETCH)
            if last - first > 2 and moved[last - 2] - moved[first] > most:
                best, most = slice(first, last), float(moved[last - 2] - moved[first])
    return best


def averaged(log: Log) -> tuple[Array, Array, int]:
    """Return means of the commanded and of the measured position, at most :data:`_STRETCH` each, and of how many.

    They span the segment with most motion, at most :data:`_SPAN` samples of it: a stretch of :func:`stretch` may hold
    nothing but fast motion, as the end of a swept sine does, in which a drive's phase is not near zero.
    """
    fastest = stretch(log)
    i = bisect_right(log.starts, fastest.start) - 1
    start, end = log.starts[i], (*log.starts[1:], len(log.t))[i]
    if end - start > _SPAN:
        start = min(max(start, (fastest.start + fastest.stop - _SPAN) // 2), end - _SPAN)
        end = start + _SPAN
    width = -(-(end - start) // _STRETCH)
    n = (end - start) // width
    x_d, x = (signal[start : start + n * width].reshape(n, width).mean(axis=1) for signal in (log.x_d, log.x_meas))
    return x_d, x, width


def against_command(log: Log, part: slice, fit: Line) -> Picture:
    """Return the picture of measured over commanded positions, and the line through them."""
    factor, unit = log.shown.position
    x_d, x = log.x_d[part], log.x_meas[part]
    ends = np.array([x_d.min(), x_d.max()])
    lines = {"log": (shifted(x_d, fit.lag), x), "fit": (ends, fit.gain * ends + fit.offset), "equal": (ends, ends)}
    lines = {name: (factor * one, factor * other) for name, (one, other) in lines.items()}
    title = "Measured over commanded position"
    return Picture(title, f"commanded [{unit}]", f"measured [{unit}]", lines)


def over_time(
    log: Log, part: slice, one: Array, other: Array, names: tuple[str, str] = ("commanded", "measured")
) -> Picture:
    """Return the picture of two signals around the fastest motion."""
    t = log.t[part] - log.t[0]
    steps = np.abs(np.diff(log.x_d[part]))
    middle = int(np.argmax(steps)) if len(steps) else 0
    near = slice(max(0, middle - 150), middle + 150)
    factor, unit = log.shown.position
    lines = {names[0]: (t[near], factor * one[near]), names[1]: (t[near], factor * other[near])}
    return Picture("Around the fastest motion", "time [s]", f"position [{unit}]", lines)
