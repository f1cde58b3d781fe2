"""Weighted least-squares fit of eq. (15) to a frequency response, with Cramér–Rao standard deviations.

A mode has the parameters ``log ω, log ζ``, static gain ``g = α/ω²`` and ``h = β/ω``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ..base.signals import Array
from ..model.physics import Mode

__all__ = ["ModalFit", "polish", "quadratics_of"]

Complex = NDArray[np.complex128]

_MARGIN = 3.0
"""Distance of log ω from the lines, beyond which a mode is straight within them."""

_LOG_ZETA = (-11.0, 7.0)
"""Range of log ζ."""

_FAST = 10.0
"""Ratio of the second pole, which starts a mode from a single real pole, to the first."""


@dataclass(frozen=True)
class ModalFit:
    """Modes fitted to a frequency response.

    Attributes
    ----------
    parameters : (n_modes, 4) array
        ``log ω, log ζ, g, h`` of each mode, ω in rad/s, by ascending ω.
    covariance : (4 n_modes, 4 n_modes) array
        Inverse of the Fisher information for errors of unit variance of each weighted line's real and imaginary part.
    residual : (n,) array of complex
        Weighted error of each line.
    fitted : (n,) array of complex
        Response of the modes.
    """

    parameters: Array
    covariance: Array
    residual: Complex
    fitted: Complex

    @property
    def n_free(self) -> int:
        """Number of free parameters."""
        return int(np.linalg.matrix_rank(self.covariance)) if self.covariance.size else 0

    @property
    def cost(self) -> float:
        """Sum of squared weighted errors."""
        return float(np.sum(np.abs(self.residual) ** 2))

    def modes(self) -> list[Mode]:
        """Return the modes of eq. (15)."""
        return [
            Mode(omega / (2 * np.pi), zeta, g * omega**2, h * omega)
            for omega, zeta, g, h in np.column_stack((np.exp(self.parameters[:, :2]), self.parameters[:, 2:]))
        ]


def quadratics_of(poles: Complex) -> Array:
    """Return ``log ω, log ζ`` of the modes with these poles, real ones in pairs, ``(n_modes, 2)``."""
    pairs = [(abs(pole), -pole.real / abs(pole)) for pole in poles if pole.imag > 0]
    real = sorted(-pole.real for pole in poles if pole.imag == 0)
    if len(real) % 2:
        real.append(_FAST * real[-1])
    for slow, fast in zip(real[::2], real[1::2], strict=True):
        omega = np.sqrt(slow * fast)
        pairs.append((omega, (slow + fast) / (2 * omega)))
    return np.log(np.array(pairs)).reshape(-1, 2)


def polish(
    omega: Array, response: Complex, weight: Array, poles: Array, *, unit_gain: bool, iterations: int = 200
) -> ModalFit:
    """Return the least-squares fit that starts from poles.

    Parameters
    ----------
    omega : (n,) array, rad/s
    response : (n,) array of complex
    weight : (n,) array
        Reciprocal standard deviation of each line, up to a factor.
    poles : (n_modes, 2) array
        ``log ω, log ζ`` to start from.
    unit_gain : bool
        Whether the static gains sum to 1.
    iterations : int
        Largest number of evaluations.
    """
    s = np.asarray(1j * omega, dtype=np.complex128)
    start = np.column_stack((poles, _numerators(s, response, weight, poles, unit_gain)))
    embed = _embedding(len(poles), unit_gain)

    def parameters(free: Array) -> Array:
        full = embed @ free
        if unit_gain:
            full[-2] += 1.0
        modes = full.reshape(-1, 4)
        modes[:, 0] = np.clip(modes[:, 0], np.log(omega[0]) - _MARGIN, np.log(omega[-1]) + _MARGIN)
        modes[:, 1] = np.clip(modes[:, 1], *_LOG_ZETA)
        return np.asarray(modes)

    def residual(free: Array) -> Array:
        return _stacked(weight * (_response(s, parameters(free)) - response))

    def jacobian(free: Array) -> Array:
        return _stacked(weight[:, None] * _derivatives(s, parameters(free))) @ embed

    free = start.ravel()[_free(len(poles), unit_gain)]
    solution = least_squares(
        residual,
        free,
        jac=jacobian,
        method="lm",
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=iterations,
    )
    found = parameters(solution.x)
    order = np.argsort(found[:, 0])
    slopes = jacobian(solution.x)
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0] = 1.0
    slopes /= scale
    inverse = embed @ (np.linalg.pinv(slopes.T @ slopes, hermitian=True) / np.outer(scale, scale)) @ embed.T
    places = (4 * order[:, None] + np.arange(4)).ravel()
    fitted = _response(s, found)
    return ModalFit(found[order], inverse[np.ix_(places, places)], weight * (response - fitted), fitted)


def _free(n_modes: int, unit_gain: bool) -> NDArray[np.intp]:
    """Return the places of the free parameters: all but the last mode's gain, if the gains sum to 1."""
    places = np.arange(4 * n_modes)
    return places[places != 4 * n_modes - 2] if unit_gain else places


