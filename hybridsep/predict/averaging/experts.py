"""Experts of the residual, entries of :data:`EXPERTS`: adding one is its class or its entry here, and its test.

A regression has normal priors, and is counted as far as its own variance allows; hold is the last residual.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ...base.signals import Array, first_differences, mean
from ..regression import PenalisedSolution, RidgeRegression, lags
from ..window import FeatureScales, ResidualWindow
from .constants import CONSTANTS
from .features import StaticFeatures
from .recall import PULSE, Recalled

MODEL_RESIDUAL, COMMAND_RESIDUAL, N_RESIDUALS = range(3)
"""Residuals that regressions predict, and the rows that they learn: of the physics model, of the command; their
number."""

_DIVERGED = 1e6
"""Bound on the impulse response of a recursion, on the variance relative to the square of the bound on a prediction,
and on the correlation that a window shows."""

_LAG_BOUND = 10.0  # largest lag within a window, relative to the bound on a prediction: what is beyond has diverged

_MOVES, _LEAST_MOVE = 4.0, 1e-6
"""Mean square of a feature's effect, relative to that of the residuals about the level of their run, and the least one,
relative to theirs: zeros may be apart, or an axis sag, by a thousand times what disturbances move it by."""

_RESOLUTION = 1e-13
"""Least variance of the noise, and least sum of the squares of the rows about the weights, relative to the sum of the
squares of the targets: the C core has it from a Gram matrix, which does not resolve less."""


@dataclass(frozen=True)
class ResidualScale:
    """Size of the residuals so far."""

    largest_square: float = 0.0  # m²: largest mean square of a window
    largest_move: float = 0.0  # m²: the same about the level of the window's run
    largest: float = 0.0  # m: largest magnitude

    def follow(self, residuals: Array, level: float) -> ResidualScale:
        """Return the scale with another window of residuals, ``(n,)``, m, n ≥ 1; ``level``, m: of their run."""
        mean_square, move = mean(residuals**2), mean((residuals - level) ** 2)
        largest = max(self.largest, float(np.abs(residuals).max()))
        return ResidualScale(max(self.largest_square, mean_square), max(self.largest_move, move), largest)

    @property
    def effect(self) -> float:
        """Effect that a feature may have, m: less than the residuals where most of them is an offset."""
        return math.sqrt(min(max(_MOVES * self.largest_move, _LEAST_MOVE * self.largest_square), self.largest_square))


class ExpertPrediction(NamedTuple):
    """Residual predicted over a window by one expert."""

    e_h: Array  # (n,), m: shrunk by its variance, and bounded
    unshrunk: Array  # (n,), m
    shrinkage: Array  # (n,): what the variance leaves of it
    variance: Array  # (n,), m²: what is left of the variance of the residual, ``v·τ²/(v + τ²)``
    noise_variance: float  # m²: mean square of the rows so far about this expert


@dataclass(frozen=True)
class ExpertErrors:
    """What is known of the errors of an expert."""

    noise_variance: float = 0.0  # m²: of a row about the model; 0 until it is known
    # rows that count as one: where a disturbance has no feature, the errors of neighbouring rows are alike
    correlation: float = 1.0

    def variance(self, target_square: float, first: float, least: float) -> float:
        """Return the variance of the noise that penalties come from, m².

        ``target_square``, m²: sum of the squares of the targets so far; ``first``, ``least``, m²: variance of the
        noise while it is not known, and the least one.
        """
        return max(self.noise_variance or first, least, _RESOLUTION * target_square) * self.correlation

    def judge(
        self, prediction: ExpertPrediction, measured: Array, accepted: NDArray[np.bool_], given: float
    ) -> ExpertErrors:
        """Return noise and correlation with the errors of a window.

        ``measured``, ``accepted``, (m,), m and bool: residuals of its first samples, and which count; ``given``, m²:
        variance of the noise, if it is known; else 0.
        """
        noise_variance, correlation = given or prediction.noise_variance, self.correlation
        if noise_variance > 0.0:
            error = (measured - prediction.unshrunk[: len(measured)])[accepted]
            seen = min(len(error) * mean(error) ** 2 / noise_variance, _DIVERGED)
            correlation += CONSTANTS.correlation_rate * (seen - correlation)
            correlation = min(max(correlation, 1.0), CONSTANTS.correlation_max)
        return ExpertErrors(noise_variance, correlation)


class SolvedExpert(NamedTuple):
    """Expert with weights."""

    n_static: int  # features without lags, the first ones of a row
    solution: PenalisedSolution  # weights of these and of the lags
    # m²: of the noise that the penalties come from, and mean square of the rows about the weights
    variance: float
    noise_variance: float

    @property
    def lag_weights(self) -> Array:
        """Weights of the last ``p`` residuals, newest first, ``(p,)``."""
        return self.solution.weights[self.n_static :]

    def predict(
        self,
        rows: Array,
        past: Array,
        largest_square: float,
        bound: float,
        held: ExpertPrediction | None = None,
        variance_rows: NDArray[np.intp] | None = None,
    ) -> ExpertPrediction:
        """Predict the residual over a window in free run.

        Weights have normal priors, so the variance of ``wᵀφ`` is known; it is carried through the recursion's impulse
        response. A prediction of variance ``τ²`` is shrunk by ``v/(v + τ²)``, ``v`` being the largest mean square of a
        window: at a first motion, a first reversal or in a region not seen yet the physics model remains.

        ``rows``, (n, n_static): features of the window without lags; ``past``, (≥ p,), m: last residuals, newest
        first; ``largest_square``, m²: largest mean square of a window; ``bound``, m: on the prediction; ``held``:
        prediction whose shrinking is held; else it is computed; ``variance_rows``, (n,): sample whose row gives the
        variance of each sample; its own if left out.
        """
        w_e = self.lag_weights
        p = len(w_e)
        drive, response = rows @ self.solution.weights[: self.n_static], np.zeros(0)
        if p:
            drive, response = _recursion(w_e, drive, past[:p])
        finite = np.isfinite(drive)
        e = np.clip(np.where(finite, drive, 0.0), -_LAG_BOUND * bound, _LAG_BOUND * bound)
        if held is not None:
            shrinkage = held.shrinkage
        else:
            lagged = lags(np.concatenate((past[:p][::-1], e[:-1])), p) if p else np.empty((len(e), 0))
            features = np.hstack((rows, lagged))
            if variance_rows is None:
                leverage = self.solution.leverage(features)
            else:
                places, back = np.unique(variance_rows, return_inverse=True)
                leverage = self.solution.leverage(features[places])[back]
            variance = self.variance * leverage
            if p:
                variance = np.convolve(response**2, variance)[: len(variance)]
            most = _DIVERGED * bound**2
            variance = np.where(finite, np.minimum(variance, most), most)
            shrinkage = largest_square / (largest_square + variance)
        return ExpertPrediction(
            np.clip(e, -bound, bound) * shrinkage, e, shrinkage, largest_square * (1.0 - shrinkage), self.noise_variance
        )


def solve(evidence: RidgeRegression, variance: float, scales: Array, p: int) -> SolvedExpert:
    """Return an expert with the weights that follow from all rows so far.

    ``evidence``: rows whose first features are the expert's; ``variance``, m²: of the noise, by
    :meth:`ExpertErrors.variance`; ``scales``, (n_static,): prior standard deviations of the weights of the features
    without lags, the first ones of a row; ``p``: lags of the residual.
    """
    resolved = _RESOLUTION * evidence.target_square
    priors = np.concatenate((scales, np.sqrt(CONSTANTS.last_lag ** (np.arange(p) / max(p, 1)))))
    solution = evidence.penalised(variance / priors**2)
    return SolvedExpert(len(scales), solution, variance, max(solution.residual_sum, resolved) / evidence.n_rows)


def _recursion(w_e: Array, drive: Array, past: Array) -> tuple[Array, Array]:
    """Return the free run ``e(k) = drive(k) + Σ_i w_e,i e(k−i)``, and the recursion's impulse response; eq. (4)."""
    denominator = np.concatenate(([1.0], -w_e))
    state, both = np.zeros((2, len(w_e))), np.zeros((2, len(drive)))
    state[0], both[0], both[1, 0] = np.correlate(w_e, past, "full")[len(past) - 1 :], drive, 1.0
    with np.errstate(all="ignore"):  # an unstable recursion is recognised by what it gives
        (e, response), _ = lfilter([1.0], denominator, both, zi=state)
    if not np.abs(response).max() <= _DIVERGED:  # NaN too
        response = np.clip(np.nan_to_num(response, nan=_DIVERGED), -_DIVERGED, _DIVERGED)
    return e, response


