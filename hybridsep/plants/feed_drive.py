"""Nonlinear spring-mass-damper drive, eqs. (12) and (13)."""

import math

from ..base.errors import ParameterError, SignalError
from ..base.settings import check
from ..base.signals import check_position
from .plant import RATE_MAX, STATE_MAX, check_step, internal_steps


class FeedDrive:
    """Spring-mass-damper drive with quadratic damping and stiffness, eq. (13).

    ``m ẍ + c ẋ + k x + H_NL = c ẋ_d + k x_d`` with ``H_NL = c_nl·ẋ|ẋ| + k_nl·x|x|``, in the states
    ``x`` and ``u = ẋ − (c/m) x_d``, which need no derivative of the command. Mass, kg, damping, N·s/m, and stiffness,
    N/m, are > 0; the quadratic ones, N·s²/m² and N/m², both 0, give eq. (11).
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
        """Reset the drive to rest at ``start``, m."""
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
        check_position("x_d", x_d)
        check_step(h, self._rate)
        r = x_d - self._start
        a, w2 = self.c / self.m, self.k / self.m
        n = internal_steps(h, self._rate)
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
        if not (abs(x) < STATE_MAX and abs(u) < STATE_MAX):
            raise SignalError(f"the drive's state overflowed (x = {x}, command {x_d} m)")
        self._x, self._u, self._x_d = x, u, r

    def state(self) -> list[float]:
        """Return ``[start, x, u, x_d]``."""
        return [self._start, self._x, self._u, self._x_d]

    def restore(self, state: list[float]) -> None:
        """Restore a :meth:`state`."""
        self._start, self._x, self._u, self._x_d = state