def _embedding(n_modes: int, unit_gain: bool) -> Array:
    """Return the derivative of all parameters with respect to the free ones."""
    embed = np.eye(4 * n_modes)[:, _free(n_modes, unit_gain)]
    if unit_gain:
        embed[-2, 2:-1:4] = -1.0  # g of the last mode is 1 less the others
    return embed


def _response(s: Complex, parameters: Array) -> Complex:
    """Return eq. (15) at ``s``."""
    omega, zeta = np.exp(parameters[:, 0]), np.exp(parameters[:, 1])
    numerators = parameters[:, 2] * omega**2 + parameters[:, 3] * omega * s[:, None]
    return np.asarray((numerators / _denominators(s, omega, zeta)).sum(axis=1))


def _denominators(s: Complex, omega: Array, zeta: Array) -> Complex:
    return np.asarray(s[:, None] ** 2 + 2 * zeta * omega * s[:, None] + omega**2, dtype=np.complex128)


def _derivatives(s: Complex, parameters: Array) -> Complex:
    """Return the derivatives of eq. (15) with respect to all parameters, ``(n, 4 n_modes)``."""
    omega, zeta, g, h = np.exp(parameters[:, 0]), np.exp(parameters[:, 1]), parameters[:, 2], parameters[:, 3]
    column = s[:, None]
    below = _denominators(s, omega, zeta)
    mode = (g * omega**2 + h * omega * column) / below
    by_omega = (2 * g * omega**2 + h * omega * column - mode * (2 * zeta * omega * column + 2 * omega**2)) / below
    by_zeta = -mode * 2 * zeta * omega * column / below
    parts = np.stack((by_omega, by_zeta, omega**2 / below, omega * column / below), axis=2)
    return parts.reshape(len(s), -1)


def _numerators(s: Complex, response: Complex, weight: Array, poles: Array, unit_gain: bool) -> Array:
    """Return ``g, h`` of modes with given poles by linear least squares, ``(n_modes, 2)``."""
    m = len(poles)
    linear = np.column_stack((poles, np.zeros((m, 2))))
    columns = _derivatives(s, linear).reshape(len(s), m, 4)[:, :, 2:].reshape(len(s), -1)
    target = response
    if unit_gain:
        last = columns[:, -2]
        target = response - last
        columns = columns - np.where(np.arange(2 * m) % 2 == 0, last[:, None], 0.0)
    matrix = _stacked(weight[:, None] * columns)
    norms = np.linalg.norm(matrix, axis=0)
    norms[norms == 0] = 1.0
    solution = np.linalg.lstsq(matrix / norms, _stacked(weight * target), rcond=None)[0] / norms
    if unit_gain:
        solution[-2] = 1.0 - solution[:-2:2].sum()
    return np.asarray(solution.reshape(m, 2))


def _stacked(values: Complex) -> Array:
    return np.concatenate((values.real, values.imag))