_LEAST = 1e-150  # magnitude of a feature that counts as 0


@dataclass(frozen=True)
class ExpertWindow:
    """Window as experts predict it."""

    model: Any
    window: ResidualWindow
    solved: Mapping[Regression, SolvedExpert]  # regressions that know something, with their weights
    scales: FeatureScales
    rows: Array  # (n, n_static): static features
    predictions: Mapping[Regression, ExpertPrediction]  # of these, of their residuals
    recalled: Recalled
    moves: float  # share of what the command's expert says that a recalled residual moves by

    @property
    def bound(self) -> float:
        """Largest prediction of the physics model's residual, m."""
        largest: float = self.model.learned.scales[MODEL_RESIDUAL].largest
        return CONSTANTS.bound * largest

    @property
    def growth(self) -> float:
        """Largest step of the command relative to those before, ≥ 1: what is linear in it may be larger by as much."""
        before = self.model.learned.largest_step
        return min(self.scales.step / before, CONSTANTS.velocity_jump) if before > 0.0 else 1.0


@dataclass(frozen=True)
class Expert(ABC):
    """Entry of :data:`EXPERTS`."""

    name: str
    first_weight: float = 0.0  # in the stack, without evidence

    @property
    def place(self) -> int:
        """Place in the stack."""
        return EXPERTS.index(self)

    @abstractmethod
    def forecast(self, at: ExpertWindow) -> Array | float:
        """Return what it adds to the physics model, ``(n,)``, m; where it knows nothing 0, or as its class says."""


