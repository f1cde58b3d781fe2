"""Fits of a frequency response with growing numbers of modes, of continuous or of sampled signals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array
from ..model.physics import ModalModel
from .modal_fit import ModalFit, polish, quadratics_of
from .vector_fitting import starting_poles, vector_fit

__all__ = ["MODES_MAX", "Complex", "Lines", "fits_by_size"]

Complex = NDArray[np.complex128]

MODES_MAX = 10
"""Most modes that are tried where their number is not given."""

PATIENCE = 2
"""Numbers of modes without a smaller criterion after which the search ends."""

EXACT = 1e-9
"""Relative error that counts as none: rounding in the file, or a response that was computed."""

THINNED = 1500
"""Lines that vector fitting uses, about; the polish uses all."""

PASSES = 3
"""Passes in which weights and the hold's part follow the last fit; each reduces their error a hundredfold."""

ROUGH = 40
"""Evaluations of a fit from one of several starts, of which the best is refined."""


@dataclass(frozen=True)
class Lines:
    """Frequency response to fit to.

    Attributes
    ----------
    omega : (n,) array, rad/s
    response : (n,) array of complex
        Without the dead time.
    sigma : (n,) array
        Standard deviations up to a factor.
    relative : bool
        Whether they are proportional to the magnitude; the fitted magnitude is then the better weight.
    unit_gain : bool
    sampling : (float, str) or None
        Sampling interval and hold, where the response was measured on sampled signals.
    """

    omega: Array
    response: Complex
    sigma: Array
    relative: bool
    unit_gain: bool
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
