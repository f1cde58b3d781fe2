"""Rows that experts have learned: of this run and, as long as they are doubted, of earlier ones apart."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ...base.signals import Array
from ..regression import RidgeRegression

_NO_PENALTY = 1e-40  # λ of the factor itself, m²: penalties come with each solution


@dataclass(frozen=True, eq=False)
class WarmStartRows:
    """Rows of this run and of earlier ones, by their factors."""

    this: RidgeRegression
    earlier: RidgeRegression  # without rows unless earlier runs are doubted

    @classmethod
    def init(cls, n_features: int) -> WarmStartRows:
        """Return no evidence on the weights of ``n_features`` features."""
        nothing = RidgeRegression.init(n_features, _NO_PENALTY)
        return cls(nothing, nothing)

    @property
    def n_rows(self) -> float:
        """Number of all rows, weighted."""
        return self.this.n_rows + self.earlier.n_rows

    def forget(self) -> WarmStartRows:
        """Forget all rows."""
        return WarmStartRows.init(self.this.n_features)

    def believe_earlier(self) -> WarmStartRows:
        """Go on with all rows as rows of this run."""
        return replace(self.forget(), this=self.all())

    def forget_earlier(self) -> WarmStartRows:
        """Go on with only the rows of this run."""
        return replace(self.forget(), this=self.this)

    def discount(self, forgetting_factor: float) -> WarmStartRows:
        """Weigh all rows so far by ``forgetting_factor``."""
        return WarmStartRows(self.this.discount(forgetting_factor), self.earlier.discount(forgetting_factor))

    def begin_run(self, most: float) -> WarmStartRows:
        """Begin another run: all rows so far are of earlier ones, and weigh at most as ``most`` of this one."""
        everything = self.all()
        return replace(self.forget(), earlier=everything.discount(most / max(everything.n_rows, most)))

    def all(self, weight: float = 1.0) -> RidgeRegression:
        """Return all rows, the rows of earlier runs weighed by ``weight``."""
        if self.earlier.n_rows == 0.0:
            return self.this
        earlier = self.earlier.discount(weight)
        return earlier if self.this.n_rows == 0.0 else self.this.add(earlier)

    def target_square(self, weight: float = 1.0) -> float:
        """Return the sum of the squares of the targets, m², earlier runs' weighed by ``weight``."""
        return self.this.target_square + weight * self.earlier.target_square

    def learn(self, rows: Array, lagged: Array, target: Array) -> WarmStartRows:
        """Learn rows of features ``(m, n_static)``, lags ``(m, p)`` and targets ``(m,)``."""
        return replace(self, this=self.this.update(rows, lagged, target)) if len(target) else self
