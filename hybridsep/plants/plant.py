"""Nonlinear feed drives to validate the model against: eq. (13) and a stage with friction and cable stiffness.

Both hold the command constant over a step, both are at rest at ``start`` at first, and both measure positions from
there, as the predictor does. They are integrated by the classical Runge-Kutta method, in plain floats, without
differentiating ``x_d``; internal steps are at most 0.1 ms and 1/16 of the linear part's fastest time constant.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..base.clock import SampleClock, check_step_size
from ..base.errors import ParameterError, SignalError
from ..base.parameters import check
from ..base.signals import POSITION_MAX, Array, as_samples
from ..model.physics import ModalModel, Mode

__all__ = ["FRICTION_VELOCITY", "INTERNAL_STEP", "Encoder", "FeedDrive", "Plant", "StageDrive", "simulate"]

INTERNAL_STEP = 1e-4
"""Longest internal integration step, s."""

RATE_MAX = 1e5
"""Fastest rate of a drive's linear part, 1/s: a time constant of 10 µs takes 1600 internal steps a millisecond."""

FRICTION_VELOCITY = 2e-3
"""Velocity over which the stage's friction changes sign, m/s."""


class Plant(Protocol):
    """A drive that can be stepped."""

    def reset(self, start: float = 0.0) -> None:
        """Put the drive to rest at ``start``, m."""

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""

    @property
    def x(self) -> float:
        """True position, m."""

    @property
    def v(self) -> float:
        """True velocity, m/s."""

    def state(self) -> list[float]:
        """Return the state as plain numbers."""

    def restore(self, state: list[float]) -> None:
        """Take over what :meth:`state` returned."""


class FeedDrive:
    """The spring-mass-damper drive with quadratic damping and stiffness, eq. (13).

    ``m ẍ + c ẋ + k x + H_NL = c ẋ_d + k x_d`` with ``H_NL = c_nl·ẋ|ẋ| + k_nl·x|x|``, in the states
    ``x`` and ``u = ẋ − (c/m) x_d``, which need no derivative of the command.

    Parameters
    ----------
    m, c, k : float
        Mass kg, damping N·s/m, stiffness N/m, > 0.
    c_nl, k_nl : float
        Quadratic damping N·s²/m² and stiffness N/m², ≥ 0; both 0 give eq. (11).
    """

    def __init__(self, m: float, c: float, k: float, c_nl: float = 0.0, k_nl: float = 0.0) -> None:
        self.m: float = check("m", m)
        self.c: float = check("c", c)
        self.k: float = check("k", k)
        self.c_nl: float = check("c_nl", c_nl)
        self.k_nl: float = check("k_nl", k_nl)
        self._rate = max(math.sqrt(self.k / self.m), self.c / self.m)
        if self._rate > RATE_MAX:
            raise ParameterError(
                f"sqrt(k/m) and c/m must be at most {RATE_MAX:g} 1/s, got {self._rate:g}; lower k or c, or raise m"
            )
        self.reset()

    def reset(self, start: float = 0.0) -> None:
        """Put the drive to rest at ``start``, m."""
        self._start, self._x, self._u, self._x_d = start, 0.0, 0.0, 0.0

    @property
    def x(self) -> float:
        """True position, m."""
        return self._start + self._x

    @property
    def v(self) -> float:
        """True velocity under the command of the last step, m/s."""
        return self._u + self.c / self.m * self._x_d

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""
        _check_command(x_d)
        _check_step(h, self._rate)
        r = x_d - self._start
        a, w2 = self.c / self.m, self.k / self.m
        n = _internal_steps(h, self._rate)
        dt = h / n
        c_m, k_m = self.c_nl / self.m, self.k_nl / self.m

        def f(x: float, u: float) -> tuple[float, float]:
            v = u + a * r
            # Eq. (13): u̇ = −(c/m) v − (k/m)(x − x_d) − H_NL/m
            return v, -a * v - w2 * (x - r) - c_m * v * abs(v) - k_m * x * abs(x)

        x, u = self._x, self._u
        for _ in range(n):
            p1, q1 = f(x, u)
            p2, q2 = f(x + dt / 2 * p1, u + dt / 2 * q1)
            p3, q3 = f(x + dt / 2 * p2, u + dt / 2 * q2)
            p4, q4 = f(x + dt * p3, u + dt * q3)
            x += dt / 6 * (p1 + 2 * p2 + 2 * p3 + p4)
            u += dt / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
        if not (abs(x) < _STATE_MAX and abs(u) < _STATE_MAX):
            raise SignalError(f"the drive's state left the range of numbers (x = {x}, command {x_d} m)")
        self._x, self._u, self._x_d = x, u, r

    def state(self) -> list[float]:
        """Return ``[start, x, u, x_d]``."""
        return [self._start, self._x, self._u, self._x_d]

    def restore(self, state: list[float]) -> None:
        """Take over what :meth:`state` returned."""
        self._start, self._x, self._u, self._x_d = state


