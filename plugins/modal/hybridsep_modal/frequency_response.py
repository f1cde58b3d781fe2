"""Identification of ``G_pb`` from a frequency response: vector fitting for the poles, then weighted least squares.

The response is position over position. Acceleration over acceleration is the same ratio, as is velocity over velocity:
numerator and denominator are differentiated alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybridsep.base.errors import IdentificationError, ParameterError
from hybridsep.base.settings import check
from hybridsep.base.signals import Array
from hybridsep.base.threads import one_blas_thread
from hybridsep.identify.model import Estimate, machine_of
from hybridsep.identify.selection import slow_parts
from hybridsep.machines.machine import Machine
from hybridsep.model.physics import ModalModel

from .fit import MODES_MAX, Complex, Lines, ModalFit, fits_by_size

LINES_MIN = 8  # lines below which nothing is fitted

WORTH = 10.0
"""Decrease of the criterion from which more modes are taken, very strong evidence by Kass and Raftery, J. Am. Stat.
Assoc. 90 (1995) 773."""

DEVIATIONS = 3.0  # standard deviations by which a damping ratio is above 0, at least

FRICTION_WORTH = 0.6
"""Ratio of the weighted errors, with and without them, at which modes that do not oscillate, or slow modes that zeros
all but cancel, are taken beside others: modes that fit friction in a swept sine leave 0.9, a true real pole less than
0.1."""


@dataclass(frozen=True)
class IdentifiedResponse:
    """Model identified from a frequency response."""

    model: ModalModel  # ``G_pb`` of eq. (15), with the dead time that was given
    input_hold: str  # {"zoh", "foh"}: hold for the machine file
    T_s: float  # sampling interval for the machine file, s
    # ``f_n``, ``zeta``, ``alpha``, ``beta`` of each mode and the static gain, with Cramér–Rao standard deviations
    parameters: tuple[Estimate, ...]
    frequency: Array  # (n,), Hz: lines that were used
    # (n,): measured response, and the model's
    response: Complex
    fitted: Complex
    # standard deviation of a line's error in multiples of its given one, or of its magnitude if none was given
    noise: float
    # each (int, float, float): number of modes, RMS of the relative error, Bayesian information criterion
    criteria: tuple[tuple[int, float, float], ...]
    findings: tuple[str, ...]  # what a user should know, in words
    phase_measured: bool = True  # whether the response has the phase that was measured; else it is only the magnitude

    def machine(self, name: str, title: str, **entries: Any) -> Machine:
        """Return the machine with this model, as :meth:`IdentifiedModel.machine` does."""
        return machine_of(self.model, self.input_hold, self.T_s, name, title, **entries)

    def summary(self) -> dict[str, Any]:
        """Return plain values for JSON and tables."""
        return {
            "T_s": self.T_s,
            "input_hold": self.input_hold,
            "dead_time": self.model.dead_time,
            "modes": [vars(mode) for mode in self.model.modes],
            "parameters": [vars(estimate) for estimate in self.parameters],
            "n_lines": len(self.frequency),
            "noise": self.noise,
            "criteria": [dict(zip(("n_modes", "rms_relative", "bic"), row, strict=True)) for row in self.criteria],
            "findings": list(self.findings),
        }


@one_blas_thread
def identify_frequency_response(
    frequency: ArrayLike,
    response: ArrayLike,
    *,
    std: ArrayLike | None = None,
    n_modes: int | None = None,
    unit_gain: bool = False,
    T_s: float = 1e-3,
    input_hold: str = "zoh",
    dead_time: int = 0,
    sampled: bool = False,
    progress: Callable[[str, float], object] = lambda _message, _done: None,
) -> IdentifiedResponse:
    """Identify the physics model from a frequency response.

    ``frequency``, (n,), Hz: lines in any order; lines at 0, and where the response is 0 or not finite, are left out;
    ``response``: (n,) array_like, m/m; ``std``, (n,): standard deviation of each line's complex error; a constant
    part of its magnitude if left out; ``n_modes``: number of modes; by the Bayesian information criterion  if left
    out; ``unit_gain``: whether the static gain is 1; ``T_s``: sampling interval of the machine, s; ``input_hold``:
    {"zoh", "foh"}; ``dead_time``: whole samples of dead time in the response; ``sampled``: whether the response was
    measured on sampled signals, so that it contains the hold; ``progress``: called with a message and the fraction
    done. IdentificationError if there are too few lines; ParameterError if a parameter is out of its range.
    """
    T_s, input_hold = check("T_s", T_s), check("input_hold", input_hold)
    dead_time = check("dead_time", dead_time)
    f, G, sigma = _usable(frequency, response, std)
    if n_modes is not None and not 1 <= n_modes <= len(f) // 4:
        raise ParameterError(f"n_modes must be 1 … {len(f) // 4} for {len(f)} lines, got {n_modes}")
    omega = 2 * np.pi * f
    counts = range(1, min(MODES_MAX, len(f) // 4) + 1) if n_modes is None else [n_modes]
    delay = np.exp(1j * omega * dead_time * T_s)
    lines = Lines(omega, G * delay, sigma, std is None, unit_gain, (T_s, input_hold) if sampled else None)
    fits = fits_by_size(lines, counts, progress)
    best, part = fits[_best_fit(lines, fits)]
    model = ModalModel(best.modes(), dead_time)
    noise = float(np.sqrt(best.cost / max(1, 2 * len(f) - best.n_free))) * np.sqrt(2.0)
    return IdentifiedResponse(
        model=model,
        input_hold=input_hold,
        T_s=T_s,
        parameters=_estimates(best, noise if std is None else max(noise, 1.0)),
        frequency=f,
        response=G,
        fitted=np.asarray(best.fitted * part / delay),
        noise=noise,
        criteria=tuple(
            (len(fit.parameters), lines.relative_error(fit, part), lines.criterion(fit)) for fit, part in fits
        ),
        findings=tuple(_findings(best, f, noise, std is not None) + _doubts(best, lines)),
    )


def _usable(frequency: ArrayLike, response: ArrayLike, std: ArrayLike | None) -> tuple[Array, Complex, Array]:
    """Return the usable lines by ascending frequency, with each one's standard deviation up to a factor."""
    f = np.asarray(frequency, dtype=np.float64).ravel()
    G = np.asarray(response, dtype=np.complex128).ravel()
    sigma = np.abs(G) if std is None else np.asarray(std, dtype=np.float64).ravel()
    if not len(f) == len(G) == len(sigma):
        raise IdentificationError(
            f"a frequency response needs as many frequencies as values and deviations, got {len(f)}, {len(G)} and "
            f"{len(sigma)}"
        )
    usable = np.isfinite(f) & np.isfinite(G) & np.isfinite(sigma) & (f > 0) & (np.abs(G) > 0) & (sigma > 0)
    order = np.argsort(f[usable], kind="stable")
    f, G, sigma = f[usable][order], G[usable][order], sigma[usable][order]
    if len(f) < LINES_MIN or f[0] == f[-1]:
        raise IdentificationError(
            f"this frequency response cannot determine a model, because it has {len(f)} usable lines; at least "
            f"{LINES_MIN} at frequencies above 0 are needed"
        )
    return f, G, sigma


