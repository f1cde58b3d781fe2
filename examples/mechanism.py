"""Mechanism of section 3.1 of the paper: how a linear recursion in past residuals can capture a nonlinearity.

Eq. (7): the linear part ``A``, ``B``, ``C`` of a drive is known, an input ``h`` that acts on it through ``Γ`` is not.
The physics-based model is the drive without it::

    z(k+1)    = A z(k)    + B x_d(k) + Γ h(k),    x(k)    = C z(k)
    z_pb(k+1) = A z_pb(k) + B x_d(k),             x_pb(k) = C z_pb(k)

The paper's example is ``h = x_d²``; its Remark allows others. Eqs. (8) and (9) split the response from rest into what
the command does and what ``h`` does, ``x = x_pb + e_pb``; the second part is eq. (10),
``e_pb(k) = Σ_{i<k} C A^{k−1−i} Γ h(i)``. With ``C Aⁿ Γ ≈ 0`` from ``n = p`` on, the paper concludes: if the last ``p``
samples of ``h`` depend linearly on the ones before, ``η(D) h = 0`` with ``D`` the delay by one sample, so do the
residual's samples, ``η(D) e_pb ≈ 0``.

The rest is not in the paper. By Cayley and Hamilton the characteristic polynomial ``χ`` of ``A`` takes the drive out,
``χ(D) e_pb = N(D) h``, with as many terms as ``A`` has states, whether or not ``C Aⁿ Γ`` has decayed. Hence

- if ``h`` obeys a linear recursion ``η(D) h = 0`` (``x_d²`` of a sinusoid or a polynomial of time, Coulomb friction
  between reversals), ``χ η e_pb = 0``: past residuals determine the next one exactly;
- where ``h`` jumps by ``Δh``, as friction does at a reversal, the next residual holds news of exactly ``C Γ Δh``,
  one more such spike follows for each further state, and then all is known again;
- if ``h`` is a linear mode driven by the position, past residuals and past ``x_pb`` determine ``e_pb`` exactly: the
  features of eq. (5), with more lags;
- if ``h`` is a smooth function of the state, ``η`` of a polynomial leaves little of it from one sample to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz

from hybridsep.base.settings import check
from hybridsep.base.signals import Array
from hybridsep.model.discrete import DiscreteModel
from hybridsep.model.physics import ModalModel

Disturbance = Callable[[int, Array, float], float]
"""``h(k, z(k), x_d(k))``: what acts on the drive from sample ``k`` to ``k + 1``, N, or m² where it is ``x_d²``."""


@dataclass(frozen=True)
class Drive:
    """The discrete-time drive of eq. (7), with ``x_d`` and ``h`` held over a sample.

    The states are in metres: ``A`` is ``(n, n)``; ``B``, 1, and ``Gamma``, ``Γ``, m per unit of ``h``, are ``(n,)``;
    ``x = C z`` with ``C`` of ``(n,)``; and ``ẋ = V z + V_d x_d`` with ``V`` of ``(n,)`` and ``V_d``, 1/s.
    """

    A: Array
    B: Array
    Gamma: Array
    C: Array
    V: Array
    V_d: float

    @classmethod
    def spring_mass_damper(cls, m: float = 1.0, c: float = 15.7, k: float = 24674.0, T_s: float = 1e-3) -> Drive:
        """Return eq. (11) pushed by a force, ``h`` in N: ``m`` kg, ``c`` N·s/m, ``k`` N/m, sampled every ``T_s`` s."""
        model = ModalModel.spring_mass_damper(m, c, k)
        A, b, output = model.state_space()
        discrete = model.discretise(T_s)
        # A force moves x by 1 / (m s² + c s + k): nothing at once in x, 1/m in ẍ.
        b_h = np.linalg.solve(np.array([output, output @ A]), np.array([0.0, 1.0 / m]))
        # Γ = ∫₀^T_s exp(A τ) dτ b_h = A⁻¹ (A_d − I) b_h
        held = np.linalg.solve(A, (discrete.A - np.eye(len(b))) @ b_h)
        return cls(
            discrete.A, discrete.b, np.asarray(held, dtype=np.float64), discrete.c, output @ A, float(output @ b)
        )


@dataclass(frozen=True)
class Simulation:
    """A run of eq. (7) beside its model: ``x``, ``x_pb`` (n,) arrays, m, and what acted besides, ``h`` (n,) array."""

    x: Array
    x_pb: Array
    h: Array

    @property
    def e_pb(self) -> Array:
        """``x − x_pb``, ``(n,)`` array, m."""
        return self.x - self.x_pb


def simulate(drive: Drive, x_d: Array, disturbance: Disturbance) -> Simulation:
    """Run eq. (7) from rest, sample by sample, beside the model without the disturbance; ``x_d`` is ``(n,)``, m."""
    z, z_pb = np.zeros_like(drive.B), np.zeros_like(drive.B)
    x, x_pb, h = np.empty(len(x_d)), np.empty(len(x_d)), np.empty(len(x_d))
    for k, command in enumerate(x_d.tolist()):
        x[k], x_pb[k], h[k] = drive.C @ z, drive.C @ z_pb, disturbance(k, z, command)
        # Eq. (7), with and without h
        z = drive.A @ z + drive.B * command + drive.Gamma * h[k]
        z_pb = drive.A @ z_pb + drive.B * command
    return Simulation(x, x_pb, h)


def response(drive: Drive, x_d: Array, h: Array, k: int) -> float:
    """Return eq. (8), ``x(k)`` from rest, m, summed over all inputs before it; ``x_d``, m, and ``h`` are ``(n,)``."""
    x, power = 0.0, drive.C  # C Aⁱ
    for i in range(k - 1, -1, -1):
        # Eq. (8): x(k) = C Aᵏ⁻¹ B x_d(0) + C Aᵏ⁻¹ Γ h(0) + … + C B x_d(k−1) + C Γ h(k−1)
        x += float(power @ drive.B) * float(x_d[i]) + float(power @ drive.Gamma) * float(h[i])
        power = power @ drive.A
    return x


def split(drive: Drive, x_d: Array, h: Array) -> tuple[Array, Array]:
    """Return the two products of eq. (9), ``x_pb`` and ``e_pb`` of eq. (10); ``(n,)``, m, for inputs of ``(n,)``."""
    n = len(h) - 1
    # Eq. (9): [x(1) … x(n)] = lifted(B) [x_d(0) … x_d(n−1)] + lifted(Γ) [h(0) … h(n−1)], from x(0) = 0
    x_pb = lifted(drive.A, drive.B, drive.C, n) @ x_d[:n]
    e_pb = lifted(drive.A, drive.Gamma, drive.C, n) @ h[:n]
    return np.concatenate(([0.0], x_pb)), np.concatenate(([0.0], e_pb))


def lifted(A: Array, B: Array, C: Array, n: int) -> Array:
    """Return a matrix of eq. (9), ``(n, n)``, lower-triangular Toeplitz with ``C B, C A B, …`` in its first column."""
    return np.asarray(toeplitz(markov(A, B, C, n), np.zeros(n)), dtype=np.float64)


def markov(A: Array, B: Array, C: Array, n: int) -> Array:
    """Return ``C Aⁱ B`` for ``i = 0 … n − 1``, ``(n,)``."""
    out = np.empty(n)
    for i in range(n):
        out[i] = C @ B
        B = A @ B
    return out


def decay(A: Array, B: Array, C: Array, n: int) -> Array:
    """Return the largest ``|C Aʲ B|``, ``j ≥ i``, as a share of the largest of all, for ``i = 0 … n − 1``, ``(n,)``."""
    sizes = np.abs(markov(A, B, C, n))
    return np.asarray(np.maximum.accumulate(sizes[::-1])[::-1] / np.max(sizes))


def characteristic(A: Array) -> Array:
    """Return ``χ``: ``1, a₁ … a_n`` with ``Aⁿ + a₁ Aⁿ⁻¹ + … + a_n I = 0``, ``(n + 1,)``."""
    return np.real(np.poly(A)).astype(np.float64)


def moving_average(A: Array, B: Array, C: Array) -> Array:
    """Return ``N``: ``0, n₁ … n_n``, the coefficients in ``χ(D) y(k) = Σ_j n_j u(k−j)``, ``(n + 1,)``."""
    chi = characteristic(A)
    return np.convolve(chi, np.concatenate(([0.0], markov(A, B, C, len(B)))))[: len(chi)]


def polynomial(degree: int) -> Array:
    """Return the recursion ``η`` of a polynomial of time, ``(1 − D)^(degree + 1)``; degree 0 is a constant."""
    return np.asarray(np.poly(np.ones(degree + 1)), dtype=np.float64)


def sinusoid(f: float, T_s: float) -> Array:
    """Return the recursion ``η`` of a sinusoid of ``f`` Hz sampled every ``T_s`` s, ``1 − 2 cos(2π f T_s) D + D²``."""
    return np.array([1.0, -2 * np.cos(2 * np.pi * f * check("T_s", T_s)), 1.0])


def innovation(e_pb: Array, recursion: Array, known: Array | None = None) -> Array:
    """Return the part of each residual, ``(n,)``, m, that the ones before it (zero before the first) do not determine.

    ``recursion``, ``(order + 1,)``, is ``1, r₁ … r_order``: the next residual is expected at ``−Σ_i r_i e_pb(k−i)``,
    plus ``known``, ``(n,)``, m, if other signals tell a part of it.
    """
    news = np.convolve(recursion, e_pb)[: len(e_pb)]
    return news if known is None else news - known


def squared_command(k: int, z: Array, x_d: float) -> float:
    """Return the paper's example of eq. (7), ``x_d²``, m²: it depends only on the input."""
    return x_d * x_d


