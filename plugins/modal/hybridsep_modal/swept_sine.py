"""Frequency response from a swept sine: the H1 estimate with its coherence.

The whole record is one window, so that a response which begins and ends at rest has no leakage; cross- and power
spectrum are averaged over neighbouring lines for the coherence, which gives each line's standard deviation.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import median_filter
from scipy.signal import csd

from hybridsep.base.errors import IdentificationError
from hybridsep.base.settings import check
from hybridsep.base.signals import Array, as_samples

COHERENCE_MIN = 0.8
"""Squared coherence below which a line is left out: it would tell little, and its deviation is not well known."""

POWER_MIN = 1e-3  # least power of the command at a line, in multiples of what nine tenths of the lines stay below

SMOOTHED = 9
"""Neighbouring lines over which the spectra are averaged for the coherence; over more of them, a resonance's own slope
would lower it."""

FLOOR = 301  # neighbouring lines whose median is the noise, which is smooth over frequency

_CORRECTION = SMOOTHED / (SMOOTHED - 1)
"""Factor of the noise power that remains after one complex parameter was fitted to each average."""


class Response(NamedTuple):
    """Frequency response with its uncertainty."""

    frequency: Array  # (n,), Hz
    response: NDArray[np.complex128]  # (n,), m/m
    std: Array  # (n,): standard deviation of each line's complex error
    coherence: Array  # (n,): squared coherence


def h1(x_d: ArrayLike, x: ArrayLike, T_s: float, f_min: float = 0.0, f_max: float | None = None) -> Response:
    """Return the H1 estimate ``S_xd,x / S_xd,xd`` at the lines that the command excites.

    ``x_d``, ``x``, (n,): commanded and measured positions, m, or both accelerations; at rest at both ends; ``T_s``:
    sampling interval, s; ``f_min``, ``f_max``: band, Hz; up to half of the Nyquist frequency if ``f_max`` is left
    out. IdentificationError if no line is coherent.
    """
    T_s = check("T_s", T_s)
    u = as_samples(x_d, "x_d")
    y = as_samples(x, "x", len(u))
    top = 0.25 / T_s if f_max is None else min(f_max, 0.5 / T_s)
    if len(u) < 10 * SMOOTHED:
        raise IdentificationError(
            f"this swept sine cannot determine a model, because it has {len(u)} samples; {10 * SMOOTHED} are needed"
        )
    u, y = u - u[0], y - y[0]
    frequency, power = _spectrum(u, u, T_s)
    cross = _spectrum(u, y, T_s)[1]
    out = _spectrum(y, y, T_s)[1].real
    smooth = [np.convolve(part, np.ones(SMOOTHED) / SMOOTHED, mode="same") for part in _demodulated(power, cross, out)]
    coherence = np.abs(smooth[1]) ** 2 / np.maximum(smooth[0].real * smooth[2].real, 1e-300)
    coherence = np.minimum(coherence, 1.0)
    band = (frequency > max(f_min, 0.5 * SMOOTHED * frequency[1])) & (frequency <= top)
    if not band.any():
        raise IdentificationError(f"no line lies between {f_min:g} and {top:g} Hz")
    used = band & (power.real > POWER_MIN * np.quantile(power.real[band], 0.9)) & (coherence > COHERENCE_MIN)
    if not used.any():
        raise IdentificationError(
            "this swept sine cannot determine a model, because the measured signal is not coherent with the commanded "
            f"one (squared coherence at most {coherence[band].max():.2f})"
        )
    noise = smooth[2].real * power.real * (1 - coherence) * _CORRECTION
    floor = median_filter(noise, FLOOR, mode="nearest")
    std = np.sqrt(np.maximum(floor, 1e-24 * out) / power.real)
    return Response(frequency[used], cross[used] / power.real[used], std[used], coherence[used])


def _spectrum(u: Array, y: Array, T_s: float) -> tuple[Array, NDArray[np.complex128]]:
    frequency, power = csd(u, y, fs=1 / T_s, window="boxcar", nperseg=len(u), detrend=False)
    return frequency, np.asarray(power, dtype=np.complex128)


def _demodulated(
    power: NDArray[np.complex128], cross: NDArray[np.complex128], out: Array
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], Array]:
    """Return the spectra normalised by the command's power, so that neighbouring lines count alike."""
    own = np.maximum(power.real, 1e-300)
    return power / own, cross / own, out / own
