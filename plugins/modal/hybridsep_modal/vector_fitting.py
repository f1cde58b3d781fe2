"""Poles of a frequency response by relaxed vector fitting, in real arithmetic.

B. Gustavsen, A. Semlyen, IEEE Trans. Power Delivery 14 (1999) 1052; relaxed: B. Gustavsen, IEEE Trans. Power Delivery
21 (2006) 1587. With starting poles ``a``, ``σ(s) H(s) ≈ Σ c_i/(s − a_i)`` and ``σ(s) = d + Σ c̃_i/(s − a_i)`` are linear
in ``c, c̃, d``; the zeros of σ are the next poles.
"""

import numpy as np
from numpy.typing import NDArray

from hybridsep.base.signals import Array

Complex = NDArray[np.complex128]

ITERATIONS_MAX = 25
"""Largest number of relocations; without noise ten are enough, with noise the poles then wander within their spread."""

_CONVERGED = 1e-9  # relative movement of the poles at which the relocation ends
_ZETA_START = 0.01  # damping ratio of the starting poles, as recommended by the authors


def starting_poles(omega: Array, n_modes: int) -> Complex:
    """Return the upper half of lightly damped pole pairs over the band of the lines, ``(n_modes,)``, rad/s."""
    centres = np.geomspace(omega[omega > 0].min(), omega.max(), n_modes + 2)[1:-1]
    return np.asarray(centres * (-_ZETA_START + 1j * np.sqrt(1 - _ZETA_START**2)), dtype=np.complex128)


def vector_fit(omega: Array, response: Complex, weight: Array, poles: Complex) -> Complex:
    """Return stable poles of a strictly proper model of the response, real ones and the upper half of the pairs.

    ``omega``: (n,), rad/s: angular frequencies of the lines; ``response``, (n,); ``weight``, (n,): of each line's
    error, for example ``1/|response|``; ``poles``: (m,), rad/s: starting poles: real ones and the upper half of the
    pairs.
    """
    scale = float(np.sqrt(omega[omega > 0].min() * omega.max()))
    s = np.asarray(1j * omega / scale, dtype=np.complex128)
    poles = np.asarray(poles / scale, dtype=np.complex128)
    for _ in range(ITERATIONS_MAX):
        relocated = _relocated(s, response, weight, poles)
        done = len(relocated) == len(poles) and np.allclose(
            _ordered(relocated), _ordered(poles), rtol=_CONVERGED, atol=0.0
        )
        poles = relocated
        if done:
            break
    return poles * scale


def _relocated(s: Complex, response: Complex, weight: Array, poles: Complex) -> Complex:
    basis = _basis(s, poles)
    m = basis.shape[1]
    # Columns: c of the numerator, then c̃ and d of σ, times −H
    sigma = np.column_stack((basis, np.ones(len(s))))
    rows = weight[:, None] * np.column_stack((basis, -response[:, None] * sigma))
    matrix = np.concatenate((rows.real, rows.imag))
    # Relaxation: the mean of σ over the lines is 1
    size = float(np.linalg.norm(weight * response)) / len(s)
    mean = np.concatenate((np.zeros(m), sigma.sum(axis=0).real)) * size
    norms = np.linalg.norm(matrix, axis=0)
    norms[norms == 0] = 1.0
    target = np.concatenate((np.zeros(len(matrix)), [len(s) * size]))
    solution = np.linalg.lstsq(np.vstack((matrix, mean)) / norms, target, rcond=None)[0] / norms
    residues, d = solution[m : 2 * m], solution[2 * m]
    if abs(d) < 1e-8:
        d = 1e-8 if d >= 0 else -1e-8
    A, b = _realised(poles)
    zeros = np.linalg.eigvals(A - np.outer(b, residues) / d)
    zeros = np.where(zeros.real > 0, -zeros.conj(), zeros)  # unstable ones are reflected
    zeros = zeros.real * np.where(zeros.real == 0, 0.0, 1.0) + 1j * zeros.imag
    zeros[zeros.real == 0] -= 1e-9
    return zeros[zeros.imag >= 0].astype(np.complex128)


def _basis(s: Complex, poles: Complex) -> Complex:
    """Return the partial fractions of real poles and, for each pair, their sum and their difference times j."""
    columns: list[Complex] = []
    for pole in poles:
        if pole.imag == 0:
            columns.append(1 / (s - pole))
        else:
            one, other = 1 / (s - pole), 1 / (s - pole.conjugate())
            columns += [one + other, 1j * one - 1j * other]
    return np.column_stack(columns)


def _realised(poles: Complex) -> tuple[Array, Array]:
    """Return ``(A, b)`` of the real state space whose outputs are the basis."""
    size = sum(1 if pole.imag == 0 else 2 for pole in poles)
    A, b = np.zeros((size, size)), np.zeros(size)
    i = 0
    for pole in poles:
        if pole.imag == 0:
            A[i, i], b[i] = pole.real, 1.0
            i += 1
        else:
            A[i : i + 2, i : i + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            b[i] = 2.0
            i += 2
    return A, b


def _ordered(poles: Complex) -> Complex:
    return poles[np.lexsort((poles.real, poles.imag))]
