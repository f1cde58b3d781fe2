"""Modal decomposition of a rational transfer function into eq. (15), by partial fractions."""

from __future__ import annotations

from functools import reduce
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..base.errors import ModelError

if TYPE_CHECKING:
    import control

__all__ = ["modes_of"]

Array = NDArray[np.float64]

REPEATED = 1e-3
"""Relative distance below which two poles count as repeated: rounding splits a fivefold one by 7e-4."""

_REPEATED_MODES = "G_pb has repeated modes, which a sum of modes as in eq. (15) cannot express; separate them slightly"


def modes_of(
    system: control.TransferFunction | control.StateSpace,
) -> list[tuple[float, float, float, float]]:
    """Return ``(f_n, zeta, alpha, beta)`` of each mode; see :meth:`hybridsep.ModalModel.from_control`."""
    import control

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        raise ModelError(f"G_pb must be a TransferFunction or StateSpace, got {type(system).__name__}")
    if system.ninputs != 1 or system.noutputs != 1:
        raise ModelError(f"G_pb must have one input and one output, got {system.ninputs} and {system.noutputs}")
    if system.isdtime(strict=True):
        raise ModelError("G_pb must be continuous, got a discrete system; convert it (for example with d2c) first")
    _require_finite(system)
    tf = control.tf(system)
    numerator = np.trim_zeros(np.atleast_1d(np.asarray(tf.num[0][0], dtype=float)), "f")
    denominator = np.trim_zeros(np.atleast_1d(np.asarray(tf.den[0][0], dtype=float)), "f")
    if isinstance(system, control.StateSpace):
        numerator = _without_rounding(numerator, system, len(denominator))
    if len(numerator) >= len(denominator):
        raise ModelError(
            "G_pb must be strictly proper, got a numerator of degree "
            f"{len(numerator) - 1} over a denominator of degree {len(denominator) - 1}"
        )
    if not numerator.size:
        raise ModelError("G_pb must not be zero, got a zero transfer function")
    poles = np.roots(denominator).astype(np.complex128)
    unstable = poles[poles.real >= 0]
    if unstable.size:
        raise ModelError(f"G_pb must be stable, got a pole at {unstable[0]:.6g} rad/s")

    # Frequencies normalised by their geometric mean keep the coefficients at a similar magnitude
    scale = float(np.exp(np.mean(np.log(np.abs(poles)))))
    numerator = numerator / denominator[0] * scale ** (np.arange(len(numerator))[::-1] - len(poles) * 1.0)
    quadratics, numerator = _quadratics(poles / scale, numerator)
    numbers = _partial_fractions(quadratics, numerator)
    modes = [
        (
            float(np.sqrt(quadratic[2]) * scale / (2 * np.pi)),
            float(quadratic[1] / (2 * np.sqrt(quadratic[2]))),
            float(alpha * scale**2),
            float(beta * scale),
        )
        for quadratic, (alpha, beta) in zip(quadratics, numbers, strict=True)
    ]
    _require_faithful(modes, tf, np.abs(poles))
    return modes


def _without_rounding(numerator: Array, system: control.StateSpace, length: int) -> Array:
    """Drop the leading coefficient that a strictly proper state space has only by rounding."""
    if np.any(system.D):
        return numerator
    padded = np.concatenate((np.zeros(max(0, length - len(numerator))), numerator))
    padded[0] = 0.0
    return np.trim_zeros(padded, "f")


def _quadratics(poles: NDArray[np.complex128], numerator: Array) -> tuple[list[Array], Array]:
    """Group the poles into real quadratic factors; an unpaired real pole is doubled and cancelled in the numerator."""
    is_complex = np.abs(poles.imag) > 1e-7 * np.abs(poles)
    quadratics = [np.array([1.0, -2 * pole.real, abs(pole) ** 2]) for pole in poles[is_complex] if pole.imag > 0]
    real = sorted(float(pole.real) for pole in poles[~is_complex])
    while len(real) > 1:  # the closest pair first, so that a double pole stays in one factor
        i = min(range(len(real) - 1), key=lambda i: real[i] / real[i + 1])
        a, b = real.pop(i), real.pop(i)
        quadratics.append(np.array([1.0, -a - b, a * b]))
    for a in real:
        quadratics.append(np.array([1.0, -2 * a, a * a]))
        numerator = np.asarray(np.polymul(numerator, [1.0, -a]), dtype=np.float64)
    return quadratics, numerator


def _partial_fractions(quadratics: list[Array], numerator: Array) -> Array:
    """Solve ``N(s) = Σ_i (α_i + β_i s) Π_{j≠i} D_j(s)`` for the rows ``(α_i, β_i)``."""
    m = len(quadratics)
    _require_distinct(quadratics)
    columns = []
    for i in range(m):
        rest = reduce(np.polymul, quadratics[:i] + quadratics[i + 1 :], np.array([1.0]))
        columns += [_padded(rest, 2 * m), _padded(np.polymul(rest, [1.0, 0.0]), 2 * m)]
    solution: Array = np.linalg.solve(np.array(columns).T, _padded(numerator, 2 * m))
    return solution.reshape(m, 2)


def _require_distinct(quadratics: list[Array]) -> None:
    """Raise ModelError for a pole in two factors; ``np.roots`` splits a k-fold pole by about ``ε^(1/k)``."""
    for others, some in combinations(map(np.roots, quadratics), 2):
        if np.any(np.abs(some[:, None] - others[None, :]) < REPEATED * np.abs(others)):
            raise ModelError(_REPEATED_MODES)


def _require_faithful(
    modes: list[tuple[float, float, float, float]], tf: control.TransferFunction, magnitudes: Array
) -> None:
    """Raise ModelError if the modes' frequency response is not the system's, as for a pole of high multiplicity."""
    s = 1j * np.geomspace(0.1 * magnitudes.min(), 10 * magnitudes.max(), 100)
    G = np.zeros(len(s), dtype=np.complex128)
    for f_n, zeta, alpha, beta in modes:
        omega = 2 * np.pi * f_n
        G += (alpha + beta * s) / (s**2 + 2 * zeta * omega * s + omega**2)
    expected = np.polyval(tf.num[0][0], s) / np.polyval(tf.den[0][0], s)
    if not np.max(np.abs(G - expected)) < 1e-6 * np.max(np.abs(expected)):
        raise ModelError(_REPEATED_MODES)


def _require_finite(system: control.TransferFunction | control.StateSpace) -> None:
    """Raise ModelError if a coefficient is NaN or infinite."""
    import control

    if isinstance(system, control.StateSpace):
        parts = [system.A, system.B, system.C, system.D]
    else:
        parts = [system.num[0][0], system.den[0][0]]
    if not all(np.isfinite(part).all() for part in parts):
        raise ModelError("G_pb must have finite coefficients, got NaN or infinity among them")


def _padded(polynomial: Array, length: int) -> Array:
    return np.concatenate((np.zeros(length - len(polynomial)), polynomial))