def coulomb(force: float, x_d: Array) -> Disturbance:
    """Return friction of ``force`` N against the commanded motion ``x_d``, ``(n,)``: it depends only on the input."""
    against = -force * np.sign(np.diff(x_d, append=2 * x_d[-1] - x_d[-2]))
    return lambda k, *_: float(against[k])


def quadratic(drive: Drive, c_nl: float, k_nl: float) -> Disturbance:
    """Return eq. (12), ``−c_nl ẋ|ẋ| − k_nl x|x|`` N, which depends on the state; N·s²/m² and N/m²."""

    def disturbance(_: int, z: Array, command: float) -> float:
        x, v = float(drive.C @ z), float(drive.V @ z) + drive.V_d * command
        return -c_nl * v * abs(v) - k_nl * x * abs(x)

    return disturbance


def linear_mode(drive: Drive, mode: DiscreteModel) -> Disturbance:
    """Return the force of an unmodelled linear mode that the position drives from rest; ``mode`` in N/m."""
    state = mode.rest()

    def disturbance(k: int, z: Array, _: float) -> float:
        nonlocal state
        state = mode.rest() if k == 0 else state
        h = float(mode.c @ state)
        state = mode.A @ state + mode.b * float(drive.C @ z)
        return h

    return disturbance


def recursion_with_mode(drive: Drive, mode: DiscreteModel) -> tuple[Array, Array]:
    """Return ``(r, s)``, each ``(order + 1,)``, of ``r(D) e_pb = s(D) x_pb`` beside an unmodelled mode.

    With ``h = (N_m/χ_m)(x_pb + e_pb)`` in ``χ e_pb = N h``: ``(χ χ_m − N N_m) e_pb = N N_m x_pb``.
    """
    chi = np.convolve(characteristic(drive.A), characteristic(mode.A))
    s = np.convolve(moving_average(drive.A, drive.Gamma, drive.C), moving_average(mode.A, mode.b, mode.c))
    return chi - s, s
