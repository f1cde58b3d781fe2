"""Prediction by the residual model that can be trusted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.signals import Array
from ..regression import RidgeRegression
from ..residual_window import FeatureScales, Forecast, ResidualWindow
from .constants import CONSTANTS
from .disturbances import LEAST_VELOCITY
from .expert import ExpertPrediction, SolvedExpert, solve
from .stack import COMMAND, DOUBTING, HOLD, LAGGED, N_EXPERTS, STATIC
from .state import OF_COMMAND, OF_PHYSICS, TrustedModel

__all__ = ["TrustedForecast", "forecast", "forecast_by", "scales_of", "solved"]

_LEAST = 1e-150
"""Magnitude of a feature that counts as 0."""


@dataclass(frozen=True)
class TrustedForecast(Forecast):
    """Window predicted by the trusted model.

    Attributes
    ----------
    x : (n,) array, m
        Position that the stiffness acts at.
    stacked : (N_EXPERTS, n) array, m
        Predictions that are stacked; 0 where an expert knows nothing.
    predictions : mapping
        Of the experts that know something, by their places in the stack.
    scales : FeatureScales
    """

    x: Array
    stacked: Array
    predictions: Mapping[int, ExpertPrediction]
    scales: FeatureScales


def scales_of(state: TrustedModel, window: ResidualWindow, path: Array | None = None) -> FeatureScales:
    """Return the scales of the features, with the next window's.

    Parameters
    ----------
    state : TrustedModel
    window : ResidualWindow
    path : (m,) array, m, optional
        Commanded positions as far as they are known: a compensator begins to move before them, with a creep.
    """
    static, learned, settings = state.fixed.static, state.learned, state.fixed.settings
    T_s = settings.T_s
    before = learned.velocity_scale
    peak = static.peak_velocity(state.run.static, window.x_d)
    outgrown = peak > max(CONSTANTS.outgrown * before, LEAST_VELOCITY)
    step = max(learned.largest_step, peak * T_s)
    if path is not None and state.evidence[OF_PHYSICS].n_rows == 0.0:
        peak = max(float(np.abs(np.diff(path)).max(initial=0.0)) / T_s, before)
        outgrown = peak > max(before, LEAST_VELOCITY)
    velocity = peak if outgrown else before
    rows, _ = static.rows(state.run.static, window, window.x_pb, velocity)
    largest = np.zeros(static.n) if outgrown else learned.largest
    command_step, command_square = step, learned.scales[OF_COMMAND].largest_square
    if path is None and settings.Np > 1 and state.command_square > 0.0:
        # A controller solves for the command's expert one sample before the window, as far as its commands are known.
        known = window.x_d[: settings.measurement_delay + settings.Np - 1]
        early = max(learned.largest_step, static.peak_velocity(state.run.static, known) * T_s)
        if early > 0.0 or step == 0.0:
            command_step, command_square = early, state.command_square
    largest = np.maximum(largest, np.abs(rows).max(axis=0))
    return FeatureScales(velocity, largest, step, command_step, command_square)


def _solved(state: TrustedModel, expert: int, rows: RidgeRegression, scales: FeatureScales) -> SolvedExpert:
    """Return an expert with the weights that follow from rows."""
    settings, kind = state.fixed.settings, state.kind_of(expert)
    if kind == OF_COMMAND:
        command, square = state.fixed.command, scales.command_square
        p, shares, largest = command.p, command.shares, command.largest(scales.command_step)
    else:
        square = state.learned.scales[kind].largest_square
        p, shares, largest = 0 if expert == STATIC else settings.p, state.fixed.static.shares, scales.largest
    effect = settings.effect or math.sqrt(square)
    priors = effect * shares / np.maximum(largest, _LEAST)
    return solve(rows, state.noise_of(expert), priors, p)


def solved(state: TrustedModel, scales: FeatureScales) -> dict[int, SolvedExpert]:
    """Return the experts that know something, with their weights."""
    found: dict[int, SolvedExpert] = {}
    for kind, experts in ((OF_PHYSICS, (LAGGED, STATIC)), (OF_COMMAND, (COMMAND,))):
        evidence, outgrown = state.evidence[kind], scales.velocity != state.learned.velocity_scale
        if evidence.n_rows == 0.0 or state.learned.scales[kind].largest_square == 0.0:
            continue
        if kind == OF_COMMAND or not outgrown:
            rows = evidence.all()
            found |= {expert: _solved(state, expert, rows, scales) for expert in experts if state.noise_of(expert)}
            if state.doubts and state.leading == experts[0] and state.noise_of(DOUBTING):
                found[DOUBTING] = _solved(state, DOUBTING, evidence.all(CONSTANTS.less), scales)
    return found


def _growth(state: TrustedModel, scales: FeatureScales) -> float:
    """Return the largest step of the command relative to that before the window, ≥ 1, where its expert leads.

    What follows the command alone is linear in it: it may be larger than anything so far by as much.
    """
    before = state.learned.largest_step
    if not (before > 0.0 and state.learned.stack.leader == COMMAND):
        return 1.0
    return min(scales.step / before, CONSTANTS.growth)


def forecast_by(
    state: TrustedModel,
    experts: Mapping[int, SolvedExpert],
    window: ResidualWindow,
    scales: FeatureScales,
    held: Mapping[int, ExpertPrediction] | None = None,
    counts: NDArray[np.intp] | None = None,
) -> TrustedForecast:
    """Predict as :func:`forecast` by the experts of :func:`solved`.

    Parameters
    ----------
    state, experts, window, scales
    held : mapping, optional
        Predictions whose shrinking is held.
    counts : (n,) array, optional
        As :meth:`~hybridsep.predict.trust.expert.SolvedExpert.predict` has it.
    """
    x_d, x_pb, _ = window
    learned, command, run = state.learned, state.fixed.command, state.run
    bound, growth = CONSTANTS.bound * learned.scales[OF_PHYSICS].largest, _growth(state, scales)

    def predicted(expert: int, features: Array, counts: NDArray[np.intp] | None) -> ExpertPrediction:
        kind = state.kind_of(expert)
        scale = learned.scales[OF_COMMAND].grown(growth) if kind == OF_COMMAND else learned.scales[OF_PHYSICS]
        most = CONSTANTS.bound_of_command * scale.largest if kind == OF_COMMAND else bound
        shrunk = None if held is None else held.get(expert)
        return experts[expert].predict(features, run.past[kind], scale.largest_square, most, shrunk, counts)

    x, rows = x_pb, np.empty((len(x_d), 0))
    if STATIC in experts:
        # The stiffness acts at the position, which the physics model alone does not give well enough.
        rows, _ = state.fixed.static.rows(run.static, window, x_pb, scales.velocity)
        x = x_pb + predicted(STATIC, rows, None).e_h
        rows, _ = state.fixed.static.rows(run.static, window, x, scales.velocity)
    found: dict[int, ExpertPrediction] = {}
    stacked = np.zeros((N_EXPERTS, len(x_d)))
    stacked[HOLD] = min(max(state.last, -bound), bound)
    for expert in experts:
        if state.kind_of(expert) == OF_COMMAND:
            found[expert] = predicted(expert, command.rows(run.commands, x_d), counts)
            follows = command.late(run.commands, x_d) - x_pb
            stacked[expert] = np.clip(found[expert].e_h + follows, -growth * bound, growth * bound)
        else:
            found[expert] = predicted(expert, rows, counts)
            stacked[expert] = found[expert].e_h
    weights = learned.stack.weights
    e_h = weights @ stacked
    second = stacked**2  # second moments of the residual by each expert; hold and physics have no variance
    for expert, prediction in found.items():
        second[expert] += prediction.variance
    variance = np.maximum(weights @ second - e_h**2, 0.0)
    return TrustedForecast(window, e_h, variance, x, stacked, found, scales)


def forecast(state: TrustedModel, window: ResidualWindow, scales: FeatureScales | None = None) -> TrustedForecast:
    """Predict the residual over the next window.

    Parameters
    ----------
    state : TrustedModel
    window : ResidualWindow
    scales : FeatureScales, optional
        By :func:`scales_of` from its commands if left out; a compensator takes its preview's.
    """
    scales = scales_of(state, window) if scales is None else scales
    return forecast_by(state, solved(state, scales), window, scales)
