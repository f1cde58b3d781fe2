"""Few experts of the residual and their stacking, as an experiment: normal equations, no guard, no interval.

``e = x − x_pb`` over a window is predicted by physics (0), hold (the residual of the last sample measured), L (static
features and lags of ``e``), S (L without lags) and A (increments of the command and lags of ``x − x_d``: eq. (4) with
``G_pb = 1``), and by their sum with weights ``π ≥ 0``, ``Σπ ≤ 1``, the rest being physics'.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.predict.start_in_motion import motion_before
from hybridsep.predict.trust.blend import simplex_minimum
from hybridsep.predict.trust.disturbances import StaticFeatures

__all__ = ["Constants", "Experts"]

LEARNED = ("L", "S", "A")


@dataclass(frozen=True)
class Constants:
    """Constants of the experiment.

    Attributes
    ----------
    first : mapping
        Weight of each expert without evidence; the experts are its keys.
    kappa, gamma : float
        Ridge about the first weights, in windows of the best expert's mean square; factor by which evidence fades.
    shrink : float
        Factor on the variance that a prediction is shrunk by; 0: not at all.
    correlation_max, correlation_rate : float
        Bound on the rows that count as one; how fast their number follows.
    last_lag : float
        Prior variance of the weight of the last lag, relative to that of the first.
    first_noise, least_noise : float
        Variance of the noise before it is known and at least, relative to the largest mean square of a window.
    bound, bound_of_command : float
        Largest prediction relative to the largest residual so far, of the physics model and of the command.
    carried : float
        Largest weight of earlier runs when another begins, in windows.
    growth, growth_learned, learned : float
        Growth of the commanded velocity that makes L and S begin anew, until and from so many windows on.
    """

    first: dict[str, float] = field(default_factory=lambda: {"hold": 0.0, "L": 0.5, "S": 0.5, "A": 0.0})
    kappa: float = 1.0
    gamma: float = 0.95
    shrink: float = 1.0
    correlation_max: float = 100.0
    correlation_rate: float = 0.1
    last_lag: float = 0.005
    first_noise: float = 0.01
    least_noise: float = 1e-6
    bound: float = 1.2
    bound_of_command: float = 2.0
    carried: float = 30.0
    growth: float = 30.0
    growth_learned: float = 1000.0
    learned: float = 15.0


class Expert:
    """Regression ``[static | lags]`` with normal priors; free run over a window, shrunk by its own variance."""

    def __init__(self, n_static: int, p: int, shares: Array, constants: Constants) -> None:
        self.n, self.p, self.shares, self.constants = n_static, p, shares, constants
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.gram, self.cross = np.zeros((self.n + self.p,) * 2), np.zeros(self.n + self.p)
        self.squares = self.rows = self.noise = 0.0
        self.largest, self.correlation, self.unshrunk = np.zeros(self.n), 1.0, np.zeros(0)

    def discount(self, kept: float) -> None:
        """Weigh all rows so far by ``kept``."""
        self.gram, self.cross = kept * self.gram, kept * self.cross
        self.squares, self.rows = kept * self.squares, kept * self.rows

    def predict(self, static: Array, past: Array, square: float, bound: float) -> Array:
        """Return the prediction over a window, ``(n,)``, m.

        Parameters
        ----------
        static : (n, n_static) array
        past : (p,) array, m
            Last targets, newest first.
        square : float, m²
            Largest mean square of a window's target so far.
        bound : float, m
        """
        self.unshrunk = np.zeros(len(static))
        if not (self.rows and square):
            return self.unshrunk
        c = self.constants
        largest = np.maximum(np.maximum(self.largest, np.abs(static).max(axis=0)), 1e-150)
        lag_priors = np.sqrt(c.last_lag ** (np.arange(self.p) / max(self.p, 1)))
        priors = np.concatenate((np.sqrt(square) * self.shares / largest, lag_priors))
        noise = max(self.noise if self.noise > 0.0 else c.first_noise * square, c.least_noise * square)
        noise *= self.correlation
        system = self.gram + np.diag(noise / priors**2)
        scale = 1.0 / np.sqrt(np.diag(system))
        inverse = np.linalg.inv(system * scale[:, None] * scale) * scale[:, None] * scale
        w = inverse @ self.cross
        left = float(self.squares - 2.0 * w @ self.cross + w @ self.gram @ w)
        self.noise = max(left, 0.0) / self.rows
        e, response, phi = static @ w[: self.n], np.eye(1, len(static))[0], static
        if self.p:
            recursion = np.concatenate(([1.0], -w[self.n :]))
            with np.errstate(all="ignore"):  # an unstable recursion is recognised by what it gives
                e, _ = lfilter([1.0], recursion, e, zi=np.correlate(w[self.n :], past, "full")[self.p - 1 :])
                response = lfilter([1.0], recursion, response)
            e = np.clip(np.nan_to_num(e), -10.0 * bound, 10.0 * bound)
            response = np.clip(np.nan_to_num(response, nan=1e6), -1e6, 1e6)
            phi = np.hstack((static, lags(past, e)))
        variance = lfilter(response**2, [1.0], noise * np.einsum("ij,jk,ik->i", phi, inverse, phi))
        self.unshrunk = e
        kept = square / (square + c.shrink * np.minimum(variance, 1e6 * bound**2))
        return np.asarray(np.clip(e, -bound, bound) * kept)

    def learn(self, static: Array, past: Array, target: Array) -> None:
        """Learn a window that was measured."""
        c = self.constants
        phi = np.hstack((static, lags(past, target))) if self.p else static
        self.largest = np.maximum(self.largest, np.abs(static).max(axis=0))
        if self.noise > 0.0 and len(self.unshrunk) == len(target):
            seen = min(len(target) * float(np.mean(target - self.unshrunk)) ** 2 / self.noise, 1e4)
            followed = self.correlation + c.correlation_rate * (seen - self.correlation)
            self.correlation = min(max(followed, 1.0), c.correlation_max)
        self.gram, self.cross = self.gram + phi.T @ phi, self.cross + phi.T @ target
        self.squares, self.rows = self.squares + float(target @ target), self.rows + len(target)


class Stack:
    """Weights ``π = argmin_{π ≥ 0, Σπ ≤ 1} ‖e − Fπ‖² + κ s² n ‖π − π₀‖²``, ``s²`` of the best expert so far."""

    def __init__(self, constants: Constants) -> None:
        self.constants, self.first = constants, np.array(list(constants.first.values()))
        n = len(self.first)
        self.weights, self.gram, self.cross = self.first.copy(), np.zeros((n, n)), np.zeros(n)
        self.squares = self.rows = 0.0

    def update(self, predicted: Array, e: Array, least: float) -> None:
        """Update with a measured window.

        Parameters
        ----------
        predicted : (n_experts, n) array, m
            What was predicted.
        e : (n,) array, m
            What came.
        least : float, m²
            Least mean square.
        """
        gamma = self.constants.gamma
        self.gram, self.cross = gamma * self.gram + predicted @ predicted.T, gamma * self.cross + predicted @ e
        self.squares, self.rows = gamma * self.squares + float(e @ e), gamma * self.rows + len(e)
        errors = self.squares - 2.0 * self.cross + np.diag(self.gram)
        best = max(min(float(errors.min()), self.squares) / self.rows, least, 1e-300)
        ridge = self.constants.kappa * best * len(e)
        self.weights = simplex_minimum(self.gram + ridge * np.eye(len(predicted)), self.cross + ridge * self.first)


class Experts:
    """Experts of one axis, learned run after run.

    Parameters
    ----------
    model : ModalModel
    settings : PredictorSettings
    constants : Constants, optional
    """

    def __init__(self, model: ModalModel, settings: PredictorSettings, constants: Constants | None = None) -> None:
        self.model, self.settings = model, settings
        self.constants = c = Constants() if constants is None else constants
        self.discrete = model.discretise(settings.T_s, settings.input_hold)
        self.static, self.p = StaticFeatures(self.discrete, settings.q), min(settings.p, settings.Np)
        own = {
            "L": (self.static.n, self.p, self.static.shares),
            "S": (self.static.n, 0, self.static.shares),
            "A": (self.p + 2, self.p, np.ones(self.p + 2)),
        }
        self.experts = {name: Expert(*own[name], c) for name in LEARNED if name in c.first}
        self.stack = Stack(c)
        self.largest = self.square = self.largest_0 = self.square_0 = self.speed = 0.0

    def replay(self, x_d: Array, x: Array) -> tuple[Array, Array, Array]:
        """Return ``x_h`` and ``x_pb``, ``(n,)``, m, and what each expert predicted, ``(n_experts, n)``, m, of a run."""
        Np, n, p = self.settings.Np, len(x_d), self.p
        u, y, state = x_d - x_d[0], x - x_d[0], self.static.rest()
        x_pb, _ = self.discrete.forced_response(self.discrete.rest(), u)
        late = np.concatenate((np.zeros(self.model.dead_time), u))[:n]
        increments = np.concatenate((np.zeros(p), np.diff(late, prepend=0.0)))
        generic = np.column_stack([np.ones(n)] + [increments[p - j : p - j + n] for j in range(p + 1)])
        predicted, x_h = np.zeros((len(self.constants.first), n)), np.zeros(n)
        for expert in self.experts.values():
            most = self.constants.carried * Np
            expert.discount(most / max(expert.rows, most))
        for a in range(0, n, Np):
            w = slice(a, min(a + Np, n))
            e, e_0 = y - x_pb, y - late
            past, past_0 = _before(e, a, p), _before(e_0, a, p)
            self._follow_speed(float(np.abs(np.diff(u[max(a - 1, 0) : w.stop], prepend=u[max(a - 1, 0)])).max()))
            x_at = x_pb[w]
            for _ in range(2):  # the stiffness acts at the position
                rows, _ = self.static.rows(state, u[w], x_pb[w], x_at, self.speed)
                predicted[:, w] = self._predicted(
                    rows, generic[w], past, past_0, late[w] - x_pb[w], e[a - 1] if a else 0.0
                )
                x_at = x_pb[w] + (predicted[list(self.constants.first).index("L"), w] if "L" in self.experts else 0.0)
            x_h[w] = x_pb[w] + self.stack.weights @ predicted[:, w]
            before = motion_before(self.model, self.discrete, u[w], e[w], 0) if a == 0 else None
            if before is not None:
                x_pb, _ = self.discrete.forced_response(self.discrete.rest() + before.state, u)
                ago = np.arange(-len(state.x_pb), 0)
                state = state._replace(x_d=float(2.0 * u[0] - u[1]), x_pb=x_pb[0] + (x_pb[1] - x_pb[0]) * ago)
                e, predicted[:, w] = y - x_pb, 0.0
            rows, state = self.static.rows(state, u[w], x_pb[w], y[w], self.speed)
            for name, expert in self.experts.items():
                if name == "A":
                    expert.learn(generic[w], past_0, e_0[w])
                else:
                    expert.learn(rows, past[: expert.p], e[w])
            self.stack.update(predicted[:, w], e[w], self.settings.lam)
            self.largest, self.square = _larger(self.largest, self.square, e[w])
            self.largest_0, self.square_0 = _larger(self.largest_0, self.square_0, e_0[w])
        return x_h + x_d[0], x_pb + x_d[0], predicted

    def _predicted(self, rows: Array, generic: Array, past: Array, past_0: Array, follows: Array, held: float) -> Array:
        """Return what each expert predicts of a window, ``(n_experts, n)``, m; ``follows``: the command less x_pb."""
        bound, found = self.constants.bound * self.largest, []
        for name in self.constants.first:
            if name == "hold":
                found.append(np.full(len(rows), held))
            elif name == "A":
                most = self.constants.bound_of_command * self.largest_0
                e = self.experts["A"].predict(generic, past_0, self.square_0, most)
                found.append(np.clip(e + follows, -bound, bound) if self.experts["A"].rows else np.zeros(len(rows)))
            else:
                expert = self.experts[name]
                found.append(expert.predict(rows, past[: expert.p], self.square, bound))
        return np.stack(found)

    def _follow_speed(self, step: float) -> None:
        """Take in the largest motion of a sample in a window, m: what was learned at a creep is forgotten."""
        c, peak = self.constants, step / self.settings.T_s
        own = [expert for name, expert in self.experts.items() if name != "A"]
        known = any(expert.rows > c.learned * self.settings.Np for expert in own) and self.speed > 0.0
        if peak > max((c.growth_learned if known else c.growth) * self.speed, 1e-200):
            self.speed = peak
            for expert in own:
                expert.forget()


def lags(past: Array, e: Array) -> Array:
    """Return ``e(k−1) … e(k−p)`` over a window, ``(n, p)``; ``past``, ``(p,)``, is newest first."""
    series = np.concatenate((past[::-1], e[:-1]))
    return np.lib.stride_tricks.sliding_window_view(series, len(past))[:, ::-1]


def _before(e: Array, a: int, p: int) -> Array:
    """Return the ``p`` samples before sample ``a``, newest first, 0 where there are none."""
    past = np.zeros(p)
    past[: min(a, p)] = e[:a][::-1][:p]
    return past


def _larger(largest: float, square: float, e: Array) -> tuple[float, float]:
    return max(largest, float(np.abs(e).max())), max(square, float(np.mean(e**2)))
