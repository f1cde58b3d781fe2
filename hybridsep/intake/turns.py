"""Check of a rotary axis for positions that are recorded within one turn."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from ..base.signals import Array, Indices
from ..intake import fixes
from ..logs.log import Log
from .finding import ERROR, Finding, Fix, Picture

__all__ = ["check_turns"]

_TURN = 2 * math.pi

_STEPS = 3.0
"""Largest difference of a jump from a whole turn, relative to the largest step between samples that is no jump."""

_SPAN = 1.05
"""Largest range, in turns, of a position modulo one turn with its noise; a wider one was not recorded modulo a turn."""


def check_turns(log: Log) -> Iterator[Finding]:
    """Find jumps of one whole turn in the positions of a rotary axis: they were recorded modulo 360 deg."""
    if log.unit != "rad" or len(log.t) < 2:
        return
    jumps = {"commanded": _jumps(log.x_d), "measured": _jumps(log.x_meas)}
    n = sum(len(where) for where in jumps.values())
    if not n:
        return
    fixed = fixes.unwrapped(log, _TURN)
    # A command may well jump by one turn: the axis then follows it through, and loses it if the jump is taken out.
    if _error(fixed) > _error(log):
        return
    where = np.unique(np.concatenate(list(jumps.values())))
    counts = " and ".join(f"{len(found)} of the {name} position" for name, found in jumps.items() if len(found))
    words = (
        f"{n} jumps of one whole turn (360 deg, 2 pi rad), {counts}; the first is at sample {where[0] + 1}, t = "
        f"{log.t[where[0]]:.6g} s: the axis is recorded modulo one turn, which no model of motion can follow"
    )
    evidence = {
        "n_commanded": float(len(jumps["commanded"])),
        "n_measured": float(len(jumps["measured"])),
        "first": float(where[0]),
    }
    t = log.t - log.t[0]
    factor, unit = log.shown.position
    lines = {"commanded": (t, factor * log.x_d), "measured": (t, factor * log.x_meas)}
    picture = Picture("Whole turns", "time [s]", f"position [{unit}]", lines, t[where])
    fix = Fix("unwrap both positions", partial(fixes.unwrapped, turn=_TURN), meaning=True)
    yield Finding("whole turns", ERROR, words, evidence, picture, fix)


def _jumps(x: Array) -> Indices:
    """Return the samples at which a position, NaN where it is missing, is one turn away from where it was before."""
    known = np.flatnonzero(np.isfinite(x))
    steps = np.diff(x[known])
    if len(known) < 2 or np.ptp(x[known]) > _SPAN * _TURN:
        return np.empty(0, dtype=np.intp)
    far = np.abs(steps) > _TURN / 2
    usual = float(np.abs(steps[~far]).max(initial=0.0))
    off = np.abs(np.abs(steps) - _TURN)
    return np.asarray(known[1:][far & (off <= _STEPS * usual) & (off < _TURN / 2)])


def _error(log: Log) -> float:
    """Return the RMS of the servo error around its median."""
    error = log.x_d - log.x_meas
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean((error - np.median(error)) ** 2))) if len(error) else 0.0
