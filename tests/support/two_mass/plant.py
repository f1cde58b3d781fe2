"""Simulation of a drive of two masses by drive.c, compiled for this machine."""

import ctypes
import math
from dataclasses import astuple
from functools import cache
from pathlib import Path

import numpy as np
from c_compiler import build_folder, run_compiler
from scipy.linalg import expm

from hybridsep.base.signals import Array
from two_mass.axis import Axis, Friction, LinearLoop

INTERNAL_STEP = 4e-5
"""Longest internal step, s; the bristles of the stiffest friction drawn vibrate at 25 rad in a millisecond."""

_N_STATES = 14  # numbers of drive.c's structure that change, 0 at first, after its parameters


@cache
def _library() -> ctypes.CDLL:
    built = build_folder() / "two_mass.so"
    source = Path(__file__).with_name("drive.c")
    run_compiler(["-O2", "-fPIC", "-shared", source, "-lm", "-o", built])
    library = ctypes.CDLL(str(built))
    library.two_mass_position.restype, library.two_mass_position.argtypes = ctypes.c_double, (ctypes.c_void_p,)
    library.two_mass_step.argtypes = (ctypes.c_void_p, ctypes.c_double)
    library.two_mass_run.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    return library


class TwoMassDrive:
    """A drive at rest at ``start``, m, at first; a plant of the library's co-simulations, too."""

    def __init__(self, axis: Axis, start: float = 0.0) -> None:
        self._library, n = _library(), max(4, math.ceil(axis.T_s / INTERNAL_STEP - 1e-9))
        loops = [_numbers_of(loop, axis.T_s / n) for loop in (axis.loop, axis.changed)]
        frictions = [_friction(one) for one in (axis.motor, axis.bearing)]
        timing = axis.change_at, axis.dead_time, n, axis.T_s / n, axis.interpolates, axis.loop.at_load
        cogging = axis.cogging, 2 * np.pi / axis.cogging_period, axis.cogging_phase
        lead = axis.lead, 2 * np.pi / axis.lead_period, axis.lead_phase
        parts = (*loops, *frictions, timing, (axis.play / 2, axis.force_max), cogging, lead, np.zeros(_N_STATES))
        self._at_rest = np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])
        self.reset(start)

    def reset(self, start: float = 0.0) -> None:
        """Reset the drive to rest at ``start``, m."""
        self._start, self._drive = start, self._at_rest.copy()
        self._at = self._drive.ctypes.data

    @property
    def x(self) -> float:
        """True position where the encoder is, m."""
        return self._start + float(self._library.two_mass_position(self._at))

    def step(self, x_d: float, h: float = 0.0) -> None:
        """Advance by a sampling interval, whatever ``h`` says, with the command ``x_d``, m."""
        self._library.two_mass_step(self._at, x_d - self._start)

    def run(self, x_d: Array) -> Array:
        """Return the positions ``x(k)`` before ``x_d(k)`` acts, ``(n,)``, m."""
        command, x = np.ascontiguousarray(x_d - self._start), np.empty(len(x_d))
        self._library.two_mass_run(self._at, len(x), command.ctypes.data, x.ctypes.data)
        return np.asarray(self._start + x)


def _numbers_of(loop: LinearLoop, h: float) -> Array:
    """Return drive.c's ``linear_loop``: the exact step by ``h``, s, and what its nonlinear parts need."""
    A, B = loop.matrices()
    augmented = np.zeros((11, 11))
    augmented[:6, :6], augmented[:6, 6:] = A * h, B * h
    step = expm(augmented)[:6]
    return np.concatenate((step[:, :6].ravel(), step[:, 6:].ravel(), loop.demand, [loop.stiffness, loop.damping]))


def _friction(of: Friction) -> tuple[float, ...]:
    coulomb, stribeck, v_stribeck, _, micro_damping = astuple(of)
    return coulomb, stribeck, v_stribeck, of.bristle, micro_damping
