"""Features of the experts: disturbances filtered by the physics model, and increments of the command.

What the physics model misses acts where the command does, so ``e_pb = G_pb d(x, v)``. A static feature, one without
lags, is ``G_pb`` applied to a candidate disturbance ``d``: friction ``tanh(v/v_i)`` over a spread of velocities
``v_i``; friction before sliding and backlash, which follow the distance since a reversal, the stop operators of Prandtl
and Ishlinskii ``u_i ← clip(u_i + Δx_d, −r_i, r_i)`` over a spread of distances ``r_i``; stiffness ``x·|x|`` and damping
``v·|v|``; where a period is given, ``sin`` and ``cos`` of the position over it, as of cogging or a screw's pitch; and
functions of the user's own. First differences of them take up errors of ``G_pb`` in phase, changes of the command what
it lacks. As nothing here depends on the learned weights, no recursion can become unstable.

The expert without a physics model, eq. (4) with ``G_pb = 1``, predicts the residual of the command,
``e_0(k) = x(k) − x_d(k − d)``, where ``d`` is the physics model's dead time less two samples, or less half of it if
that is more, at least 0; its features are a constant and the increments ``x_d(k−d−j) − x_d(k−d−j−1)``,
``j = 0 … p``, beside ``p`` lags of it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import SignalError
from ...base.signals import Array, first_differences
from ...model.discrete import DiscreteModel
from ..regression import lags
from ..window import ResidualWindow
from .constants import CONSTANTS


@dataclass(frozen=True)
class CommandFeatures:
    """Features of the command, over consecutive windows."""

    dead_time: int  # ``d``: samples before the command may act, fewer than the physics model's

    @classmethod
    def of(cls, dead_time: int) -> "CommandFeatures":
        """Return the features for a physics model's dead time, samples: half of it may be wrong."""
        return cls(max(dead_time - max(CONSTANTS.dead_time_margin, dead_time // 2), 0))

    @property
    def p(self) -> int:
        """Lags."""
        return CONSTANTS.lags_of_command

    @property
    def n_before(self) -> int:
        """Commands before a window that its features need."""
        return self.dead_time + self.p + 1

    @cached_property
    def shares(self) -> Array:
        """Effects that features may have, ``(p + 2,)``, relative to the largest: an old increment explains less."""
        return np.concatenate(([1.0], np.sqrt(CONSTANTS.last_lag ** (np.arange(self.p + 1) / self.p))))

    def rows(self, before: Array, x_d: Array) -> Array:
        """Return the features of a window, ``(n, p + 2)``: 1, and the increments.

        ``before``, (n_before,), m: commands before it, oldest first; ``x_d``, (n,), m.
        """
        increments = np.diff(np.concatenate((before, x_d))[: self.p + 1 + len(x_d)])
        return np.column_stack((np.ones(len(x_d)), lags(increments, self.p + 1)))

    def changes(self, commands: Array, n: int) -> list[Array]:
        """Return the changes over each span that ends ``d`` samples before each of the last ``n`` commands, rows."""
        last = len(commands) - self.dead_time
        ends = [commands[last - n - late : last - late] for late in (0, *(SPAN**i for i in range(1, N_SPANS + 1)))]
        return [now - before for now, before in pairwise(ends)]

    def late(self, before: Array, x_d: Array) -> Array:
        """Return the commands ``d`` samples ago over a window, ``(n,)``, m; parameters as for :meth:`rows`."""
        return np.concatenate((before, x_d))[self.p + 1 : self.p + 1 + len(x_d)]

    def largest(self, step: float) -> Array:
        """Return the largest magnitudes of the features, ``(p + 2,)``, for the largest increment ``step``, m."""
        return np.concatenate(([1.0], np.full(self.p + 1, step)))


Disturbance: TypeAlias = Callable[[Array, Array], ArrayLike]
"""Disturbance of the user's own, ``d(x, v)``, in any unit: a number for each position ``x``, m, and commanded velocity
``v``, m/s, ``(n,)`` each. It knows nothing of other samples."""

N_SPANS, SPAN = 3, 3
"""Spans of samples over which changes of the command are features, and the ratio from one's end to the next one's."""

N_FRICTION, N_STOPS, _N_PERIODIC = 6, 3, 2
"""Disturbances by friction, by stop operators, and what repeats with the position."""

N_LASTING = N_FRICTION + N_STOPS + 2
"""Disturbances that every axis has: friction, stop operators, stiffness and damping."""

_RESOLVED = 32.0
"""Motion from one sample to the next, in units of the last place of the start, below which a command is at rest: the
plans of an axis that stands are rounded."""

LEAST_VELOCITY = 1e-200  # velocity, m/s, below which a command is at rest: ratios of smaller ones may underflow
_OWN_MAX = 1e100  # magnitude that a disturbance of the user's own must not exceed
_DIFFERENCES = 3  # largest order of a difference of ``x_pb``: velocity, acceleration and jerk


@dataclass(frozen=True, eq=False)
class StaticState:
    """State of the features between two windows; positions relative to the start."""

    filters: Array  # (n_state, n_disturbances): state of ``G_pb`` for each disturbance
    filtered: Array  # (n_disturbances,): last filtered disturbances
    x_d: Array  # (d + p_A + 1,), m: last commands, oldest first, of which the command's expert has ``p_A`` lags
    x_pb: Array  # (4,), m: last physics-based predictions, oldest first
    stops: Array  # (N_STOPS,), m: of the stop operators


class StaticRows(NamedTuple):
    """Features of a window."""

    rows: Array  # (n, n_static)
    after: StaticState  # the state after it
    # (n, n_disturbances) and (n, N_STOPS), m: before they are filtered, and the stop operators
    disturbances: Array
    stops: Array


@dataclass(frozen=True)
class StaticFeatures:
    """Features without lags, over consecutive windows."""

    discrete: DiscreteModel  # ``G_pb``
    q: int  # largest lag of ``x_pb``, as that many differences, at most three
    period: float = 0.0  # m: of a disturbance that repeats with the position; 0: none
    own: tuple[Disturbance, ...] = ()  # the user's own
    # under a compensator: commands that are known from the last measured one on, of a path that may go on. The
    # position's own velocity is damped then, as ``x_pb`` turns with every change of the command, else that of ``x_pb``
    n_known: int | None = None

    @cached_property
    def n_differences(self) -> int:
        """Differences of ``x_pb`` among the features."""
        return min(self.q, _DIFFERENCES)

    @cached_property
    def n_disturbances(self) -> int:
        """Number of disturbances."""
        return N_LASTING + (_N_PERIODIC if self.period > 0.0 else 0) + len(self.own)

    @cached_property
    def n_linear(self) -> int:
        """Number of features before the disturbances: 1, ``x_pb``, its differences, changes of the command."""
        return 2 + self.n_differences + N_SPANS

    @cached_property
    def n(self) -> int:
        """Number of features."""
        return self.n_linear + 2 * self.n_disturbances

    @cached_property
    def command(self) -> CommandFeatures:
        """Features of the command."""
        return CommandFeatures.of(self.discrete.dead_time)

    @cached_property
    def shares(self) -> Array:
        """Effects that features may have, ``(n,)``, relative to the largest."""
        shares = np.ones(self.n)
        shares[-self.n_disturbances :] = CONSTANTS.difference_share
        return shares

    def rest(self) -> StaticState:
        """Return the state at rest."""
        n, x_d = self.n_disturbances, np.zeros(self.command.n_before)
        return StaticState(self.discrete.rest(n), np.zeros(n), x_d, np.zeros(_DIFFERENCES + 1), np.zeros(N_STOPS))

    def peak_velocity(self, commands: Array, start: float) -> float:
        """Return the largest magnitude of the velocity of commands ``(n,)``, m, m/s; 0 below the numbers' resolution.

        ``start``, m, is what they are relative to.
        """
        step = float(np.abs(np.diff(commands)).max(initial=0.0))
        return step / self.discrete.T_s if step > _RESOLVED * np.finfo(np.float64).eps * abs(start) else 0.0

    def spread(self, velocity_scale: float) -> Array:
        """Return the velocities of the friction's change of sign, ``(N_FRICTION,)``, m/s."""
        spread = CONSTANTS.friction_least * CONSTANTS.friction_ratio ** np.arange(N_FRICTION)
        return np.asarray((velocity_scale or 1.0) * spread)

    def distances(self, velocity_scale: float) -> Array:
        """Return the distances of the stop operators, ``(N_STOPS,)``, m."""
        spread = CONSTANTS.stop_least * CONSTANTS.stop_ratio ** np.arange(N_STOPS)
        return np.asarray((velocity_scale or 1.0) * spread)

    def stops(self, state: StaticState, x_d: Array, velocity_scale: float) -> Array:
        """Return the stop operators over a window, ``(n, N_STOPS)``, m."""
        steps, found = first_differences(x_d, state.x_d[-1]).tolist(), np.empty((len(x_d), N_STOPS))
        for i, distance in enumerate(self.distances(velocity_scale).tolist()):
            u, of_operator = float(state.stops[i]), []
            for step in steps:
                u += step
                if u > distance:  # min and max take three times as long
                    u = distance
                elif u < -distance:
                    u = -distance
                of_operator.append(u)
            found[:, i] = of_operator
        return found

    def velocity(self, state: StaticState, x_d: Array) -> Array:
        """Return the commanded velocity over a window, ``(n,)``, m/s."""
        return first_differences(x_d, state.x_d[-1]) / self.discrete.T_s

    def damped_velocity(self, state: StaticState, x_pb: Array, x: Array) -> Array:
        """Return the velocity of the damping over a window, ``(n,)``, m/s."""
        v = first_differences(x_pb, state.x_pb[-1])
        if self.n_known:
            e = x - x_pb
            v = v + first_differences(e, e[0])
        return np.asarray(v / self.discrete.T_s)

    def turned(self, state: StaticState, rows: Array) -> Array:
        """Return how far the command of a window goes against the motion before it, ``(n,)``, from 0 to 1.

        The sharpest friction is the direction now, the shortest stop operator that of the last motion, rests or not.
        """
        return np.asarray(np.clip(-rows[:, self.n_linear] * state.filtered[N_FRICTION], 0.0, 1.0))

    def angle(self, x: Array | float) -> Array:
        """Return the angle within the period at a position, rad."""
        return np.asarray(2.0 * np.pi / self.period * x)

    def own_at(self, x: Array, v: Array) -> Array:
        """Return the disturbances of the user's own at positions, m, and velocities, m/s, ``(n, n_own)``."""
        found = np.empty((len(x), len(self.own)))
        for i, disturbance in enumerate(self.own):
            name = f"disturbances[{i}]"
            try:
                values = np.asarray(disturbance(x.copy(), v.copy()), dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise SignalError(f"{name} must return numbers for arrays x, m, and v, m/s: {error}") from error
            if values.shape not in ((), x.shape):
                raise SignalError(f"{name} must return a number for each of {len(x)} samples, got shape {values.shape}")
            if not np.all(np.abs(values) <= _OWN_MAX):  # NaN too
                raise SignalError(f"{name} must be finite and at most {_OWN_MAX:g} in magnitude")
            found[:, i] = values
        return found

    def rows(
        self,
        state: StaticState,
        window: ResidualWindow,
        x: Array,
        velocity_scale: float,
        like: StaticRows | None = None,
    ) -> StaticRows:
        """Return the features of a window, ``(n, self.n)``, and the state after it.

        Columns: 1; ``x_pb`` and its differences; changes of the command; the filtered disturbances; their first
        differences.

        ``x``, (n,), m: position that the stiffness acts at, and whose velocity is damped with ``n_known``;
        ``velocity_scale``: velocity, m/s, that the friction's change of sign is relative to; 0 before any motion;
        ``like``: features of the same window, or of a longer one, for another ``x``.
        SignalError if a disturbance of the user's own does not return a finite number for each sample.
        """
        x_d, x_pb, start, _ = window
        first, stiffness, n = self.n_linear, N_FRICTION + N_STOPS, len(x_d)
        v_d, v = self.velocity(state, x_d), self.damped_velocity(state, x_pb, x)
        past, commands = np.concatenate((state.x_pb, x_pb)), np.concatenate((state.x_d, x_d))
        if like is None:
            disturbances, rows = np.empty((n, self.n_disturbances)), np.empty((n, self.n))
            disturbances[:, :N_FRICTION] = np.tanh(v_d[:, None] / self.spread(velocity_scale))
            stops = self.stops(state, x_d, velocity_scale)
            disturbances[:, N_FRICTION:stiffness] = stops / self.distances(velocity_scale)
            rows[:, 0] = 1.0
            rows[:, 1], change = x_pb, past
            for i in range(2, self.n_differences + 2):
                change = change[1:] - change[:-1]
                rows[:, i] = change[-n:]
            rows[:, first - N_SPANS : first] = np.transpose(self.command.changes(commands, n))
        else:
            rows, disturbances, stops = like.rows[:n].copy(), like.disturbances[:n].copy(), like.stops[:n]
        disturbances[:, stiffness] = x * np.abs(x)
        disturbances[:, stiffness + 1] = v * np.abs(v)
        if self.period > 0.0:
            angle, at_start = self.angle(start + x), self.angle(start + 0.0)
            disturbances[:, N_LASTING] = np.sin(angle) - np.sin(at_start)
            disturbances[:, N_LASTING + 1] = np.cos(angle) - np.cos(at_start)
        if self.own:
            at_rest = self.own_at(np.full(1, start), np.zeros(1))
            disturbances[:, -len(self.own) :] = self.own_at(start + x, v_d) - at_rest
        filtered, filters = self.discrete.forced_response(state.filters, disturbances)
        rows[:, first : first + self.n_disturbances] = filtered
        rows[:, first + self.n_disturbances :] = first_differences(filtered, state.filtered)
        before = past[-_DIFFERENCES - 1 :].copy()
        after = StaticState(filters, filtered[-1].copy(), commands[n:], before, stops[-1].copy())
        return StaticRows(rows, after, disturbances, stops)
