"""Structures of ``G_pb`` that are tried on a log, and their parameters as modes of eq. (15)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.signals import Array
from ..model.discrete import discretised_block
from ..model.physics import Mode

_ZETA_RANGE = (0.003, 5.0)
"""Damping ratios that are tried; Table 1 has 0.007, and at 5 the two poles are a factor of 98 apart."""

FASTEST = 0.25
"""Highest natural frequency, in sampling frequencies: with fewer samples a period a replay is refused."""

RATES_MIN = 5.0  # time constants, or periods, of a pole within the recording, at least: slower ones look like drift


@dataclass(frozen=True)
class Structure:
    """Form of a transfer function with unknown parameters.

    Its nonlinear parameters are ``log ω_i, log ζ_i`` of each mode, then ``log 1/τ`` of the lag; its linear ones the
    static gain of each mode and of the lag, and ``β_i/ω_i`` of each mode with a zero.
    """

    n_modes: int  # second-order modes
    lag: bool = False  # whether there is a first-order lag as well
    zero: bool = False  # whether the modes have a ``β``
    unit_gain: bool = True  # whether the static gain is 1, not estimated
    zeta: float = 0.0  # damping ratio of its modes that is taken, not estimated; 0: none

    @property
    def searched(self) -> NDArray[np.bool_]:
        """Which of the nonlinear parameters are searched for, ``(order,)``."""
        return np.array([True, self.zeta == 0.0] * self.n_modes + [True] * self.lag, dtype=bool)

    @property
    def order(self) -> int:
        """Number of poles."""
        return 2 * self.n_modes + self.lag

    @property
    def n_linear(self) -> int:
        """Number of linear parameters."""
        return self.n_modes * (1 + self.zero) + self.lag - self.unit_gain if self.order else 1 - self.unit_gain

    @property
    def n_parameters(self) -> int:
        """Number of parameters, with the dead time."""
        return int(self.searched.sum()) + self.n_linear + 1

    @property
    def name(self) -> str:
        """Name in tables."""
        if self.order == 0:
            form = "gain alone"
        elif self.n_modes == 0:
            form = "first-order lag"
        else:
            form = "second order" if self.n_modes == 1 else f"{self.n_modes} modes"
            form += " with zero" if self.zero and self.n_modes == 1 else ""
            form += f" and ζ {self.zeta}" if self.zeta else ""
            form += " and lag" if self.lag else ""
        return f"{form}, gain {'1' if self.unit_gain else 'free'}"

    def bounds(self, T_s: float, slowest: float) -> tuple[Array, Array]:
        """Return the range of the nonlinear parameters with poles no slower than ``slowest``, rad/s."""
        slowest = min(slowest, 1.0 / T_s)
        mode_low, mode_high = [slowest, _ZETA_RANGE[0]], [2 * np.pi * FASTEST / T_s, _ZETA_RANGE[1]]
        low = mode_low * self.n_modes + [slowest] * self.lag
        high = mode_high * self.n_modes + [10.0 / T_s] * self.lag
        return np.log(low), np.log(high)

    def slowest_rate(self, theta: Array) -> float:
        """Return the rate of its slowest pole, 1/s, of one that swings at least its frequency; infinite without any."""
        omegas, zetas = np.exp(theta[: 2 * self.n_modes]).reshape(-1, 2).T
        decays = omegas * np.where(zetas > 1, zetas - np.sqrt(np.maximum(zetas**2 - 1, 0.0)), zetas)
        rates = np.where(zetas > 1, decays, np.maximum(decays, omegas / (2.0 * np.pi)))
        return float(min([*rates, *np.exp(theta[2 * self.n_modes :])], default=np.inf))

    def modes(self, theta: Array, linear: Array, T_s: float) -> list[Mode]:
        """Return the modes of eq. (15).

        ``theta``, ``(order,)``, are the nonlinear parameters, ``linear``, ``(n_linear,)``, the static gains, the
        first one left out if they sum to 1, then ``β_i/ω_i``.
        """
        gains, betas = self.gains(linear)
        if self.order == 0:
            return [lag_mode(max(T_s / 20, 2e-6), gains[0])]
        poles = np.exp(theta[: 2 * self.n_modes]).reshape(-1, 2)
        modes = [
            Mode(omega / (2 * np.pi), zeta, gain * omega**2, beta * omega)
            for (omega, zeta), gain, beta in zip(poles, gains, betas, strict=False)
        ]
        return [*modes, lag_mode(float(np.exp(-theta[-1])), gains[-1])] if self.lag else modes

    def gains(self, linear: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return the static gains of modes and lag, and ``β_i/ω_i`` of the modes."""
        values = np.asarray(linear, dtype=np.float64)
        n = max(self.n_modes + self.lag, 1) - self.unit_gain
        gains, betas = values[:n], values[n:]
        if self.unit_gain:
            gains = np.concatenate(([1.0 - gains.sum()], gains))
        return gains, betas if self.zero else np.zeros(self.n_modes)


def lag_mode(tau: float, gain: float = 1.0) -> Mode:
    """Return ``gain/(τ s + 1)``, τ in s, as a mode: ``(1/τ² + s/τ)/(s + 1/τ)²``, whose zero cancels a pole."""
    return Mode(f_n=1 / (2 * np.pi * tau), zeta=1.0, alpha=gain / tau**2, beta=gain / tau)


_FORMS = (
    *(Structure(0), Structure(0, lag=True), Structure(1), Structure(1, zero=True)),
    *(Structure(1, lag=True, zero=True), Structure(2, zero=True), Structure(2, lag=True, zero=True)),
    Structure(3, zero=True),
)
STRUCTURES = tuple(replace(form, unit_gain=unit_gain) for form in _FORMS for unit_gain in (True, False))
"""Structures by number of parameters, the simplest first."""


def polynomials(theta: Sequence[float] | Array, T_s: float, hold: str, *, zero: bool = True) -> tuple[Array, Array]:
    """Return numerators ``(1 or 2, m + 1)`` and denominator, in z⁻¹, of a mode, m = 2, or of the lag, m = 1.

    ``theta``, ``(m,)``, are its nonlinear parameters. The first numerator is the response's with a static gain of 1,
    with a ``zero`` the second one that of a mode ``ω s/(s² + 2 ζ ω s + ω²)``.
    """
    if len(theta) == 2:
        omega, zeta = np.exp(theta)
        A, b = np.array([[0.0, omega], [-omega, -2 * zeta * omega]]), np.array([0.0, omega])
    else:
        b = np.exp(np.asarray(theta))
        A = -b[None]
    A, b, d = discretised_block(A, b, T_s, hold)
    trace = A.trace()
    columns, denominator = [np.zeros(len(b)), b], [1.0, -trace]
    if len(theta) == 2:
        columns.append(A @ b - trace * b)
        denominator.append(A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0])
    # s(k+1) = A s(k) + b u(k), the states being s + d u: (z I − A)⁻¹ b + d
    return (np.column_stack(columns) + np.outer(d, denominator))[: 1 + zero], np.array(denominator)
