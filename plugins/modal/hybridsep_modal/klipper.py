"""Klipper's accelerometer files: natural frequency and damping of an axis from its resonance test.

``TEST_RESONANCES`` shakes an axis with an acceleration ``accel_per_hz · f`` while ``f`` rises, and writes
``#time,accel_x,accel_y,accel_z`` in s and mm/s². The commanded motion is not in the file, so that there is no phase:
what can be identified is the magnitude of the response, and from it one mode with a static gain of 1. For more, record
commanded and measured acceleration together (:mod:`~hybridsep.identify.swept_sine`).
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import welch

from hybridsep.base.errors import IdentificationError, LogError
from hybridsep.base.signals import Array
from hybridsep.identify.model import Estimate
from hybridsep.model.physics import ModalModel, Mode

from .frequency_response import IdentifiedResponse

HEADER = "time,accel_x,accel_y,accel_z"

BAND = (5.0, 135.0)  # default band of Klipper's test, Hz
ZETA_MAX = 0.4  # damping ratio above which the magnitude has no peak to speak of
WINDOW = 0.5  # length of a window of Welch's method, s, as Klipper uses


class Acceleration(NamedTuple):
    """Recorded acceleration."""

    t: Array  # (n,), s
    axes: dict[str, Array]  # each (n,), m/s²: ``x``, ``y``, ``z``
    T_s: float  # mean sampling interval, s


def is_klipper(path: str | Path) -> bool:
    """Return whether a file begins as Klipper's accelerometer files do."""
    try:
        with Path(path).open("rb") as file:
            head = file.read(64)
    except OSError:
        return False
    return head.decode("latin-1").lstrip("#").replace(" ", "").startswith(HEADER)


def read_klipper(path: str | Path) -> Acceleration:
    """Return the accelerations of a file; LogError if it is not one of Klipper's, or damaged."""
    if not is_klipper(path):
        raise LogError(f"{path}: is no accelerometer file of Klipper, which begins with #{HEADER}")
    rows = []
    for number, line in enumerate(Path(path).read_text(encoding="latin-1").splitlines()[1:], start=2):
        if not line.strip():
            continue
        try:
            row = [float(field) for field in line.split(",")]
        except ValueError:
            row = []
        if len(row) != 4 or not np.isfinite(row).all():
            raise LogError(f"{path}, line {number}: four numbers were expected, got {line[:60]!r}")
        rows.append(row)
    if len(rows) < 2:
        raise LogError(f"{path}: an accelerometer file needs at least 2 samples, got {len(rows)}")
    data = np.array(rows)
    steps = np.diff(data[:, 0])
    if not (steps > 0).all():
        i = int(np.argmax(steps <= 0))
        raise LogError(f"{path}, line {i + 3}: time must increase, got {data[i + 1, 0]:g} s after {data[i, 0]:g} s")
    t = data[:, 0] - data[0, 0]
    axes = {name: data[:, i + 1] * 1e-3 for i, name in enumerate("xyz")}
    return Acceleration(t, axes, float(t[-1] / (len(t) - 1)))


def identify_resonance(
    recording: Acceleration, axis: str, *, T_s: float = 1e-3, band: tuple[float, float] = BAND
) -> IdentifiedResponse:
    """Identify one mode from the magnitude of an axis' response to Klipper's resonance test.

    ``axis``: {"x", "y", "z"}: the axis that was shaken; ``T_s``: sampling interval of the machine file, s; ``band``:
    frequencies of the test, Hz. IdentificationError if there is no resonance in the band.
    """
    a = recording.axes[axis]
    n = min(len(a), max(16, round(WINDOW / recording.T_s)))
    f, power = welch(a - a.mean(), fs=1 / recording.T_s, nperseg=n)
    # windows at both ends of the test hold a part of it only
    low, high = band[0] + 2 / WINDOW, min(band[1] - 2 / WINDOW, 0.4 / recording.T_s)
    used = (f >= low) & (f <= high) & (f > 0)
    if np.count_nonzero(used) < 8:
        raise IdentificationError(
            f"this recording cannot determine a model, because fewer than 8 lines lie between {low:g} and {high:g} Hz"
        )
    f = f[used]
    # The commanded acceleration grows as f and dwells equally long at each f
    magnitude = np.sqrt(power[used]) / f
    scale, f_n, zeta, errors = _one_mode(f, magnitude)
    if not (f[1] < f_n < f[-2] and zeta < ZETA_MAX):
        raise IdentificationError(
            f"this recording cannot determine a model, because axis {axis} has no resonance between {low:g} and "
            f"{high:g} Hz"
        )
    omega = 2 * np.pi * f_n
    model = ModalModel([Mode(f_n, zeta, omega**2)])
    fitted = model.frequency_response(2 * np.pi * f)
    return IdentifiedResponse(
        model=model,
        input_hold="zoh",
        T_s=T_s,
        parameters=(
            Estimate("mode[1].f_n", f_n, f_n * errors[1], "Hz"),
            Estimate("mode[1].zeta", zeta, zeta * errors[2], "1"),
        ),
        frequency=f,
        response=np.asarray(magnitude / scale, dtype=np.complex128),
        fitted=fitted,
        noise=float(np.sqrt(np.mean((np.abs(fitted) * scale / magnitude - 1) ** 2))),
        criteria=(),
        findings=(
            "no commanded motion is in the file: one mode was fitted to the magnitude, with a static gain of 1 and "
            "no zero; phase and dead time are unknown",
        ),
        phase_measured=False,
    )


def _one_mode(f: Array, magnitude: Array) -> tuple[float, float, float, Array]:
    """Return scale, f_n, zeta of a mode's magnitude, and the deviations of their logarithms."""

    def logarithm(parameters: Array) -> Array:
        ratio = f / np.exp(parameters[1])
        return np.asarray(parameters[0] - 0.5 * np.log((1 - ratio**2) ** 2 + (2 * np.exp(parameters[2]) * ratio) ** 2))

    target = np.log(magnitude)
    start = [float(np.log(np.median(magnitude))), float(np.log(f[np.argmax(magnitude)])), float(np.log(0.05))]
    low, high = [-np.inf, np.log(f[0]), np.log(1e-3)], [np.inf, np.log(f[-1]), 0.0]
    start[1] = float(np.clip(start[1], low[1] + 1e-6, high[1] - 1e-6))
    solution = least_squares(
        lambda parameters: logarithm(parameters) - target, start, bounds=(low, high), loss="soft_l1", f_scale=0.3
    )
    residual = logarithm(solution.x) - target
    variance = float(residual @ residual) / max(1, len(f) - 3)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(solution.jac.T @ solution.jac)) * variance, 0.0))
    scale, f_n, zeta = np.exp(solution.x)
    return float(scale), float(f_n), float(zeta), errors
