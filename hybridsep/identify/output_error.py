"""Output-error fit of one structure: least squares of measured minus simulated position.

The linear parameters, a constant offset and the state at the start of each segment are eliminated by variable
projection (Golub, Pereyra, Inverse Problems 19 (2003) R1), so that the search is over poles alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ..base.signals import Array, Indices
from .responses import free_responses, responses, sections_of
from .segments import Segment, delayed
from .structure import Structure

__all__ = ["Delay", "Fit", "affine", "fit_structure", "simulated", "without"]

EVALUATIONS_MAX = 20
"""Largest number of iterations of one start; a good one converges within 15."""

ROWS_MAX = 4000
"""Residuals that take part in a search, evenly spaced: the filters run over every sample, but neighbouring residuals
tell the same."""

EDGE = 0.01
"""Distance from a bound, in the logarithm of a parameter, within which it counts as at the bound."""


@dataclass(frozen=True, order=True)
class Delay:
    """Dead time in half samples: a zero-order hold delays by half a sample beside a first-order one.

    Attributes
    ----------
    halves : int
        Even ones are whole samples with a first-order hold.
    """

    halves: int

    @property
    def samples(self) -> int:
        """Whole samples of dead time."""
        return self.halves // 2

    @property
    def input_hold(self) -> str:
        """Hold between the samples."""
        return "zoh" if self.halves % 2 else "foh"


@dataclass(frozen=True)
class Fit:
    """Fitted structure.

    Attributes
    ----------
    structure : Structure
    delay : Delay
    theta : (order,) array
        Nonlinear parameters.
    linear : (n_linear,) array
        Linear parameters.
    offset : float
        Mean of the segments' offsets, m.
    rms : float
        Root mean square of the residual, m.
    slowest : float
        Lower bound of the natural frequencies, rad/s.
    at_bound : bool
        Whether a nonlinear parameter is at the end of its range.
    """

    structure: Structure
    delay: Delay
    theta: Array
    linear: Array
    offset: float
    rms: float
    slowest: float
    at_bound: bool


class _Problem:
    """Separable least-squares problem of a structure with one dead time."""

    def __init__(
        self, segments: Sequence[Segment], T_s: float, structure: Structure, delay: Delay, rows_max: int
    ) -> None:
        self._structure, self._T_s, self._delay = structure, T_s, delay
        used = [segment for segment in segments if segment.known[: segment.stop].sum() > 1]
        step = max(1, sum(s.stop for s in used) // rows_max)
        self._data = [
            (delayed(s.u[: s.stop], delay.samples), s.y[: s.stop], np.flatnonzero(s.known[: s.stop])[::step])
            for s in used
        ]

    def solve(self, theta: Array) -> tuple[Array, Array, float]:
        """Return residual, linear parameters and mean offset for one set of poles."""
        blocks = [self._projected(theta, u, y, rows) for u, y, rows in self._data]
        Phi, target = (np.concatenate(parts) for parts in zip(*((b[0], b[1]) for b in blocks), strict=True))
        linear = _least_squares(Phi, target)
        offset = float(np.mean([target - columns @ linear for _, _, target, columns in blocks]))
        return target - Phi @ linear, linear, offset

    def _projected(self, theta: Array, u: Array, y: Array, rows: Indices) -> tuple[Array, Array, Array, Array]:
        """Return columns and target without the part that offset and initial state explain, then the means of both.

        The filters run over every sample; the samples ``rows``, all of them measured, have residuals.
        """
        sections = sections_of(self._structure, theta, self._T_s, self._delay.input_hold)
        columns, target = affine(self._structure, responses(self._structure, sections, u)[rows], y[rows])
        free = free_responses(sections, len(u))[rows]
        nuisance = np.column_stack((np.ones(len(free)), free))
        both = without(nuisance, np.column_stack((columns, target)))
        return both[:, :-1], both[:, -1], target.mean(keepdims=True), columns.mean(axis=0)


def without(nuisance: Array, signals: Array) -> Array:
    """Return signals, ``(n, m)``, less their least-squares projection onto the nuisance columns, ``(n, k)``."""
    norms = np.linalg.norm(nuisance, axis=0)
    there = norms > 0.0  # in few samples an initial state may show nowhere, and explains nothing then
    basis = np.linalg.qr(nuisance[:, there] / norms[there])[0]
    return np.asarray(signals - basis @ (basis.T @ signals))


def affine(structure: Structure, columns: Array, y: Array) -> tuple[Array, Array]:
    """Return the columns of the linear parameters and the target; a unit gain is subtracted from both."""
    if not structure.unit_gain:
        return columns, y
    n = max(structure.n_modes + structure.lag, 1)
    first = columns[:, :1]
    return np.column_stack((columns[:, 1:n] - first, columns[:, n:])), y - columns[:, 0]


def fit_structure(
    segments: Sequence[Segment],
    T_s: float,
    structure: Structure,
    delay: Delay,
    starts: Sequence[Array],
    slowest: float,
    rows_max: int = ROWS_MAX,
) -> Fit:
    """Return the best fit from several starts.

    Parameters
    ----------
    segments : sequence of Segment
    T_s : float, s
    structure : Structure
    delay : Delay
    starts : sequence of (order,) array
        Nonlinear parameters to start from.
    slowest : float
        Lower bound of the natural frequencies, rad/s.
    rows_max : int
        Residuals that take part, about.
    """
    problem = _Problem(segments, T_s, structure, delay, rows_max)
    low, high = structure.bounds(T_s, slowest)
    best: Fit | None = None
    for start in starts if structure.order else [np.empty(0)]:
        theta = np.clip(start, low + 1e-9, high - 1e-9)
        if structure.order:
            scale = float(np.sqrt(np.mean(problem.solve(theta)[0] ** 2))) or 1.0
            theta = least_squares(
                lambda theta, scale=scale: problem.solve(theta)[0] / scale,
                *(theta,),
                bounds=(low, high),
                xtol=1e-6,
                ftol=1e-7,
                gtol=1e-10,
                max_nfev=EVALUATIONS_MAX,
            ).x
        residual, linear, offset = problem.solve(theta)
        rms = float(np.sqrt(np.mean(residual**2)))
        if best is None or rms < best.rms:
            at_bound = bool(np.any((theta < low + EDGE) | (theta > high - EDGE)))
            best = Fit(structure, delay, theta, linear, offset, rms, slowest, at_bound)
    assert best is not None  # there is a start
    return best


def simulated(fit: Fit, segment: Segment, T_s: float) -> Array:
    """Return the position of the fitted model, which starts at rest as the predictor does, ``(n,)``, m."""
    u = delayed(segment.u, fit.delay.samples)
    sections = sections_of(fit.structure, fit.theta, T_s, fit.delay.input_hold)
    columns = responses(fit.structure, sections, u)
    gains, betas = fit.structure.gains(fit.linear)
    return columns @ np.concatenate((gains, betas if fit.structure.zero else []))


def _least_squares(Phi: Array, target: Array) -> Array:
    """Return the least-squares solution with columns scaled to unit norm."""
    if Phi.shape[1] == 0:
        return np.empty(0)
    norms = np.linalg.norm(Phi, axis=0)
    norms[norms == 0] = 1.0
    solution: Array = np.linalg.lstsq(Phi / norms, target, rcond=1e-12)[0] / norms
    return solution
