"""Weighted least-squares fits of eq. (15) to a frequency response, with growing numbers of modes.

The deviations are the Cramér–Rao bounds. A mode has the parameters ``log ω, log ζ``, static gain ``g = α/ω²`` and
``h = β/ω``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode

from .vector_fitting import starting_poles, vector_fit

Complex = NDArray[np.complex128]

MODES_MAX = 10  # most modes that are tried where their number is not given
PATIENCE = 2  # numbers of modes without a smaller criterion after which the search ends
EXACT = 1e-9  # relative error that counts as none: rounding in the file, or a response that was computed
THINNED = 1500  # lines that vector fitting uses, about; the polish uses all
PASSES = 3  # passes in which weights and the hold's part follow the last fit; each reduces their error a hundredfold
ROUGH = 40  # evaluations of a fit from one of several starts, of which the best is refined
_MARGIN = 3.0  # distance of log ω from the lines, beyond which a mode is straight within them
_LOG_ZETA = (-11.0, 7.0)  # range of log ζ
_FAST = 10.0  # ratio of the second pole, which starts a mode from a single real pole, to the first


@dataclass(frozen=True)
class ModalFit:
    """Modes fitted to a frequency response."""

    parameters: Array  # (n_modes, 4): ``log ω, log ζ, g, h`` of each mode, ω in rad/s, by ascending ω
    # (4 n_modes, 4 n_modes): inverse of the Fisher information for errors of unit variance of each weighted line's real
    # and imaginary part
    covariance: Array
    residual: Complex  # (n,): weighted error of each line
    fitted: Complex  # (n,): response of the modes

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

    ``omega``: (n,), rad/s; ``response``, (n,); ``weight``, (n,): reciprocal standard deviation of each line, up to a
    factor; ``poles``, (n_modes, 2): ``log ω, log ζ`` to start from; ``unit_gain``: whether the static gains sum to 1;
    ``iterations``: largest number of evaluations.
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


@dataclass(frozen=True)
class Lines:
    """Frequency response to fit to."""

    omega: Array  # (n,), rad/s
    response: Complex  # (n,): without the dead time
    sigma: Array  # (n,): standard deviations up to a factor
    relative: bool  # whether they are proportional to the magnitude; the fitted magnitude is then the better weight
    unit_gain: bool
    # sampling interval and hold, where the response was measured on sampled signals
    sampling: tuple[float, str] | None

    def fit(self, start: Complex) -> ModalFit:
        """Return the fit from starting poles, the hold's part taken without what sampling folds back."""
        part = np.ones(len(self.omega)) if self.sampling is None else _hold(self.omega, *self.sampling)
        continuous, weight = self.response / part, np.abs(part) / self.sigma
        thin = slice(None, None, max(1, len(self.omega) // THINNED))
        poles = vector_fit(self.omega[thin], continuous[thin], weight[thin], start)
        quadratics = quadratics_of(poles)
        return polish(self.omega, continuous, weight, quadratics, unit_gain=self.unit_gain, iterations=ROUGH)

    def refine(self, fit: ModalFit) -> tuple[ModalFit, Complex]:
        """Return the fit with its own weights and the hold's exact part, and that part."""
        part = np.ones(len(self.omega), dtype=np.complex128)
        for _ in range(PASSES if self.relative or self.sampling else 0):
            if self.sampling is not None:
                part = _sampled_part(fit, self.omega, *self.sampling)
            weight = 1 / np.abs(fit.fitted) if self.relative else np.abs(part) / self.sigma
            fit = polish(*(self.omega, self.response / part, weight, fit.parameters[:, :2]), unit_gain=self.unit_gain)
        return fit, part

    def criterion(self, fit: ModalFit, n_effective: float | None = None) -> float:
        """Return the Bayesian information criterion, of ``n_effective`` independent values if errors are correlated."""
        n = 2 * len(self.omega)
        counted = n if n_effective is None else n_effective
        return float(counted * np.log(max(fit.cost, 1e-300) / n) + fit.parameters.size * np.log(counted))

    def relative_error(self, fit: ModalFit, part: Complex) -> float:
        """Return the RMS of the relative error."""
        return float(np.sqrt(np.mean(np.abs(fit.fitted * part / self.response - 1) ** 2)))


def fits_by_size(
    lines: Lines, counts: Sequence[int] | range, progress: Callable[[str, float], object]
) -> list[tuple[ModalFit, Complex]]:
    """Return the fits with each number of modes, with the hold's part, until the criterion grows."""
    fits: list[tuple[ModalFit, Complex]] = []
    best, since = np.inf, 0
    for i, m in enumerate(counts):
        progress(f"{m} modes", i / len(counts))
        tried = [lines.fit(start) for start in _starts(lines.omega, m, fits[-1][0] if fits else None)]
        fits.append(lines.refine(min(tried, key=lambda fit: fit.cost)))
        criterion = lines.criterion(fits[-1][0])
        best, since = (criterion, 0) if criterion < best else (best, since + 1)
        if since >= PATIENCE or lines.relative_error(*fits[-1]) < EXACT:
            break
    return fits


def _starts(omega: Array, n_modes: int, last: ModalFit | None) -> list[Complex]:
    """Return starting poles: spread over the band, by ratio or evenly, or the last fit's and its worst line's."""
    spread = starting_poles(omega, n_modes)
    even = np.linspace(omega[0], omega[-1], n_modes + 2)[1:-1] / np.abs(spread) * spread
    starts = [spread, even]
    if last is not None:
        centres = np.append(np.exp(last.parameters[:, 0]), omega[np.argmax(np.abs(last.residual))])
        starts.append(np.sort(centres) * spread / np.abs(spread))
    return starts


def _hold(omega: Array, T_s: float, input_hold: str) -> Complex:
    """Return the hold's own response, without the images that sampling folds back."""
    box = np.sinc(omega * T_s / (2 * np.pi))
    part = box * np.exp(-0.5j * omega * T_s) if input_hold == "zoh" else box**2
    return np.asarray(part, dtype=np.complex128)


def _sampled_part(fit: ModalFit, omega: Array, T_s: float, input_hold: str) -> Complex:
    """Return the sampled response under the hold over the continuous one."""
    discrete = ModalModel(fit.modes()).discretise(T_s, input_hold, block=1)
    z = np.exp(1j * omega * T_s)
    resolvent = z[:, None, None] * np.eye(len(discrete.b)) - discrete.A
    states = np.linalg.solve(resolvent, np.tile(discrete.b[:, None], (len(z), 1, 1)))[:, :, 0]
    return np.asarray((states @ discrete.c + discrete.d) / fit.fitted)
