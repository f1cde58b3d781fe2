"""Linear-motor stage: modal model, eq. (15), with friction and cable stiffness as input disturbances."""

import math

from ..base.clock import SampleClock
from ..base.errors import ParameterError, SignalError
from ..base.settings import PARAMETERS, check
from ..base.signals import check_position
from ..model.physics import ModalModel
from .plant import RATE_MAX, STATE_MAX, check_step, internal_steps

_STEPS_MAX = 60  # largest number of Newton steps: 4 to 8 usually, one for each bit where the solution is about to end


def velocity_under_friction(w: float, gain: float, scale: float, last: float) -> float:
    """Return the solution of ``v = w − gain·tanh(v/scale)``, m/s, scale > 0.

    ``w`` is the velocity without friction, ``gain`` what the whole friction takes away at once, and ``last`` the
    velocity before, whose direction is kept where there are two solutions.
    """
    if w == 0.0 and last == 0.0:
        return 0.0
    sign = math.copysign(1.0, w)
    if gain < -scale:
        # v + gain·tanh(v/scale) falls between ± turn: a solution of the other sign than w may be there
        ratio = -gain / scale
        turn = scale * math.log(math.sqrt(ratio) + math.sqrt(ratio - 1.0))  # acosh √ratio
        if last * w < 0.0 and abs(w) <= -turn - gain * math.tanh(turn / scale):
            sign = -sign
    w *= sign
    # Newton from the side where its steps are monotone: v + gain·tanh(v/scale) is concave or convex for v > 0.
    v = max(w - gain, w / (1.0 + gain / scale)) if gain > 0.0 else w - gain
    for _ in range(_STEPS_MAX):
        t = math.tanh(v / scale)
        slope = 1.0 + gain / scale * (1.0 - t * t)
        if not slope > 0.0:
            break
        step = (v + gain * t - w) / slope
        v -= step
        if abs(step) <= 1e-15 * abs(v):
            break
    return sign * v


