"""Why a linear recursion in past residuals can capture an unmodelled nonlinearity: section 3.1 of the paper, runnable.

The equation numbers are the paper's, the code form and the worked disturbances are ours. The real drive is linear but
for an additive disturbance, eq. (7), and the physics-based model is the same without it::

    ξ(k+1)    = A ξ(k)    + B x_d(k) + B_H h(k),    x(k)    = C ξ(k)
    ξ_pb(k+1) = A ξ_pb(k) + B x_d(k),               x_pb(k) = C ξ_pb(k)

so the residual ``e_pb = x − x_pb`` is the disturbance seen through the drive, eq. (10):
``e_pb(k) = Σ_{i=0}^{k−1} C Aⁱ B_H h(k−1−i)``. By Cayley and Hamilton the characteristic polynomial ``χ`` of ``A`` takes
the drive out again: ``χ(z⁻¹) e_pb = N(z⁻¹) h``, with as many terms as ``A`` has states. Hence

- if ``h`` obeys a linear recursion ``η(z⁻¹) h = 0`` (Coulomb friction between reversals, a polynomial or sinusoid of
  time), ``χ η e_pb = 0``: past residuals determine the next one exactly;
- where ``h`` jumps by ``Δh``, as friction does at a reversal, the next residual holds news of exactly ``C B_H Δh``,
  one more such spike follows for each further state, and then all is known again;
- if ``h`` is a linear mode driven by the position, past residuals and past ``x_pb`` determine ``e_pb`` exactly: the
  features of eq. (5), with more lags;
- if ``h`` is a smooth function of the state, ``η`` of a polynomial leaves little of it from one sample to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .parameters import check
from .physics import DiscreteModel, ModalModel, Mode
from .signals import Array

__all__ = [
    "Case",
    "Disturbance",
    "Drive",
    "Simulation",
    "characteristic",
    "coulomb",
    "demonstrate",
    "innovation",
    "linear_mode",
    "markov",
    "moving_average",
    "polynomial",
    "quadratic",
    "recursion_with_mode",
    "residual_closed_form",
    "simulate",
    "sinusoid",
]

Disturbance = Callable[[int, Array, float], float]
"""``h(k, ξ(k), x_d(k))``, N: what acts on the drive from sample ``k`` to ``k + 1``."""


@dataclass(frozen=True)
class Drive:
    """The discrete-time drive of eq. (7), with ``x_d`` and ``h`` held over a sample.

    The states are in metres: ``A`` is ``(n, n)``; ``B``, 1, and ``B_H``, m/N, are ``(n,)``; ``x = C ξ`` with ``C``
    of ``(n,)``; and ``ẋ = V ξ + V_d x_d`` with ``V`` of ``(n,)`` and ``V_d``, 1/s.
    """

    A: Array
    B: Array
    B_H: Array
    C: Array
    V: Array
    V_d: float

    @classmethod
    def spring_mass_damper(cls, m: float = 1.0, c: float = 15.7, k: float = 24674.0, Ts: float = 1e-3) -> Drive:
        """Return eq. (11) pushed by a force: ``m`` kg, ``c`` N·s/m, ``k`` N/m, sampled every ``Ts`` s."""
        model = ModalModel.spring_mass_damper(m, c, k)
        A, b, output = model.state_space()
        discrete = model.discretise(Ts)
        # A force moves x by 1 / (m s² + c s + k): nothing at once in x, 1/m in ẍ.
        b_h = np.linalg.solve(np.array([output, output @ A]), np.array([0.0, 1.0 / m]))
        # B_H = ∫₀^Ts exp(A τ) dτ b_h = A⁻¹ (A_d − I) b_h
        held = np.linalg.solve(A, (discrete.A - np.eye(len(b))) @ b_h)
        return cls(
            discrete.A, discrete.b, np.asarray(held, dtype=np.float64), discrete.c, output @ A, float(output @ b)
        )


@dataclass(frozen=True)
class Simulation:
    """A run of eq. (7) beside its model: ``x``, ``x_pb`` (n,) arrays, m, and the disturbance ``h`` (n,) array, N."""

    x: Array
    x_pb: Array
    h: Array

    @property
    def e_pb(self) -> Array:
        """``x − x_pb``, ``(n,)`` array, m."""
        return self.x - self.x_pb


def simulate(drive: Drive, x_d: Array, disturbance: Disturbance) -> Simulation:
    """Run eq. (7) from rest, sample by sample, beside the model without the disturbance; ``x_d`` is ``(n,)``, m."""
    xi, xi_pb = np.zeros_like(drive.B), np.zeros_like(drive.B)
    x, x_pb, h = np.empty(len(x_d)), np.empty(len(x_d)), np.empty(len(x_d))
    for k, command in enumerate(x_d.tolist()):
        x[k], x_pb[k], h[k] = drive.C @ xi, drive.C @ xi_pb, disturbance(k, xi, command)
        # Eq. (7), with and without h
        xi = drive.A @ xi + drive.B * command + drive.B_H * h[k]
        xi_pb = drive.A @ xi_pb + drive.B * command
    return Simulation(x, x_pb, h)


def markov(A: Array, B: Array, C: Array, n: int) -> Array:
    """Return ``C Aⁱ B`` for ``i = 0 … n − 1``, ``(n,)``."""
    out = np.empty(n)
    for i in range(n):
        out[i] = C @ B
        B = A @ B
    return out


def residual_closed_form(drive: Drive, h: Array) -> Array:
    """Return eq. (10), ``e_pb(k) = Σ_{i=0}^{k−1} C Aⁱ B_H h(k−1−i)``, for ``h`` of ``(n,)``, N; ``(n,)``, m."""
    e_pb = np.convolve(markov(drive.A, drive.B_H, drive.C, len(h)), h)[: len(h)]
    return np.concatenate(([0.0], e_pb[:-1]))


def characteristic(A: Array) -> Array:
    """Return ``χ``: ``1, a₁ … a_n`` with ``Aⁿ + a₁ Aⁿ⁻¹ + … + a_n I = 0``, ``(n + 1,)``."""
    return np.real(np.poly(A)).astype(np.float64)


def moving_average(A: Array, B: Array, C: Array) -> Array:
    """Return ``N``: ``0, n₁ … n_n``, the coefficients in ``χ(z⁻¹) y(k) = Σ_j n_j u(k−j)``, ``(n + 1,)``."""
    chi = characteristic(A)
    return np.convolve(chi, np.concatenate(([0.0], markov(A, B, C, len(B)))))[: len(chi)]


def polynomial(degree: int) -> Array:
    """Return the recursion ``η`` of a polynomial of time, ``(1 − z⁻¹)^(degree + 1)``; degree 0 is a constant."""
    return np.asarray(np.poly(np.ones(degree + 1)), dtype=np.float64)


def sinusoid(f: float, Ts: float) -> Array:
    """Return the recursion ``η`` of a sinusoid of ``f`` Hz sampled every ``Ts`` s, ``1 − 2 cos(2π f Ts) z⁻¹ + z⁻²``."""
    return np.array([1.0, -2 * np.cos(2 * np.pi * f * check("T_s", Ts)), 1.0])


def innovation(e_pb: Array, recursion: Array, known: Array | None = None) -> Array:
    """Return the part of each residual, ``(n,)``, m, that the ones before it (zero before the first) do not determine.

    ``recursion``, ``(order + 1,)``, is ``1, r₁ … r_order``: the next residual is expected at ``−Σ_i r_i e_pb(k−i)``,
    plus ``known``, ``(n,)``, m, if other signals tell a part of it.
    """
    news = np.convolve(recursion, e_pb)[: len(e_pb)]
    return news if known is None else news - known


def coulomb(force: float, x_d: Array) -> Disturbance:
    """Return friction of ``force`` N against the commanded motion ``x_d``, ``(n,)``: it depends on the input alone."""
    against = -force * np.sign(np.diff(x_d, append=2 * x_d[-1] - x_d[-2]))
    return lambda k, *_: float(against[k])


def quadratic(drive: Drive, c_nl: float, k_nl: float) -> Disturbance:
    """Return eq. (12), ``−c_nl ẋ|ẋ| − k_nl x|x|`` N, which depends on the state; N·s²/m² and N/m²."""

    def disturbance(_: int, xi: Array, command: float) -> float:
        x, v = float(drive.C @ xi), float(drive.V @ xi) + drive.V_d * command
        return -c_nl * v * abs(v) - k_nl * x * abs(x)

    return disturbance


def linear_mode(drive: Drive, mode: DiscreteModel) -> Disturbance:
    """Return the force of an unmodelled linear mode that the position drives from rest; ``mode`` in N/m."""
    state = mode.rest()

    def disturbance(k: int, xi: Array, _: float) -> float:
        nonlocal state
        state = mode.rest() if k == 0 else state
        h = float(mode.c @ state)
        state = mode.A @ state + mode.b * float(drive.C @ xi)
        return h

    return disturbance


def recursion_with_mode(drive: Drive, mode: DiscreteModel) -> tuple[Array, Array]:
    """Return ``(r, s)``, each ``(order + 1,)``, of ``r(z⁻¹) e_pb = s(z⁻¹) x_pb`` beside an unmodelled mode.

    With ``h = (N_m/χ_m)(x_pb + e_pb)`` in ``χ e_pb = N h``: ``(χ χ_m − N N_m) e_pb = N N_m x_pb``.
    """
    chi = np.convolve(characteristic(drive.A), characteristic(mode.A))
    s = np.convolve(moving_average(drive.A, drive.B_H, drive.C), moving_average(mode.A, mode.b, mode.c))
    return chi - s, s


@dataclass(frozen=True)
class Case:
    """One disturbance and how much of its residual ``order`` past residuals leave open; all in metres.

    ``closed_form_error`` is the largest difference of the simulated residual from eq. (10); ``n_spikes`` counts the
    samples whose innovation exceeds 1e-9 of the largest residual, far above rounding.
    """

    name: str
    order: int
    residual_rms: float
    closed_form_error: float
    innovation_rms: float
    innovation_max: float
    n_spikes: int


def demonstrate(n: int = 2000, Ts: float = 1e-3) -> tuple[Case, ...]:
    """Run the paper's drive under each kind of disturbance, along a 10 mm, 2 Hz raised cosine of ``n`` samples."""
    drive = Drive.spring_mass_damper(Ts=Ts)
    t = Ts * np.arange(n)
    x_d = 0.005 * (1 - np.cos(2 * np.pi * 2.0 * t))
    mode = ModalModel([Mode(60.0, 0.02, 300.0 * (2 * np.pi * 60.0) ** 2)]).discretise(Ts)
    chi = characteristic(drive.A)
    r, s = recursion_with_mode(drive, mode)

    def ripple(k: int, *_: object) -> float:
        return float(np.sin(14 * np.pi * t[k]))

    def case(name: str, disturbance: Disturbance, recursion: Array, of_x_pb: Array | None = None) -> Case:
        run = simulate(drive, x_d, disturbance)
        known = None if of_x_pb is None else np.convolve(of_x_pb, run.x_pb)[:n]
        news = np.abs(innovation(run.e_pb, recursion, known))
        return Case(
            name=name,
            order=len(recursion) - 1,
            residual_rms=float(np.sqrt(np.mean(run.e_pb**2))),
            closed_form_error=float(np.max(np.abs(run.e_pb - residual_closed_form(drive, run.h)))),
            innovation_rms=float(np.sqrt(np.mean(news**2))),
            innovation_max=float(np.max(news)),
            n_spikes=int(np.sum(news > 1e-9 * np.max(np.abs(run.e_pb)))),
        )

    friction, curve = coulomb(2.0, x_d), quadratic(drive, 100.0, 1000.0)
    return (
        case("Coulomb friction", friction, np.convolve(chi, polynomial(0))),
        case("sinusoid of time", ripple, np.convolve(chi, sinusoid(7.0, Ts))),
        case("mode, its order left out", linear_mode(drive, mode), chi),
        case("mode, with past x_pb", linear_mode(drive, mode), r, s),
        *(case(f"quadratic, η of degree {d}", curve, np.convolve(chi, polynomial(d))) for d in range(3)),
    )