class StageDrive:
    """A linear-motor stage: a modal model whose command is disturbed by friction and cable stiffness.

    ``x = G_pb (x_d − d)`` with ``d = f·tanh(v_d / 2 mm/s) + κ·x·|x|``: the carriage's friction follows the commanded
    velocity ``v_d``, the backward difference of ``x_d`` over ``T_s``.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``, eq. (15), without dead time.
    f : float
        Friction as an offset of the command, m, ≥ 0.
    kappa : float
        Cable stiffness as an offset of the command, 1/m, ≥ 0.
    Ts : float
        Interval at which the command is sampled, s, over which ``v_d`` is taken.
    """

    def __init__(self, model: ModalModel, f: float = 0.0, kappa: float = 0.0, Ts: float = 1e-3) -> None:
        if model.dead_time:
            raise ParameterError(f"the stage's model must have no dead time, got {model.dead_time} samples")
        self.model = model
        self.f: float = check("f", f)
        self.kappa: float = check("kappa", kappa)
        self.Ts: float = check("T_s", Ts)
        self._modes = [(mode.omega**2, 2 * mode.zeta * mode.omega, mode.alpha, mode.beta) for mode in model.modes]
        self._rate = max(map(_mode_rate, model.modes))
        for i, mode in enumerate(model.modes, start=1):
            if _mode_rate(mode) > RATE_MAX:
                raise ParameterError(
                    f"2 pi f_n and 4 pi f_n zeta of mode[{i}] must be at most {RATE_MAX:g} 1/s in a plant, "
                    f"got {_mode_rate(mode):g}; lower f_n or zeta"
                )
        self.reset()

    def reset(self, start: float = 0.0) -> None:
        """Put the stage to rest at ``start``, m."""
        self._start = start
        self._z = [0.0] * (2 * len(self._modes))
        self._last_x_d, self._v_d, self._v = 0.0, 0.0, 0.0
        self._clock = SampleClock.begin(0.0, self.Ts)  # a time of its own

    @property
    def x(self) -> float:
        """True position, m."""
        return self._start + self._position(self._z)

    @property
    def v(self) -> float:
        """True velocity under the command of the last step, m/s."""
        return self._v

    def step(self, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""
        _check_command(x_d)
        _check_step(h, self._rate)
        step = self._clock.stepped(self._clock.end, h)
        r, z = x_d - self._start, self._z
        last_x_d, v_d, done = self._last_x_d, self._v_d, 0.0
        # v_d is taken at the instants, in whatever steps they come.
        for i in range(step.n_latched + 1):
            end = max(done, step.first + i * self.Ts) if i < step.n_latched else h
            if end > done:
                z = self._integrated(z, self._pushed(r, v_d), end - done)
                done = end
            if i < step.n_latched:
                last_x_d, v_d = r, (r - last_x_d) / self.Ts
        if not all(abs(s) < _STATE_MAX for s in z):
            raise SignalError(f"the stage's state left the range of numbers (command {x_d} m)")
        self._z, self._v = z, self._position(self._derivative(z, self._pushed(r, v_d)))
        self._last_x_d, self._v_d, self._clock = last_x_d, v_d, step.after

    def state(self) -> list[float]:
        """Return ``[start, last x_d, v_d, v, 7 numbers of the clock, z …]``."""
        return [self._start, self._last_x_d, self._v_d, self._v, *self._clock.state(), *self._z]

    def restore(self, state: list[float]) -> None:
        """Take over what :meth:`state` returned."""
        self._start, self._last_x_d, self._v_d, self._v = state[:4]
        self._clock = SampleClock.from_state(state[4:11])
        self._z = list(state[11:])

    def _pushed(self, r: float, v_d: float) -> float:
        """Return the command after the carriage's friction, which follows the commanded velocity."""
        return r - self.f * math.tanh(v_d / FRICTION_VELOCITY)

    def _integrated(self, z: list[float], pushed: float, time: float) -> list[float]:
        """Return ``z`` after ``time`` seconds of a held command."""
        n = _internal_steps(time, self._rate)
        dt, f = time / n, self._derivative
        for _ in range(n):
            k1 = f(z, pushed)
            k2 = f([s + dt / 2 * k for s, k in zip(z, k1, strict=True)], pushed)
            k3 = f([s + dt / 2 * k for s, k in zip(z, k2, strict=True)], pushed)
            k4 = f([s + dt * k for s, k in zip(z, k3, strict=True)], pushed)
            z = [s + dt / 6 * (a + 2 * b + 2 * c + d) for s, a, b, c, d in zip(z, k1, k2, k3, k4, strict=True)]
        return z

    def _position(self, z: list[float]) -> float:
        return sum(alpha * z[2 * i] + beta * z[2 * i + 1] for i, (_, _, alpha, beta) in enumerate(self._modes))

    def _derivative(self, z: list[float], pushed: float) -> list[float]:
        x = self._position(z)
        u = pushed - self.kappa * x * abs(x)
        slope = []
        for i, (w2, two_zw, _, _) in enumerate(self._modes):
            # z̈ + 2ζω ż + ω² z = u, eq. (15)
            slope += [z[2 * i + 1], u - two_zw * z[2 * i + 1] - w2 * z[2 * i]]
        return slope


class Encoder:
    """A position sensor with normal noise that draws the same on every platform.

    SplitMix64 (Steele, Lea and Flood 2014) gives two uniforms a draw, Box and Muller (1958) make one normal of them.

    Parameters
    ----------
    noise_std : float
        Standard deviation, m, ≥ 0.
    seed : int
        0 … 2³¹ − 1.
    """

    def __init__(self, noise_std: float = 0.0, seed: int = 0) -> None:
        self.noise_std: float = check("noise_std", noise_std)
        self.seed: int = check("seed", seed)
        self.n_draws = 0

    def measure(self, x: float) -> float:
        """Return one measurement of the position ``x``, m."""
        first = 2 * self.n_draws
        self.n_draws += 1
        # Uniform in (0, 1] and [0, 1), 53 bits each
        u1 = ((_split_mix_64(self.seed, first) >> 11) + 1) * 2.0**-53
        u2 = (_split_mix_64(self.seed, first + 1) >> 11) * 2.0**-53
        return x + self.noise_std * math.sqrt(-2 * math.log(u1)) * math.cos(2 * math.pi * u2)

    def measure_all(self, x: ArrayLike) -> Array:
        """Return measurements of the positions ``x``, ``(n,)``, m, one draw each."""
        return np.array([self.measure(position) for position in as_samples(x, "x").tolist()])


def simulate(plant: Plant, x_d: ArrayLike, Ts: float, *, start: float | None = None) -> Array:
    """Return the true positions of a plant that gets each command held over one sampling interval.

    Parameters
    ----------
    plant : Plant
        Reset first.
    x_d : (n,) array_like, m
        Commanded positions.
    Ts : float
        Sampling interval, s.
    start : float, optional
        Where the drive rests at first, m; the first command if left out.

    Returns
    -------
    x : (n,) array, m
        ``x(k)``, reached before ``x_d(k)`` acts.
    """
    commands = as_samples(x_d, "x_d")
    if len(commands) == 0:
        raise SignalError("x_d must have at least one sample, got none")
    plant.reset(float(commands[0]) if start is None else start)
    x = np.empty(len(commands))
    for k, command in enumerate(commands.tolist()):
        x[k] = plant.x
        plant.step(command, Ts)
    return x


def _internal_steps(h: float, rate: float) -> int:
    """Return how many internal steps a step of ``h`` seconds takes; ``rate``, 1/s, is that of the fastest mode."""
    return max(1, math.ceil(max(h / INTERNAL_STEP, 16 * h * rate) - 1e-6))


def _check_step(h: float, rate: float) -> None:
    """Raise ParameterError if a drive whose fastest rate is ``rate``, 1/s, cannot do a step of ``h`` seconds."""
    check_step_size(h)
    longest = _STEPS_MAX / 16 / rate
    if h > longest:
        raise ParameterError(
            f"the step size must be at most {longest:g} s for a drive as fast as {rate:g} 1/s, got {h!r}; "
            "make several steps"
        )


def _mode_rate(mode: Mode) -> float:
    """Return the fastest rate of a mode, 1/s."""
    return max(math.sqrt(mode.omega**2), 2 * mode.zeta * mode.omega)


def _check_command(x_d: float) -> None:
    """Raise SignalError if a command is no position, m."""
    if not abs(x_d) <= POSITION_MAX:  # NaN too
        raise SignalError(f"x_d must be within ±{POSITION_MAX:g} m, got {x_d:g}")


_STEPS_MAX = 1_000_000
_STATE_MAX = 1e100
_MASK: int = 0xFFFF_FFFF_FFFF_FFFF


def _split_mix_64(seed: int, index: int) -> int:
    """Return the ``index``-th number of the SplitMix64 sequence of ``seed``, 64 bits."""
    z = (seed + (index + 1) * 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)