@dataclass(frozen=True)
class Hold(Expert):
    """The last residual, as long as the command does not turn: most of it is friction, which turns with it."""

    def forecast(self, at: ExpertWindow) -> Array | float:
        """Return it within the bound."""
        turned = at.model.static.turned(at.model.run.static, at.rows)
        return np.asarray(min(max(at.model.last, -at.bound), at.bound) * (1.0 - turned))


@dataclass(frozen=True)
class Regression(Expert):
    """Expert by features of a residual."""

    # MODEL_RESIDUAL, with static features, or COMMAND_RESIDUAL, with increments of the command
    target: int = MODEL_RESIDUAL
    has_lags: bool = True  # whether lags of the residual are among its features
    # whether it gives earlier runs little weight: a counterpart of the one that led when they ended, whose target it
    # has
    is_fresh: bool = False

    def like(self, model: Any) -> Regression:
        """Return the expert whose features it has: itself, or the leader of earlier runs."""
        return model.leading if self.is_fresh else self

    @property
    def weight(self) -> float:
        """Weight of the rows of earlier runs."""
        return CONSTANTS.warm_prior_weight if self.is_fresh else 1.0

    def solve(self, model: Any, scales: FeatureScales) -> SolvedExpert | None:
        """Return the expert with the weights that follow from all rows; None if it knows nothing."""
        like, settings = self.like(model), model.settings
        kind, variance = like.target, model.noise[REGRESSIONS.index(self)]
        square = model.learned.scales[kind].largest_square
        outgrown = kind == MODEL_RESIDUAL and scales.velocity != model.learned.velocity_scale
        if square == 0.0 or variance == 0.0 or outgrown or (self.is_fresh and not model.doubts):
            return None
        rows = model.evidence[kind].all(self.weight)
        if rows.n_rows == 0.0:
            return None
        if kind == COMMAND_RESIDUAL:
            command = model.static.command
            p, shares, largest = command.p, command.shares, command.largest(scales.step or 1.0)
        else:
            p, shares, largest = settings.p, model.static.shares, scales.largest
        effect = settings.effect or model.learned.scales[kind].effect
        priors = effect * shares / np.maximum(largest, _LEAST)
        priors[0] = settings.effect or math.sqrt(square)  # the constant makes up for the offset
        return solve(rows, variance, priors, p if like.has_lags else 0)

    def predict(
        self, at: ExpertWindow, held: ExpertPrediction | None, variance_rows: NDArray[np.intp] | None
    ) -> ExpertPrediction:
        """Return the prediction of its residual, once it knows something; parameters as for SolvedExpert.predict."""
        model, kind, most = at.model, self.like(at.model).target, at.bound
        scale, rows = model.learned.scales[kind], at.rows
        square = scale.largest_square
        if kind == COMMAND_RESIDUAL:
            square *= at.growth**2
            most = CONSTANTS.bound * (at.growth * scale.largest)
            rows = model.static.command.rows(model.run.static.x_d, at.window.x_d)
        return at.solved[self].predict(rows, model.run.past[kind], square, most, held, variance_rows)

    def forecast(self, at: ExpertWindow) -> Array | float:
        """Return what it adds to the physics model, within bounds.

        While it knows nothing of the physics model's residual: the last one, or their level where the command turns.
        """
        model = at.model
        if self not in at.predictions:
            if self.target == COMMAND_RESIDUAL or self.is_fresh:
                return 0.0
            turned = model.static.turned(model.run.static, at.rows)
            return np.asarray(HOLD.forecast(at) + (model.run.level or 0.0) * turned)
        e_h = at.predictions[self].e_h
        if self.like(model).target == MODEL_RESIDUAL:
            return e_h
        command, most = model.static.command.late(model.run.static.x_d, at.window.x_d), at.growth * at.bound
        return np.asarray(np.clip(e_h + (command - at.window.x_pb), -most, most))


