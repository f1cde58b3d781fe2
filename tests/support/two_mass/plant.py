"""Simulation of a drive of two masses by drive.c, compiled for this machine."""

import ctypes
import math
from functools import cache
from pathlib import Path

import numpy as np
from c_compiler import build_folder, run_compiler
from scipy.linalg import expm

from hybridsep.base.signals import Array
from two_mass.axis import Axis, LinearLoop

INTERNAL_STEP = 4e-5
"""Longest internal step, s; the bristles of the stiffest friction drawn vibrate at 25 rad in a millisecond."""

Real = ctypes.c_double


_FRICTION = ("coulomb", "stribeck", "v_stribeck", "bristle", "micro_damping")


class _Loop(ctypes.Structure):
    _fields_ = (("A", Real * 36), ("B", Real * 30), ("demand", Real * 8), ("stiffness", Real), ("damping", Real))


class _Friction(ctypes.Structure):
    _fields_ = tuple((name, Real) for name in _FRICTION)


class _Drive(ctypes.Structure):
    _fields_ = (
        ("loop", _Loop * 2),
        ("friction", _Friction * 2),
        *(
            (name, Real)
            for name in (
                *("change_at", "dead_time", "sub_steps", "h", "interpolates", "at_load", "half_play", "force_max"),
                *("cogging", "cogging_wave", "cogging_phase", "lead", "lead_wave", "lead_phase"),
            )
        ),
        ("x", Real * 6),
        ("deflection", Real * 2),
        ("line", Real * 4),
        ("before", Real),
        ("k", Real),
    )


@cache
def _library() -> ctypes.CDLL:
    built = build_folder() / "two_mass.so"
    source = Path(__file__).with_name("drive.c")
    run_compiler(["-O2", "-fPIC", "-shared", source, "-lm", "-o", built])
    library = ctypes.CDLL(str(built))
    library.two_mass_position.restype = Real
    library.two_mass_step.argtypes = (ctypes.c_void_p, Real)
    return library


class TwoMassDrive:
    """A drive at rest at ``start``, m, at first."""

    def __init__(self, axis: Axis, start: float = 0.0) -> None:
        self._library, self._start = _library(), start
        n = max(4, math.ceil(axis.T_s / INTERNAL_STEP - 1e-9))
        h = axis.T_s / n
        self._drive = drive = _Drive()
        for i, loop in enumerate((axis.loop, axis.changed)):
            _fill(drive.loop[i], loop, h)
        for i, friction in enumerate((axis.motor, axis.bearing)):
            for name in _FRICTION:
                setattr(drive.friction[i], name, getattr(friction, name))
        for name in ("change_at", "dead_time", "interpolates", "force_max", "cogging", "cogging_phase", "lead"):
            setattr(drive, name, float(getattr(axis, name)))
        drive.lead_phase, drive.half_play, drive.at_load = axis.lead_phase, axis.play / 2, float(axis.loop.at_load)
        drive.cogging_wave, drive.lead_wave = 2 * np.pi / axis.cogging_period, 2 * np.pi / axis.lead_period
        drive.sub_steps, drive.h = float(n), h
        self._at = ctypes.addressof(drive)

    @property
    def x(self) -> float:
        """True position where the encoder is, m."""
        return self._start + float(self._library.two_mass_position(ctypes.byref(self._drive)))

    def step(self, x_d: float) -> None:
        """Advance by a sampling interval with the command ``x_d``, m."""
        self._library.two_mass_step(self._at, x_d - self._start)

    def run(self, x_d: Array) -> Array:
        """Return the positions ``x(k)`` before ``x_d(k)`` acts, ``(n,)``, m."""
        command, x = np.ascontiguousarray(x_d - self._start), np.empty(len(x_d))
        pointer = ctypes.POINTER(Real)
        arguments = (command.ctypes.data_as(pointer), x.ctypes.data_as(pointer))
        self._library.two_mass_run(ctypes.byref(self._drive), len(x), *arguments)
        return np.asarray(self._start + x)


def _fill(table: _Loop, loop: LinearLoop, h: float) -> None:
    """Write the exact step by ``h``, s, of the linear loop."""
    A, B = loop.matrices()
    augmented = np.zeros((11, 11))
    augmented[:6, :6], augmented[:6, 6:] = A * h, B * h
    step = expm(augmented)
    table.A[:], table.B[:] = step[:6, :6].ravel().tolist(), step[:6, 6:].ravel().tolist()
    table.demand[:] = loop.demand.tolist()
    table.stiffness, table.damping = loop.stiffness, loop.damping
