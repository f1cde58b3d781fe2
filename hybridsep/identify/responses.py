"""Responses of the parts of a structure to a command, and their free responses, by exact recursive filters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array
from ..model.discrete import discretised_block
from .structure import Structure

__all__ = ["Section", "free_responses", "responses", "sections_of"]


class Section(NamedTuple):
    """Discrete mode or lag: ``s(k+1) = A s(k) + b u(k)``, its states being ``s + d u``.

    The first state is the response with a static gain of 1, the second one of a mode ``ω s/(s² + 2 ζ ω s + ω²)``.
    """

    A: Array
    b: Array
    d: Array

    @property
    def denominator(self) -> Array:
        """Coefficients in z⁻¹."""
        if len(self.b) == 1:
            return np.array([1.0, -self.A[0, 0]])
        A = self.A
        return np.array([1.0, -A[0, 0] - A[1, 1], A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]])

    def numerators(self) -> list[Array]:
        """Return each state's coefficients in z⁻¹, of ``(z I − A)⁻¹ b + d``."""
        A, b = self.A, self.b
        if len(b) == 1:
            adjugate = [np.array([0.0, b[0]])]
        else:
            adjugate = [
                np.array([0.0, b[0], A[0, 1] * b[1] - A[1, 1] * b[0]]),
                np.array([0.0, b[1], A[1, 0] * b[0] - A[0, 0] * b[1]]),
            ]
        return [part + d * self.denominator for part, d in zip(adjugate, self.d, strict=True)]


def sections_of(structure: Structure, theta: Array, T_s: float, input_hold: str) -> list[Section]:
    """Return the modes and the lag of a structure with nonlinear parameters ``theta``, ``(order,)``."""
    sections = []
    for i in range(structure.n_modes):
        omega, zeta = np.exp(theta[2 * i]), np.exp(theta[2 * i + 1])
        A, b = np.array([[0.0, omega], [-omega, -2 * zeta * omega]]), np.array([0.0, omega])
        sections.append(Section(*discretised_block(A, b, T_s, input_hold)))
    if structure.lag:
        rate = np.exp(theta[-1])
        sections.append(Section(*discretised_block(np.array([[-rate]]), np.array([rate]), T_s, input_hold)))
    return sections


def responses(structure: Structure, sections: Sequence[Section], u: Array) -> Array:
    """Return the responses whose weighted sum is the position, ``(n, n_columns)``, m.

    First the responses of modes and lag, with a static gain of 1, then the responses of the modes' zeros.

    Parameters
    ----------
    structure : Structure
    sections : sequence of Section
        From :func:`sections_of`.
    u : (n,) array, m
        Command after the dead time, 0 before.
    """
    if not sections:
        return u[:, None]
    positions, velocities = [], []
    for section in sections:
        numerators, denominator = section.numerators(), section.denominator
        positions.append(lfilter(numerators[0], denominator, u))
        if structure.zero and len(numerators) == 2:
            velocities.append(lfilter(numerators[1], denominator, u))
    return np.column_stack(positions + velocities)


def free_responses(sections: Sequence[Section], n: int) -> Array:
    """Return the responses to initial states without a command, ``(n, order)``."""
    impulse = np.eye(1, n)[0]
    columns = [
        lfilter(np.eye(1, len(section.b), i)[0], section.denominator, impulse)
        for section in sections
        for i in range(len(section.b))
    ]
    return np.column_stack(columns) if columns else np.empty((n, 0))