@dataclass(frozen=True)
class Recall(Expert):
    """What was measured after the commands most like those ahead.

    Under a compensator the drive got modified commands, then and now. The physics model tells what their difference
    makes. Where the command's expert answers more to fast changes, it is believed instead: with less than the drive's
    own answer the same correction would grow from pass to pass.
    """

    def before(self, static: StaticFeatures, n: int) -> int:
        """Return how many samples before those recalled count: half of ``n`` to run the expert in, and its lags."""
        return n // 2 + static.command.p + 1 if static.n_known is not None else 0

    def moves(self, static: StaticFeatures, solved: Mapping[Regression, SolvedExpert], n: int) -> float:
        """Return the share of what the command's expert says, in plans of ``n`` samples."""
        if static.n_known is None or ARX_COMMAND not in solved:
            return 0.0
        one, u = solved[ARX_COMMAND], np.minimum(np.arange(1, n + 1) / PULSE, 1.0)
        pulse = (u * (1.0 - u)) * (u * (1.0 - u)) * (u * (1.0 - u))  # in the C core's order
        own, _ = static.discrete.forced_response(static.discrete.rest(), pulse)
        drive = lfilter(one.solution.weights[1 : one.n_static], [1.0], first_differences(pulse))
        e, _ = _recursion(one.lag_weights, drive, np.zeros(len(one.lag_weights)))
        own_square, square = (float(np.sum(np.diff(x, 2) ** 2)) for x in (own, pulse + e))
        return 1.0 - own_square / square if own_square < square < np.inf else 0.0

    def forecast(self, at: ExpertWindow) -> Array | float:
        """Return it within the bound, moved to the last residual, which fades."""
        n, Np, (then, *_) = len(at.window.x_d), at.model.settings.Np, at.recalled
        first = len(at.recalled.now[0])
        residuals, before = then[0, first : first + n], float(then[0, first - 1])
        fade = np.exp(-np.arange(1, n + 1) / (CONSTANTS.recall_fade * Np))
        change = at.moves * self._change(at, first) if at.moves > 0.0 and at.recalled.alike > 0.0 else np.zeros(n + 1)
        moved = residuals + change[1:] + (at.model.last - before - change[0]) * fade
        return np.asarray(np.clip(moved, -at.bound, at.bound))

    def _change(self, at: ExpertWindow, first: int) -> Array:
        """Return what the residual changes by as the commands are others, from the last sample on, ``(1 + n,)``, m."""
        static, (then, now, *_), one = at.model.static, at.recalled, at.solved[ARX_COMMAND]
        n, p = len(at.window.x_d), static.command.p
        late = static.command.late(at.model.run.static.x_d, at.window.x_d)
        since = np.hstack((now, np.stack((np.zeros(n), late, late - at.window.x_pb)))) - then[:, : first + n]
        increments = lags(np.diff(since[1]), p + 1)
        past = (since[0] - since[2])[1 : p + 1][::-1]  # of the command's residual
        e, _ = _recursion(one.lag_weights, increments @ one.solution.weights[1 : one.n_static], past)
        most = at.growth * at.bound
        e = np.clip(np.where(np.isfinite(e), e, 0.0), -most, most)
        return np.asarray(since[2, first - 1 :] + e[-n - 1 :])


_FIRST = 0.5
"""First weights: with a share for the command's expert, too, a drive of ten has up to 1.6 times its error."""

HOLD = Hold("hold")
ARX_RESIDUAL = Regression("arx_residual", _FIRST)
STATIC = Regression("static", _FIRST, has_lags=False)
ARX_COMMAND = Regression("arx_command", target=COMMAND_RESIDUAL)
FRESH_START = Regression("fresh_start", is_fresh=True)
RECALL = Recall("recall")

EXPERTS: tuple[Expert, ...] = (HOLD, ARX_RESIDUAL, STATIC, ARX_COMMAND, FRESH_START, RECALL)
"""All experts, in the order of the stack."""

REGRESSIONS = tuple(one for one in EXPERTS if isinstance(one, Regression))
"""Those that rows train, whose errors are judged."""