def _best_fit(lines: Lines, fits: Sequence[tuple[ModalFit, Complex]]) -> int:
    """Return the index of the fit to take among fits with growing numbers of modes."""
    n_effective = max(_independent(fit) for fit, _ in fits)  # too few modes leave errors that are alike
    sound = [i for i, (fit, _) in enumerate(fits) if i == 0 or not _doubtful_modes(fit, lines)]
    chosen = _by_criterion(lines, fits, sound, n_effective)
    plain = [i for i in sound if i == 0 or not _like_friction(fits[i][0])]
    other = _by_criterion(lines, fits, plain, n_effective)
    return chosen if fits[chosen][0].cost <= FRICTION_WORTH**2 * fits[other][0].cost else other


def _like_friction(fit: ModalFit) -> bool:
    modes = fit.modes()
    return any(mode.zeta >= 1.0 for mode in modes) or bool(slow_parts(modes))


def _doubtful_modes(fit: ModalFit, lines: Lines) -> list[int]:
    """Return the modes that oscillate and whose damping ratio is not significantly above 0."""
    scale = fit.cost / max(1, 2 * len(lines.omega) - fit.n_free)  # variance of each real or imaginary part
    log_zeta = fit.parameters[:, 1]
    std = np.sqrt(np.maximum(scale * np.diag(fit.covariance)[1::4], 0.0))  # of log ζ, so relative to ζ
    return [int(i) for i in np.flatnonzero((log_zeta < 0.0) & (DEVIATIONS * std > 1.0))]


