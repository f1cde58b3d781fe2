"""Learning of the residual model that can be trusted, from the measurement of the windows that it predicted."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...base.signals import Array
from ..regression import lags
from ..residual_window import ResidualWindow
from .constants import CONSTANTS
from .evidence import Evidence
from .expert import ExpertErrors
from .forecast import TrustedForecast
from .reach import reached
from .stack import DOUBTING, LAGGED, STATIC, Stack
from .state import OF_COMMAND, OF_PHYSICS, Learned, RunState, TrustedModel

__all__ = ["begin_in_motion", "learn"]

_BRIDGED = 3
"""Lags of a row that may stand for samples without a measurement."""


def begin_in_motion(state: TrustedModel, window: ResidualWindow) -> TrustedModel:
    """Correct what was before a run in motion: commands and physics-based prediction went on as they begin.

    Parameters
    ----------
    state : TrustedModel
    window : ResidualWindow
        The first one, with the motion before it.
    """
    (x_d, x_pb, _), command, static = window, state.fixed.command, state.run.static
    commands = x_d[0] + (x_d[1] - x_d[0]) * np.arange(-command.n_before, 0)
    positions = x_pb[0] + (x_pb[1] - x_pb[0]) * np.arange(-max(command.n_before, len(static.x_pb)), 0)
    late = commands[-1 - command.dead_time :: -1][: command.p]
    past = state.run.past[OF_PHYSICS], positions[: -command.p - 1 : -1] - late
    static = replace(static, x_d=float(commands[-1]), x_pb=positions[-len(static.x_pb) :])
    return replace(state, run=replace(state.run, static=static, commands=commands, past=past))


def _with_scales(state: TrustedModel, forecast: TrustedForecast, fastest: float) -> TrustedModel:
    """Take over the scales of a window; what was learned at lower velocities is forgotten if it outgrows them."""
    learned, (velocity, largest, step, _, _) = state.learned, forecast.scales
    of_physics, of_command = state.evidence
    stack = learned.stack
    if velocity != learned.velocity_scale:
        of_physics, of_command, stack = of_physics.forget(), of_command.believe_earlier(), stack.forget(DOUBTING)
    learned = Learned(velocity, step, fastest, learned.scales, learned.errors, stack, largest)
    return replace(state, learned=learned, evidence=(of_physics, of_command))


def _folded(
    state: TrustedModel,
    forecast: TrustedForecast,
    rows: tuple[Array, Array],
    e: tuple[Array, Array],
    bridged: NDArray[np.bool_],
) -> TrustedModel:
    """Learn the rows of a window, without lags, and its residuals, of the physics model and of the command.

    Variances of the noise for the next window are taken before the last rows, the size of the command's residual
    before the last one.
    """
    settings, n, early = state.fixed.settings, len(e[OF_PHYSICS]), state.early
    accepted = ~bridged[-n:]
    kept = math.exp(-n * settings.T_s / settings.forgetting) if settings.forgetting > 0.0 else 1.0

    def taken(kind: int) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        past = state.run.past[kind]
        p = len(past)
        # Measured samples, as were all but a few of their lags
        n_bridged = np.convolve(bridged[-n - p : -1].astype(np.float64), np.ones(p), "valid")
        lagged = lags(np.concatenate((past[::-1], e[kind][:-1])), p)
        return rows[kind], lagged, e[kind], accepted & (n_bridged <= _BRIDGED)

    of_kind = taken(OF_PHYSICS), taken(OF_COMMAND)

    def learned(evidence: Iterable[Evidence], part: slice) -> tuple[Evidence, Evidence]:
        of_physics, of_command = (
            one.learn(features[part][counts[part]], lagged[part][counts[part]], target[part][counts[part]])
            for one, (features, lagged, target, counts) in zip(evidence, of_kind, strict=True)
        )
        return of_physics, of_command

    state = replace(state, evidence=learned((one.discount(kept) for one in state.evidence), slice(early)))
    state = state.with_noise(_judged_experts(state, forecast, (e[0][:early], e[1][:early]), accepted[:early]))
    of_command, last = state.learned.scales[OF_COMMAND], settings.Np - 1
    if accepted[:last].any():
        of_command = of_command.follow(e[OF_COMMAND][:last][accepted[:last]])
    evidence = learned(state.evidence, slice(early, n))
    return replace(state, evidence=evidence, command_square=of_command.largest_square)


def _judged_experts(
    state: TrustedModel, forecast: TrustedForecast, e: tuple[Array, Array], accepted: NDArray[np.bool_]
) -> Learned:
    """Judge the experts, and the sizes of the residuals, by the first samples of their window."""
    learned, given = state.learned, state.fixed.settings.noise_std**2
    if not accepted.any():
        return learned
    errors = {
        expert: learned.errors_of(expert).judge(one, e[state.kind_of(expert)], accepted, given)
        for expert, one in forecast.predictions.items()
    }
    of_physics, of_command = (scale.follow(one[accepted]) for scale, one in zip(learned.scales, e, strict=True))
    return replace(learned.with_errors(errors), scales=(of_physics, of_command))


def _bridged(last: float, measured: Array, accepted: NDArray[np.bool_]) -> Array:
    """Return residuals, interpolated where they are not accepted; ``last`` is before the first."""
    known = np.flatnonzero(accepted)
    places, values = np.concatenate(([-1], known)), np.concatenate(([last], measured[known]))
    return np.asarray(np.interp(np.arange(len(measured)), places, values))


def _judged(
    state: TrustedModel, forecast: TrustedForecast, e: tuple[Array, Array], accepted: NDArray[np.bool_]
) -> TrustedModel:
    """Judge the experts and their stack by the measurement of their window."""
    learned, settings = _judged_experts(state, forecast, e, accepted), state.fixed.settings
    n, late = len(accepted), settings.measurement_delay
    published = accepted & (np.arange(n) >= late) if late < n else accepted
    stack = learned.stack
    if published.any():
        predicted = forecast.stacked[:, :n][:, published]
        stack = stack.update(predicted, e[OF_PHYSICS][published], settings.lam)
    learned = replace(learned, stack=stack)
    if not (state.doubts and stack.weights[DOUBTING] > CONSTANTS.doubt):
        return replace(state, learned=learned)
    # All experts go on with this run alone, and are judged anew.
    anew = {LAGGED: ExpertErrors(), STATIC: ExpertErrors(), state.leading: learned.errors_of(DOUBTING)}
    learned = replace(learned.with_errors(anew), stack=Stack.init())
    evidence = state.evidence[0].forget_earlier(), state.evidence[1].forget_earlier()
    return replace(state, learned=learned, evidence=evidence).with_noise(learned)


def learn(
    state: TrustedModel, forecast: TrustedForecast, x: Array, *, fold: bool = True
) -> tuple[TrustedModel, NDArray[np.bool_]]:
    """Learn from the measurement of a window.

    Parameters
    ----------
    state : TrustedModel
    forecast : TrustedForecast
        Of that state.
    x : (m,) array, m
        Measured positions of its first ``m`` samples, relative to the start; NaN where missing.
    fold : bool
        Whether they are learned; the next window starts from them in any case.

    Returns
    -------
    TrustedModel, (m,) array of bool
        Which samples are accepted.
    """
    m, fixed, run = len(x), state.fixed, state.run
    window = ResidualWindow(forecast.window.x_d[:m], forecast.window.x_pb[:m], forecast.window.start)
    fastest = float(np.abs(np.diff(window.x_pb, prepend=run.static.x_pb[-1])).max())
    state = _with_scales(state, forecast, max(state.learned.fastest, fastest))
    learned, measured = state.learned, x - window.x_pb
    largest, T_s = learned.scales[OF_PHYSICS].largest, fixed.settings.T_s
    accepted, reach = reached(run.reach, measured, largest, learned.fastest, T_s)
    e = _bridged(state.last, measured, accepted)
    e_0 = e + window.x_pb - fixed.command.late(run.commands, window.x_d)
    rows, static = fixed.static.rows(run.static, window, window.x_pb + e, learned.velocity_scale)
    bridged: NDArray[np.bool_] = np.concatenate((run.bridged, ~accepted))
    if fold:
        of_command = fixed.command.rows(run.commands, window.x_d)
        state = _folded(state, forecast, (rows, of_command), (e, e_0), bridged)
        state = _judged(state, forecast, (e, e_0), accepted) if accepted.any() else state
    past = tuple(np.concatenate((new[::-1], old))[: len(old)] for new, old in zip((e, e_0), run.past, strict=True))
    n_rejected = run.n_rejected + m - int(accepted.sum())
    commands = np.concatenate((run.commands, window.x_d))[m:]
    return replace(state, run=RunState(static, commands, (past[0], past[1]), bridged[m:], reach, n_rejected)), accepted