class StageDrive:
    """Linear-motor stage: modal model with friction and cable stiffness as input disturbances.

    ``x = G_pb (x_d − d)`` with ``d = f·tanh(v_f/v_friction) + κ·x·|x|``. ``v_f`` is the commanded velocity, the
    backward difference of ``x_d`` over ``T_s``, or the velocity of ``x`` itself.

    Without a dead time and held, a command acts at once; else it is sampled at the instants ``k·T_s``. A first-order
    hold with a dead time goes from the last command to this one, which takes one sample of the dead time, and is then
    the physics model's hold. Without a dead time that would need the next command, so the command goes on with its last
    slope.

    ``f``, m, and ``kappa``, 1/m, both ≥ 0, are friction and cable stiffness as offsets of the command, ``T_s``, s, is
    its sampling interval, and ``friction_on`` says which velocity the friction has, the command's or the motion's.
    ``v_friction``, m/s, over which it changes sign, is 2 mm/s, a choice of the stand-in, as the paper gives none.
    """

    def __init__(
        self,
        model: ModalModel,
        f: float = 0.0,
        kappa: float = 0.0,
        T_s: float = 1e-3,
        friction_on: str = "command",
        *,
        v_friction: float = PARAMETERS["v_friction"].default,
        input_hold: str = "zoh",
    ) -> None:
        self.model = model
        self.f: float = check("f", f)
        self.kappa: float = check("kappa", kappa)
        self.T_s: float = check("T_s", T_s)
        self.friction_on: str = check("friction_on", friction_on)
        self.v_friction: float = check("v_friction", v_friction)
        self.input_hold: str = check("input_hold", input_hold)
        self._foh, self._late = self.input_hold == "foh", model.dead_time > 0
        self._n_line = model.dead_time - (self._foh and self._late)
        self._friction_gain = self.f * sum(mode.beta for mode in model.modes)
        self._modes = [(mode.omega**2, 2 * mode.zeta * mode.omega, mode.alpha, mode.beta) for mode in model.modes]
        rates = [max(math.sqrt(mode.omega**2), 2 * mode.zeta * mode.omega) for mode in model.modes]  # 1/s
        self._rate = max(rates)
        for i, rate in enumerate(rates, start=1):
            if rate > RATE_MAX:
                raise ParameterError(
                    f"2 pi f_n and 4 pi f_n zeta of mode[{i}] must be at most {RATE_MAX:g} 1/s in a plant, "
                    f"got {rate:g}; lower f_n or zeta"
                )
        self.reset()

    def reset(self, start: float = 0.0) -> None:
        """Reset the stage to rest at ``start``, m."""
        self._start = start
        self._z = [0.0] * (2 * len(self._modes))
        self._acting, self._last_x_d, self._v_d, self._v = 0.0, 0.0, 0.0, 0.0
        self._line = [0.0] * self._n_line  # commands on their way through the dead time, the oldest first
        self._clock = SampleClock.begin(0.0, self.T_s)  # time since the reset

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
        check_position("x_d", x_d)
        check_step(h, self._rate)
        step = self._clock.stepped(self._clock.end, h)
        r, z, v = x_d - self._start, self._z, self._v
        acting = self._acting if self._foh or self._late else r
        last_x_d, v_d, done = self._last_x_d, self._v_d, 0.0
        # The command is sampled, and v_d updated, at the sampling instants, whatever the step size.
        for i in range(step.n_latched + 1):
            end = max(done, step.first + i * self.T_s) if i < step.n_latched else h
            if end > done:
                z, v = self._integrated(z, acting, v_d, end - done, v)
                acting += v_d * (end - done) if self._foh else 0.0
                done = end
            if i < step.n_latched:
                left = self._line[i] if i < self._n_line else r
                v_d = (left - last_x_d) / self.T_s
                acting = last_x_d if self._foh and self._late else left
                last_x_d = left
        if not all(abs(s) < STATE_MAX for s in z):
            raise SignalError(f"the stage's state overflowed (command {x_d} m)")
        self._z, self._v = z, self._position(self._derivative(z, self._disturbed(acting, v_d), v))
        n_entered = min(step.n_latched, self._n_line)
        self._line = self._line[n_entered:] + [r] * n_entered
        self._acting, self._last_x_d, self._v_d, self._clock = acting, last_x_d, v_d, step.after

    def state(self) -> list[float]:
        """Return ``[start, acting and last x_d, v_d, v, 5 numbers of the clock, z …, x_d within the dead time …]``."""
        moving = [self._acting, self._last_x_d, self._v_d, self._v]
        return [self._start, *moving, *map(float, self._clock), *self._z, *self._line]

    def restore(self, state: list[float]) -> None:
        """Restore a :meth:`state`."""
        self._start, self._acting, self._last_x_d, self._v_d, self._v = state[:5]
        self._clock = SampleClock(state[5], int(state[6]), *state[7:10])
        end = 10 + 2 * len(self._modes)
        self._z, self._line = list(state[10:end]), list(state[end:])

    def _disturbed(self, r: float, v_d: float) -> float:
        """Return the command disturbed by friction, if it is one of the commanded velocity."""
        return r - self.f * math.tanh(v_d / self.v_friction) if self.friction_on == "command" else r

    def _integrated(self, z: list[float], acting: float, v_d: float, h: float, v: float) -> tuple[list[float], float]:
        """Return ``z`` after ``h``, s, from the command that acts, and a velocity of the last internal step."""
        n = internal_steps(h, self._rate)
        dt, f, rate = h / n, self._derivative, v_d if self._foh else 0.0  # m/s, with which the command goes on
        half, sixth = dt / 2, dt / 6
        first = self._disturbed(acting, v_d)
        for i in range(n):
            disturbed = first + rate * (i * dt)
            middle = disturbed + rate * half
            k1 = f(z, disturbed, v)
            v = self._position(k1)
            k2 = f([s + half * k for s, k in zip(z, k1, strict=True)], middle, v)
            k3 = f([s + half * k for s, k in zip(z, k2, strict=True)], middle, v)
            k4 = f([s + dt * k for s, k in zip(z, k3, strict=True)], disturbed + rate * dt, v)
            z = [s + sixth * (a + 2 * b + 2 * c + d) for s, a, b, c, d in zip(z, k1, k2, k3, k4, strict=True)]
        return z, v

    def _position(self, z: list[float]) -> float:
        x, i = 0.0, 0  # in a loop: a sum over a generator takes twice as long
        for _, _, alpha, beta in self._modes:
            x += alpha * z[i] + beta * z[i + 1]
            i += 2
        return x

    def _derivative(self, z: list[float], disturbed: float, v: float) -> list[float]:
        """Return the slope of ``z``; ``v``, m/s, is a velocity shortly before."""
        x = self._position(z)
        u = disturbed - self.kappa * x * abs(x)
        slope: list[float] = []
        i = 0
        for w2, two_zw, _, _ in self._modes:
            # z̈ + 2ζω ż + ω² z = u, eq. (15)
            rate = z[i + 1]
            slope += (rate, u - two_zw * rate - w2 * z[i])
            i += 2
        if self.friction_on == "motion":
            v = velocity_under_friction(self._position(slope), self._friction_gain, self.v_friction, v)
            friction = self.f * math.tanh(v / self.v_friction)
            slope[1::2] = [s - friction for s in slope[1::2]]
        return slope