def _by_criterion(
    lines: Lines, fits: Sequence[tuple[ModalFit, Complex]], places: Sequence[int], n_effective: float
) -> int:
    chosen = places[0]
    values = {i: lines.criterion(fits[i][0], n_effective) for i in places}
    for i in places[1:]:
        if values[i] < values[chosen] - WORTH:
            chosen = i
    return chosen


def _independent(fit: ModalFit) -> float:
    """Return the number of real values that tell as much as the lines, whose errors may be correlated."""
    r = fit.residual
    n, power = len(r), fit.cost
    total = 1.0
    for lag in range(1, n // 2):
        correlation = float((r[lag:] @ r[:-lag].conj()).real) / power if power > 0.0 else 0.0
        if correlation < 2.0 / np.sqrt(n):
            break
        total += 2.0 * correlation
    return 2.0 * n / total


def _estimates(fit: ModalFit, noise: float) -> tuple[Estimate, ...]:
    """Return the parameters with Cramér–Rao deviations for a complex error of that standard deviation a line."""
    covariance = fit.covariance * noise**2 / 2  # real and imaginary part have half of the variance each
    found = []
    for i, (log_omega, log_zeta, g, h) in enumerate(fit.parameters):
        own = covariance[4 * i : 4 * i + 4, 4 * i : 4 * i + 4]
        omega, zeta = np.exp(log_omega), np.exp(log_zeta)
        alpha, beta = g * omega**2, h * omega
        slopes = {
            "f_n": (omega / (2 * np.pi), [omega / (2 * np.pi), 0, 0, 0], "Hz"),
            "zeta": (zeta, [0, zeta, 0, 0], "1"),
            "alpha": (alpha, [2 * alpha, 0, omega**2, 0], "1/s2"),
            "beta": (beta, [beta, 0, 0, omega], "1/s"),
        }
        for name, (value, slope, unit) in slopes.items():
            variance = float(np.asarray(slope) @ own @ np.asarray(slope))
            found.append(Estimate(f"mode[{i + 1}].{name}", float(value), float(np.sqrt(max(variance, 0.0))), unit))
    gains = np.arange(2, fit.parameters.size, 4)
    variance = float(covariance[np.ix_(gains, gains)].sum())
    found.append(Estimate("gain", float(fit.parameters[:, 2].sum()), float(np.sqrt(max(variance, 0.0))), "1"))
    return tuple(found)


def _doubts(fit: ModalFit, lines: Lines) -> list[str]:
    """Return findings on modes that may be errors of single lines, as where their number is given."""
    frequencies = np.exp(fit.parameters[:, 0]) / (2 * np.pi)
    return [
        f"the damping of mode[{i + 1}], {frequencies[i]:.4g} Hz, is not significantly above 0: the mode may be one "
        "line's error"
        for i in _doubtful_modes(fit, lines)
    ]


def _findings(fit: ModalFit, f: Array, noise: float, std_given: bool) -> list[str]:
    findings = []
    frequencies = np.exp(fit.parameters[:, 0]) / (2 * np.pi)
    outside = [value for value in frequencies if not f[0] <= value <= f[-1]]
    if outside:
        values = ", ".join(f"{value:.4g} Hz" for value in outside)
        findings.append(f"modes outside of the lines ({f[0]:g} … {f[-1]:g} Hz) stand for what is beyond them: {values}")
    gain = float(fit.parameters[:, 2].sum())
    if abs(gain - 1) > 0.02:
        findings.append(f"the static gain is {gain:.4g}; position over position should have 1")
    if std_given and noise > 2:
        findings.append(f"the errors are {noise:.1f} times as large as the given deviations: the axis is no linear one")
    return findings
