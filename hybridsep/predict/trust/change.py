"""Test of a warm run for a plant that has changed since it was learned.

The rows of earlier runs, A, and those of this one, B, follow one model, or the plant has changed and each has its own.
With normal priors of the weights both have a marginal likelihood in closed form, so their ratio follows from the
factors of A, B and of both (Chow, Econometrica 28 (1960), with priors in place of degrees of freedom). It rises while
what was carried over helps, and falls once it contradicts what is measured: a large fall from its peak tells the change
(Page, Biometrika 41 (1954)).

Where rows are alike, or the model with lags alone tells the difference, likelihood says little. What counts in the end
is the error of the next window: each is also predicted with a tenth of the weight of A. While that is better, window
after window, A is given this tenth.
"""

from __future__ import annotations

import math
from copy import deepcopy
from typing import NamedTuple

import numpy as np

from ...base.signals import Array
from ..regression import RidgeRegression

__all__ = ["DOUBTED", "ChangeTest"]

DOUBTED = 0.1
"""Weight of the rows of earlier runs, relative to the one they have, that is tried beside it."""

_FALL = 60.0
"""Fall of the log-likelihood ratio from its peak that tells a change: with 30 three of 41 unchanged plants are taken
for changed ones, with 60 one, which loses nothing by it, with 80 none; but changes are found later."""

_OUTWEIGHED = 10.0
"""Rows of this run relative to those of earlier ones from which on there is little left to decide."""

_EVIDENCE, _MEMORY, _EVIDENCE_OF_A_WINDOW = 1.5, 0.9, 1.0
"""Log ratio of RMS errors, summed over windows, from which on the smaller weight is taken, if the sum of squares is
smaller, too; the factor by which they fade from window to window; and the most that a window adds."""

_SUPPORT, _EVIDENCE_AGAINST_SUPPORT = 15.0, 3.0
"""Log-likelihood ratio of one plant to two from which on it takes more evidence, and how much: less of earlier runs may
be better by chance then."""

_SPENT = 1e-6
"""Weight of earlier runs, relative to that they began with, below which there is nothing left of them."""

_LEAST_SQUARE = 1e-300
"""Sum of squares, m², that counts as 0."""


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
    n_carried : float
        Weight of the rows of earlier runs when this one began.
    log_ratio, peak : float
        Log-likelihood ratio of one plant to two, as last asked for, and its largest so far, at least 0.
    evidence : float
        That less weight of earlier runs is better: log ratio of RMS errors, which fades.
    errors, errors_with_less : float, m²
        Sums of squared errors with all rows, and with less weight of earlier runs, which fade as well.
    """

    def __init__(self, regression: RidgeRegression, n_rows: float, correlations: tuple[float, ...]) -> None:
        self.before = deepcopy(regression)
        self.after = RidgeRegression(regression.n_features, regression.lam)
        self.n_before, self.n_after, self.correlations = n_rows, 0.0, correlations
        self.largest_square, self.largest, self.log_ratio, self.peak = 0.0, 0.0, 0.0, 0.0
        self.n_carried, self.evidence, self.errors, self.errors_with_less = n_rows, 0.0, 0.0, 0.0

    @property
    def is_over(self) -> bool:
        """Whether this run outweighs the earlier ones, or nothing of them is left."""
        return self.n_after > _OUTWEIGHED * self.n_carried or self.n_before < _SPENT * self.n_carried

    def discount(self, kept: float) -> None:
        """Weigh all rows so far by ``kept``."""
        self.before.discount(kept)
        self.after.discount(kept)
        self.n_before, self.n_after = kept * self.n_before, kept * self.n_after

    def learn(self, stacked: Array) -> None:
        """Update with rows ``[Φ | e_pb]`` of this run, ``(m, n + 1)``, column-major; they are overwritten."""
        self.after.update_stacked(stacked)
        self.n_after += len(stacked)

    def doubt(self) -> None:
        """Give earlier runs less weight."""
        self.before.discount(DOUBTED)
        self.n_before *= DOUBTED
        self.evidence, self.errors, self.errors_with_less = 0.0, 0.0, 0.0

    def all_rows(self, kept: float = 1.0) -> RidgeRegression:
        """Return a regression with the rows of all runs, ``kept`` being the weight of the earlier ones."""
        both = deepcopy(self.before)
        if kept < 1.0:
            both.discount(kept)
        both.update_from(self.after)
        return both

    def is_doubted(self, error: float, with_less: float, physics: float) -> bool:
        """Return whether earlier runs had better have less weight, as the windows so far show; after `has_changed`.

        Parameters
        ----------
        error, with_less, physics : float, m²
            Sums of squared errors of the next window: predicted with all rows, with ``DOUBTED`` of the earlier ones,
            and by the physics model. Where all three are alike there is nothing to compare.
        """
        ratio = 0.5 * (math.log(max(error, _LEAST_SQUARE)) - math.log(max(with_less, _LEAST_SQUARE)))
        # The part of the physics model's error that the better one explains, or of a worse error what is beyond that
        explained = max(
            1.0 - min(error, with_less) / max(physics, _LEAST_SQUARE), 1.0 - physics / max(error, _LEAST_SQUARE), 0.0
        )
        most = _EVIDENCE_OF_A_WINDOW
        self.evidence = _MEMORY * self.evidence + explained * min(max(ratio, -most), most)
        self.errors = _MEMORY * self.errors + error
        self.errors_with_less = _MEMORY * self.errors_with_less + with_less
        needed = _EVIDENCE if self.log_ratio < _SUPPORT else _EVIDENCE_AGAINST_SUPPORT
        return self.evidence > needed and self.errors_with_less < self.errors

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
        self.log_ratio, self.peak = log_ratio, max(self.peak, log_ratio)
        return log_ratio < self.peak - _FALL


def _fit(regression: RidgeRegression, penalties: Array) -> _Fit:
    solution = regression.penalised(penalties)
    cost = solution.residual_sum + float(penalties @ solution.weights**2)
    return _Fit(cost, solution.residual_sum, 2.0 * float(np.log(np.abs(np.diag(solution.triangle))).sum()))
