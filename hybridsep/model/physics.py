"""Physics-based linear model ``G_pb`` of a feed drive in modal form, eq. (15).

``G_pb(s) = Σ_i (α_i + β_i s) / (s² + 2 ζ_i ω_i s + ω_i²)``; the spring-mass-damper of eq. (11) is one such mode.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import ModelError, ParameterError, check_kind
from ..base.settings import Cascade, check
from ..base.signals import Array, as_array
from .discrete import BLOCK_MAX, DiscreteModel

if TYPE_CHECKING:
    import control

_PREVIEW_MAX = 2000  # longest preview of a compensator, samples
MODES_MAX = 100  # largest number of modes; the discrete model's tables grow with its square


@dataclass(frozen=True)
class Mode:
    """One mode of eq. (15), ``(α + β s) / (s² + 2 ζ ω s + ω²)`` with ``ω = 2π f_n``.

    ``f_n``: natural frequency, Hz; ``zeta``: damping ratio, 1 is critical, more is over-damped; ``alpha``, ``beta``:
    numerator, 1/s² and 1/s.

    ParameterError if a value is not finite or out of range; ``zeta ≤ 0`` would be an unstable model.
    """

    f_n: float
    zeta: float
    alpha: float
    beta: float = 0.0

    def __post_init__(self) -> None:
        for name in ("f_n", "zeta", "alpha", "beta"):
            object.__setattr__(self, name, check(name, getattr(self, name)))

    @property
    def omega(self) -> float:
        """Natural frequency, rad/s."""
        return 2 * np.pi * self.f_n


def least_preview(T_s: float) -> int:
    """Return the least samples ahead that plans are made for: 0.2 s, which count as 100 at least, and 200 at most."""
    return min(max(100, round(0.2 / T_s)), 200)


@dataclass(frozen=True)
class ModalModel:
    """Linear, causal, stable drive model: a sum of modes with input dead time, eq. (15).

    ``modes``: 1 … :data:`MODES_MAX`; ``dead_time``: input delay, samples.

    ParameterError if there is no mode or too many, or ``dead_time`` is not a whole number ≥ 0.
    """

    modes: tuple[Mode, ...]
    dead_time: int = 0

    def __init__(self, modes: Iterable[Mode], dead_time: int = 0) -> None:
        check_kind(Iterable, modes=modes)
        if not (modes := tuple(modes)):
            raise ParameterError("a modal model needs at least one mode, got none")
        for one in modes:
            check_kind(Mode, mode=one)
        if len(modes) > MODES_MAX:
            raise ParameterError(f"a modal model has at most {MODES_MAX} modes, got {len(modes)}")
        object.__setattr__(self, "modes", modes)
        object.__setattr__(self, "dead_time", check("dead_time", dead_time))

    @classmethod
    def spring_mass_damper(cls, m: float, c: float, k: float, dead_time: int = 0) -> ModalModel:
        """Return eq. (11), ``G_pb(s) = (c s + k) / (m s² + c s + k)``, as one mode.

        ``m``, ``c``, ``k``: mass, kg, damping, N·s/m, and stiffness, N/m, all > 0; ``dead_time``: whole samples.

        ParameterError if a value, or the resulting mode, is out of range.
        """
        m, c, k = check("m", m), check("c", c), check("k", k)
        # ω² = k/m, 2ζω = c/m, α = k/m, β = c/m
        omega = np.sqrt(k / m)
        try:
            mode = Mode(f_n=omega / (2 * np.pi), zeta=c / m / (2 * omega), alpha=k / m, beta=c / m)
        except ParameterError as error:
            raise ParameterError(
                f"m = {m:g} kg, c = {c:g} N.s/m, k = {k:g} N/m give a mode out of range: {error}"
            ) from None
        return cls((mode,), dead_time)

    @classmethod
    def cascade(cls, gains: Cascade, dead_time: int = 0) -> ModalModel:
        """Return the closed loops of a drive, a mass with viscous friction, of given gains; ModelError if unstable."""
        check_kind(Cascade, gains=gains)
        s, Tv = np.polynomial.Polynomial([0.0, 1.0]), gains.Tv
        force = gains.Kv * (Tv * s + 1.0) if Tv else gains.Kv + 0.0 * s
        velocity = (Tv * s if Tv else 1.0) * (gains.inertia * s + gains.viscous) + force
        numerator, denominator = force * (gains.Kp + gains.feed_forward * s), velocity * s + force * gains.Kp
        import control as ct

        return cls.from_control(ct.tf(*(one.trim().coef[::-1] for one in (numerator, denominator))), dead_time)

    @classmethod
    def from_control(cls, system: control.TransferFunction | control.StateSpace, dead_time: int = 0) -> ModalModel:
        """Return the modal form of a python-control system.

        Complex pole pairs become under-damped modes, real poles are paired into over-damped ones.

        ``system``: continuous, one input, one output, strictly proper, stable, no repeated mode; ``dead_time``: whole
        samples of dead time to add.

        ModelError if the system is of another kind, discrete, zero, not finite, improper or unstable, has several
        channels, or has repeated modes.
        """
        return cls(_modes_of(system), dead_time)

    @property
    def dc_gain(self) -> float:
        """Static gain ``G_pb(0)``; 1 for a drive without steady-state error."""
        return float(sum(mode.alpha / mode.omega**2 for mode in self.modes))

    def needed_preview(self, T_s: float, input_hold: str = "zoh") -> int:
        """Return the samples ahead that a compensator needs to plan, :data:`_PREVIEW_MAX` at most.

        A change of the command must act within its plan: three times the time in which the response to a step, dead
        time included, first reaches 95 % of its end, or 1.5 periods of the lowest mode that swings, ζ < 1, and adds 5 %
        somewhere, and :func:`least_preview`.

        ``T_s``, s, and ``input_hold`` are as of :meth:`discretise`.
        """
        discrete = self.discretise(T_s, input_hold)
        step, _ = discrete.forced_response(discrete.rest(), np.ones(_PREVIEW_MAX // 3))
        reached = np.abs(step) >= 0.95 * abs(self.dc_gain)
        rise = int(np.argmax(reached)) if reached.any() else len(step)
        peaks = [(abs(m.alpha) / m.omega**2 + abs(m.beta) / m.omega) * max(1.0, 0.5 / m.zeta) for m in self.modes]
        seen = min(0.05 * abs(self.dc_gain), max(peaks))
        swinging = [mode for mode, peak in zip(self.modes, peaks, strict=True) if peak >= seen and mode.zeta < 1.0]
        periods = [math.ceil(1.5 / mode.f_n / T_s) for mode in swinging]
        return min(_PREVIEW_MAX, max(least_preview(T_s), 3 * rise, *periods))

    def state_space(self) -> tuple[Array, Array, Array]:
        """Return ``(A, b, c)`` of the modes, block diagonal, without the dead time.

        Each mode has the states ``(ω² z, ω ż)`` with ``z̈ + 2ζω ż + ω² z = x_d``, both in metres: of ``m`` modes ``A``
        is ``(2m, 2m)``, ``b`` ``(2m,)``, both in 1/s, and ``c`` ``(2m,)`` without a unit.
        """
        from scipy.linalg import block_diag

        blocks, b, c = [], [], []
        for mode in self.modes:
            w = mode.omega
            blocks.append(np.array([[0.0, w], [-w, -2 * mode.zeta * w]]))
            b += [0.0, w]
            c += [mode.alpha / w**2, mode.beta / w]
        return block_diag(*blocks), np.array(b), np.array(c)

    def discretise(self, T_s: float, input_hold: str = "zoh", block: int = BLOCK_MAX) -> DiscreteModel:
        """Return the discrete-time model, exact at the samples under the hold.

        ``T_s``: sampling interval, s; ``input_hold``: zero-order or first-order hold of ``x_d``, "zoh" or "foh";
        ``block``: longest window computed in one piece, the size of the tables.

        ParameterError if ``T_s ≤ 0`` or the hold is unknown.
        """
        return DiscreteModel(self.state_space(), self.dead_time, T_s, input_hold, block)

    def frequency_response(self, omega: ArrayLike, T_s: float | None = None) -> NDArray[np.complex128]:
        """Return ``G_pb(j ω)``, m/m, complex, in the shape of ``omega``, angular frequencies, rad/s.

        ``T_s``, s, the sampling interval, is needed when there is a dead time, which is counted in samples:
        ParameterError without.
        """
        if self.dead_time and T_s is None:
            raise ParameterError(f"T_s is needed: dead_time = {self.dead_time} is counted in samples")
        s = 1j * as_array(getattr(omega, "to_numpy", lambda: omega)(), "omega")  # an index may be of any frequencies
        # Eq. (15)
        G = sum((m.alpha + m.beta * s) / (s**2 + 2 * m.zeta * m.omega * s + m.omega**2) for m in self.modes)
        return np.asarray(G * np.exp(-s * self.dead_time * (T_s or 0.0)), dtype=np.complex128)


_REPEATED = 1e-3  # relative distance below which two poles count as repeated: rounding splits a fivefold one by 7e-4

_REPEATED_MODES = "G_pb has repeated modes, which a sum of modes as in eq. (15) cannot express; separate them slightly"


def _modes_of(system: control.TransferFunction | control.StateSpace) -> list[Mode]:
    """Return the modes of a system, as :meth:`ModalModel.from_control` describes."""
    import control

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        raise ModelError(f"G_pb must be a TransferFunction or StateSpace, got {type(system).__name__}")
    if system.ninputs != 1 or system.noutputs != 1:
        raise ModelError(f"G_pb must have one input and one output, got {system.ninputs} and {system.noutputs}")
    if system.isdtime(strict=True):
        raise ModelError("G_pb must be continuous, got a discrete system; convert it (for example with d2c) first")
    of_states = isinstance(system, control.StateSpace)
    parts = [system.A, system.B, system.C, system.D] if of_states else [system.num[0][0], system.den[0][0]]
    if not all(np.isfinite(part).all() for part in parts):
        raise ModelError("G_pb must have finite coefficients, got NaN or infinity among them")
    tf = control.tf(system)
    numerator, denominator = (
        np.trim_zeros(np.atleast_1d(np.asarray(part[0][0], dtype=float)), "f") for part in (tf.num, tf.den)
    )
    if of_states and not np.any(system.D) and len(numerator) >= len(denominator):
        numerator = np.trim_zeros(numerator[1:], "f")  # a leading coefficient that is there by rounding
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
    magnitudes = np.abs(poles)
    scale = float(np.exp(np.mean(np.log(magnitudes))))
    numerator = numerator / denominator[0] * scale ** (np.arange(len(numerator))[::-1] - len(poles) * 1.0)
    quadratics, numerator = _quadratics(poles / scale, numerator)
    numbers = _partial_fractions(quadratics, numerator)
    modes = []
    for (_, damping, stiffness), (alpha, beta) in zip(quadratics, numbers, strict=True):
        omega = float(np.sqrt(stiffness))
        modes.append(Mode(omega * scale / (2 * np.pi), damping / (2 * omega), alpha * scale**2, beta * scale))
    # As for a pole of high multiplicity, the modes may be others
    omegas = np.geomspace(0.1 * magnitudes.min(), 10 * magnitudes.max(), 100)
    expected = np.polyval(tf.num[0][0], 1j * omegas) / np.polyval(tf.den[0][0], 1j * omegas)
    difference = ModalModel(modes).frequency_response(omegas) - expected
    if not np.max(np.abs(difference)) < 1e-6 * np.max(np.abs(expected)):
        raise ModelError(_REPEATED_MODES)
    return modes


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
    for others, some in combinations(map(np.roots, quadratics), 2):
        if np.any(np.abs(some[:, None] - others[None, :]) < _REPEATED * np.abs(others)):
            raise ModelError(_REPEATED_MODES)
    rests = [reduce(np.polymul, quadratics[:i] + quadratics[i + 1 :], np.array([1.0])) for i in range(m)]
    columns = [np.pad(one, (2 * m - len(one), 0)) for rest in rests for one in (rest, np.append(rest, 0.0))]
    solution: Array = np.linalg.solve(np.array(columns).T, np.pad(numerator, (2 * m - len(numerator), 0)))
    return solution.reshape(m, 2)
