"""Responses of the parts of a structure to a command, and their free responses, by exact recursive filters."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array
from ..model.discrete import discretised_block
from .structure import Structure

__all__ = ["free_responses", "responses"]


def responses(structure: Structure, theta: Array, u: Array, T_s: float, input_hold: str) -> Array:
    """Return the responses whose weighted sum is the position, ``(n, n_columns)``.

    The static gain of the modes' and the lag's columns is 1, in this order; columns of the zeros, ``ω s/(s² + 2 ζ ω s +
    ω²)``, follow.

    Parameters
    ----------
    structure : Structure
    theta : (order,) array
        Nonlinear parameters.
    u : (n,) array, m
        Command after the dead time, 0 before.
    T_s : float, s
    input_hold : {"zoh", "foh"}
    """
    if structure.order == 0:
        return u[:, None]
    positions, velocities = [], []
    for A, b in _sections(structure, theta):
        A_d, b_d, direct = discretised_block(A, b, T_s, input_hold)
        denominator, numerators = _filters(A_d, b_d, direct)
        positions.append(lfilter(numerators[0], denominator, u))
        if structure.zero and len(b) == 2:
            velocities.append(lfilter(numerators[1], denominator, u))
    return np.column_stack(positions + velocities)


def free_responses(structure: Structure, theta: Array, n: int, T_s: float) -> Array:
    """Return the responses to initial states without a command, ``(n, order)``."""
    impulse = np.eye(1, n)[0]
    columns = []
    for A, b in _sections(structure, theta):
        A_d = discretised_block(A, b, T_s, "zoh")[0]
        denominator = _denominator(A_d)
        columns.append(lfilter([1.0], denominator, impulse))
        if len(b) == 2:
            columns.append(lfilter([0.0, 1.0], denominator, impulse))
    return np.column_stack(columns) if columns else np.empty((n, 0))


def _sections(structure: Structure, theta: Array) -> list[tuple[Array, Array]]:
    """Return ``(A, b)`` of each mode, with the states ``(ω² z, ω ż)``, and of the lag."""
    sections = []
    for i in range(structure.n_modes):
        omega, zeta = np.exp(theta[2 * i]), np.exp(theta[2 * i + 1])
        sections.append((np.array([[0.0, omega], [-omega, -2 * zeta * omega]]), np.array([0.0, omega])))
    if structure.lag:
        rate = np.exp(theta[-1])
        sections.append((np.array([[-rate]]), np.array([rate])))
    return sections


def _denominator(A_d: Array) -> Array:
    if len(A_d) == 1:
        return np.array([1.0, -A_d[0, 0]])
    return np.array([1.0, -A_d[0, 0] - A_d[1, 1], A_d[0, 0] * A_d[1, 1] - A_d[0, 1] * A_d[1, 0]])


def _filters(A_d: Array, b: Array, d: Array) -> tuple[Array, list[Array]]:
    """Return the denominator in z⁻¹ and each state's numerator, of ``(z I − A_d)⁻¹ b + d``."""
    denominator = _denominator(A_d)
    if len(b) == 1:
        return denominator, [np.array([0.0, b[0]]) + d[0] * denominator]
    adjugate = (
        np.array([0.0, b[0], A_d[0, 1] * b[1] - A_d[1, 1] * b[0]]),
        np.array([0.0, b[1], A_d[1, 0] * b[0] - A_d[0, 0] * b[1]]),
    )
    return denominator, [numerator + direct * denominator for numerator, direct in zip(adjugate, d, strict=True)]
