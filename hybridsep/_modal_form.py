"""From a rational transfer function to the modes of eq. (15)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .errors import ModelError

if TYPE_CHECKING:
    import control

__all__ = ["modes_of"]

Array = NDArray[np.float64]


def modes_of(
    system: control.TransferFunction | control.StateSpace,
) -> list[tuple[float, float, float, float]]:
    """Return ``(f_n, zeta, alpha, beta)`` of each mode; see :meth:`hybridsep.ModalModel.from_control`."""
    import control

    if getattr(system, "ninputs", 1) != 1 or getattr(system, "noutputs", 1) != 1:
        raise ModelError(f"G_pb must have one input and one output, got {system.ninputs} and {system.noutputs}")
    if system.isdtime(strict=True):
        raise ModelError("G_pb must be continuous, got a discrete system; convert it (for example with d2c) first")
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
    poles = np.roots(denominator).astype(np.complex128)
    unstable = poles[poles.real >= 0]
    if unstable.size:
        raise ModelError(f"G_pb must be stable, got a pole at {unstable[0]:.6g} rad/s")

    # In units of a middle frequency the polynomials' coefficients stay near one another.
    scale = float(np.exp(np.mean(np.log(np.abs(poles)))))
    numerator = numerator / denominator[0] * scale ** (np.arange(len(numerator))[::-1] - len(poles) * 1.0)
    quadratics, numerator = _quadratics(poles / scale, numerator)
    numbers = _partial_fractions(quadratics, numerator)
    return [
        (
            float(np.sqrt(quadratic[2]) * scale / (2 * np.pi)),
            float(quadratic[1] / (2 * np.sqrt(quadratic[2]))),
            float(alpha * scale**2),
            float(beta * scale),
        )
        for quadratic, (alpha, beta) in zip(quadratics, numbers, strict=True)
    ]


def _without_rounding(numerator: Array, system: control.StateSpace, length: int) -> Array:
    """Drop leading coefficients that a strictly proper state space has only by rounding."""
    if np.any(system.D):
        return numerator
    padded = np.concatenate((np.zeros(max(0, length - len(numerator))), numerator))
    padded[0] = 0.0
    return np.trim_zeros(padded, "f")


def _quadratics(poles: NDArray[np.complex128], numerator: Array) -> tuple[list[Array], Array]:
    """Group the poles into real quadratic factors; a lone real pole brings a cancelling twin into the numerator."""
    is_complex = np.abs(poles.imag) > 1e-7 * np.abs(poles)
    quadratics = [np.array([1.0, -2 * pole.real, abs(pole) ** 2]) for pole in poles[is_complex] if pole.imag > 0]
    real = sorted(float(pole.real) for pole in poles[~is_complex])
    if len(real) % 2:
        twin = real[-1]
        real.append(twin)
        numerator = np.polymul(numerator, [1.0, -twin])
    quadratics += [np.array([1.0, -a - b, a * b]) for a, b in zip(real[::2], real[1::2], strict=True)]
    return quadratics, numerator


def _partial_fractions(quadratics: list[Array], numerator: Array) -> Array:
    """Solve ``N(s) = Σ_i (α_i + β_i s) Π_{j≠i} D_j(s)`` for the rows ``(α_i, β_i)``."""
    m = len(quadratics)
    columns = []
    for i in range(m):
        rest = np.array([1.0])
        for j, quadratic in enumerate(quadratics):
            if j != i:
                rest = np.asarray(np.polymul(rest, quadratic), dtype=np.float64)
        columns += [_padded(rest, 2 * m), _padded(np.polymul(rest, [1.0, 0.0]), 2 * m)]
    matrix = np.array(columns).T
    if np.linalg.cond(matrix / np.linalg.norm(matrix, axis=0)) > 1e10:
        raise ModelError(
            "G_pb has repeated modes, which a sum of modes as in eq. (15) cannot express; separate them slightly"
        )
    solution: Array = np.linalg.solve(matrix, _padded(numerator, 2 * m))
    return solution.reshape(m, 2)


def _padded(polynomial: Array, length: int) -> Array:
    return np.concatenate((np.zeros(length - len(polynomial)), polynomial))
