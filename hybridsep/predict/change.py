"""Test of a warm run for a plant that has changed since it was learned.

The rows of earlier runs, A, and those of this one, B, follow one model, or the plant has changed and each has its own.
With normal priors of the weights both have a marginal likelihood in closed form, so their ratio follows from the
factors of A, B and of both (Chow, Econometrica 28 (1960), with priors in place of degrees of freedom). It rises while
what was carried over helps, and falls once it contradicts what is measured: a large fall from its peak tells the change
(Page, Biometrika 41 (1954)).
"""

from __future__ import annotations

from copy import deepcopy
from typing import NamedTuple

import numpy as np

from ..base.signals import Array
from .regression import RidgeRegression

__all__ = ["ChangeTest"]

_FALL = 60.0
"""Fall of the log-likelihood ratio from its peak that tells a change: with 30 three of 41 unchanged plants are taken
for changed ones, with 60 one, which loses nothing by it, with 80 none; but changes are found later."""

_OUTWEIGHED = 10.0
"""Rows of this run relative to those of earlier ones from which on there is little left to decide."""


class _Fit(NamedTuple):
    """Fit of the static features to the rows of a factor: cost, its part without penalties, m², and ``ln det RᵀR``."""

    cost: float
    residual_sum: float
    log_det: float


class ChangeTest:
    """Comparison of what this run teaches with what earlier ones have taught, by the static features alone.

    Lags would adapt to what contradicts, and take longer to tell.

    Parameters
    ----------
    regression : RidgeRegression
        Factor of the rows of earlier runs.
    n_rows : float
        Their weight.
    correlations : tuple of float
        Of the candidates, as earlier runs have shown: windows that contradict what was carried over tell nothing of
        them.

    Attributes
    ----------
    before, after : RidgeRegression
        With the rows of earlier runs, and of this one.
    n_before, n_after : float
        Weights of these rows.
    largest_square, largest : float, m², m
        Of the residuals of this run, as in ``ResidualScale``.
    peak : float
        Largest log-likelihood ratio so far of one plant to two, at least 0.
    """

    def __init__(self, regression: RidgeRegression, n_rows: float, correlations: tuple[float, ...]) -> None:
        self.before = deepcopy(regression)
        self.after = RidgeRegression(regression.n_features, regression.lam)
        self.n_before, self.n_after, self.correlations = n_rows, 0.0, correlations
        self.largest_square, self.largest, self.peak = 0.0, 0.0, 0.0

    @property
    def is_over(self) -> bool:
        """Whether this run outweighs the earlier ones."""
        return self.n_after > _OUTWEIGHED * self.n_before

    def discount(self, kept: float) -> None:
        """Weigh all rows so far by ``kept``."""
        self.before.discount(kept)
        self.after.discount(kept)
        self.n_before, self.n_after = kept * self.n_before, kept * self.n_after

    def learn(self, stacked: Array) -> None:
        """Update with rows ``[Φ | e_pb]`` of this run, ``(m, n + 1)``, column-major; they are overwritten."""
        self.after.update_stacked(stacked)
        self.n_after += len(stacked)

    def all_rows(self) -> RidgeRegression:
        """Return a regression with the rows of all runs."""
        both = deepcopy(self.before)
        both.update_from(self.after)
        return both

    def follow(self, residuals: Array) -> None:
        """Follow the size of the residuals of this run, ``(m,)``, m."""
        self.largest_square = max(self.largest_square, float(np.mean(residuals**2)))
        self.largest = max(self.largest, float(np.abs(residuals).max()))

    def has_changed(
        self, both: RidgeRegression, scales: Array, variance: float, least: float, correlation: float
    ) -> bool:
        """Return whether the rows so far tell that the plant is another one.

        Parameters
        ----------
        both : RidgeRegression
            Factor of all rows.
        scales : (n_static,) array
            Prior standard deviations of the weights.
        variance, least : float, m²
            Variance of the noise that the penalties come from, and its least one.
        correlation : float
            Rows that count as one.
        """
        with np.errstate(all="ignore"):  # priors beyond the range of numbers tell nothing
            penalties = variance * correlation / scales**2
            earlier, later, one = (_fit(regression, penalties) for regression in (self.before, self.after, both))
            pooled = (earlier.residual_sum + later.residual_sum) / (self.n_before + self.n_after)
            misfit = (one.cost - earlier.cost - later.cost) / (max(pooled, least) * correlation)
            # ln p(B | A) − ln p(B); a factor of penalties alone has ln det = Σ ln penalties
            log_ratio = -0.5 * (misfit + one.log_det - earlier.log_det - later.log_det + float(np.log(penalties).sum()))
        self.peak = max(self.peak, log_ratio)
        return log_ratio < self.peak - _FALL


def _fit(regression: RidgeRegression, penalties: Array) -> _Fit:
    solution = regression.penalised(penalties)
    cost = solution.residual_sum + float(penalties @ solution.weights**2)
    return _Fit(cost, solution.residual_sum, 2.0 * float(np.log(np.abs(np.diag(solution.triangle))).sum()))
