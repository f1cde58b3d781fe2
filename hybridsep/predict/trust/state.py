"""State of the residual model that can be trusted: the paper's regression twice, stacked with physics and hold.

``e_pb = x − x_pb`` of a window is predicted by physics (0), hold (the last residual), by static features with lags and
without, and by eq. (4) with ``G_pb = 1``, on the residual of the command itself, which saves a user whose physics model
is poor. Their sum is weighted by their errors so far (:mod:`~hybridsep.predict.trust.stack`). Where the paper's
regression has one bare penalty λ on every weight, here each weight has a prior from the effect that its feature may
have, and λ is the least variance of the noise. Nothing has a scale of its own: results for positions in another unit
are the same in that unit.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...base.records import FIXED, within
from ...base.settings import PredictorSettings
from ...base.signals import Array
from ...model.discrete import DiscreteModel
from ..regression import RidgeRegression
from .command import CommandFeatures
from .constants import CONSTANTS
from .disturbances import LEAST_VELOCITY, Disturbance, StaticFeatures, StaticState
from .evidence import Evidence
from .expert import ExpertErrors, ResidualScale
from .reach import Reach
from .stack import COMMAND, DOUBTING, LAGGED, N_JUDGED, Stack

__all__ = [
    "OF_COMMAND",
    "OF_PHYSICS",
    "Learned",
    "Parameters",
    "RunState",
    "TrustedModel",
    "init",
    "plan_ahead",
    "restart",
    "take_over",
]

OF_PHYSICS, OF_COMMAND, N_RESIDUALS = range(3)
"""Residuals that experts predict, and the rows that they learn: of the physics model, of the command; their number."""

_AHEAD = 20
"""Samples before the end of a window, half of it at most, at which the variances are taken that its next solution's
penalties come from: a controller factors most of that solution in them."""

_ROUNDING = 1e-6
"""What rounding may have added to the sum of the stack's weights."""


@dataclass(frozen=True)
class Parameters:
    """What does not change.

    Attributes
    ----------
    settings : PredictorSettings
        ``p`` and ``q`` are the largest lags, ``lam`` the least variance of the noise.
    static : StaticFeatures
    command : CommandFeatures
    """

    settings: PredictorSettings
    static: StaticFeatures
    command: CommandFeatures


@dataclass(frozen=True, eq=False)
class RunState:
    """What a run has been before the next window; positions relative to the start.

    Attributes
    ----------
    static : StaticState
    commands : (d + p_A + 1,) array, m
        Last commands, oldest first, for the ``p_A`` lags of the command's expert.
    past : pair of (p,) and (p_A,) array, m
        Last residuals of the physics model, and of the command; newest first.
    bridged : (max(p, p_A),) array of bool
        Whether the last ones stand for samples without a measurement, oldest first.
    reach : Reach
    n_rejected : int
        Measurements that were missing or not plausible.
    """

    static: StaticState
    commands: Array
    past: tuple[Array, Array]
    bridged: NDArray[np.bool_]
    reach: Reach
    n_rejected: int

    @classmethod
    def init(cls, fixed: Parameters) -> RunState:
        """Return the beginning of a run, at rest."""
        p, command = fixed.settings.p, fixed.command
        past, bridged = (np.zeros(p), np.zeros(command.p)), np.zeros(max(p, command.p), dtype=np.bool_)
        return cls(fixed.static.rest(), np.zeros(command.n_before), past, bridged, Reach(), 0)


@dataclass(frozen=True, eq=False)
class Learned:
    """What has been learned besides the rows: the numbers of a weights file, in this order, in the C core, too.

    Attributes
    ----------
    velocity_scale : float, m/s
        Of the friction features; 0 before any motion.
    largest_step, fastest : float, m
        Largest change from sample to sample, of the command and of the physics model.
    scales : pair of ResidualScale
        Sizes of the residuals, of the physics model and of the command.
    errors : tuple of ExpertErrors
        Of the experts from LAGGED on.
    stack : Stack
    largest : (n_static,) array
        Largest magnitudes of the static features.
    """

    velocity_scale: float = field(metadata=within())
    largest_step: float = field(metadata=within())
    fastest: float = field(metadata=within())
    scales: tuple[ResidualScale, ResidualScale] = field(metadata=within())
    errors: tuple[ExpertErrors, ...] = field(metadata=within())
    stack: Stack
    largest: Array = field(metadata=within())

    @classmethod
    def init(cls, fixed: Parameters) -> Learned:
        """Return that nothing has been learned."""
        scales, errors = (ResidualScale(), ResidualScale()), (ExpertErrors(),) * N_JUDGED
        return cls(0.0, 0.0, 0.0, scales, errors, Stack.init(), np.zeros(fixed.static.n))

    def errors_of(self, expert: int) -> ExpertErrors:
        """Return what is known of the errors of an expert."""
        return self.errors[expert - LAGGED]

    def with_errors(self, changed: dict[int, ExpertErrors]) -> Learned:
        """Return the same with other errors of some experts."""
        errors = tuple(changed.get(LAGGED + i, one) for i, one in enumerate(self.errors))
        return replace(self, errors=errors)

    @property
    def is_sound(self) -> bool:
        """Whether the numbers, which are in range, fit each other."""
        scale = self.velocity_scale
        return (scale == 0.0 or scale >= LEAST_VELOCITY) and float(self.stack.weights.sum()) <= 1.0 + _ROUNDING


@dataclass(frozen=True, eq=False)
class TrustedModel:
    """State of the model: what it has learned, and its run. It stays the physics model where it does not know better.

    Attributes
    ----------
    fixed : Parameters
    learned : Learned
    evidence : pair of Evidence
        Rows of the residuals of the physics model, and of the command.
    noise : tuple of float, m²
        Of the experts from LAGGED on, variances that the penalties of the next solution come from; 0: none yet.
    command_square : float, m²
        Largest mean square of the command's residual, before the last sample of the last window; 0: none yet.
    leading : int
        Expert that led when earlier runs ended, LAGGED or COMMAND: DOUBTING is its counterpart.
    run : RunState
    """

    may_miss: ClassVar[bool] = True

    fixed: Parameters = field(metadata=FIXED)
    learned: Learned
    evidence: tuple[Evidence, Evidence]
    noise: tuple[float, ...] = field(metadata=within())
    command_square: float = field(metadata=within())
    leading: int
    run: RunState

    def kind_of(self, expert: int) -> int:
        """Return OF_COMMAND if an expert predicts the residual of the command, else OF_PHYSICS."""
        return OF_COMMAND if expert == COMMAND or (expert == DOUBTING and self.leading == COMMAND) else OF_PHYSICS

    def noise_of(self, expert: int) -> float:
        """Return the variance of the noise that an expert's penalties come from, m²; 0: none yet."""
        return self.noise[expert - LAGGED]

    @property
    def early(self) -> int:
        """Samples of a window after which the variances for the next one are taken."""
        Np = self.fixed.settings.Np
        return Np - min(Np // 2, _AHEAD)

    def with_noise(self, learned: Learned) -> TrustedModel:
        """Return the model with the variances of the noise that follow from what is learned so far."""
        settings = self.fixed.settings

        def noise(expert: int) -> float:
            kind = self.kind_of(expert)
            square = learned.scales[kind].largest_square
            first = settings.noise_std**2 or CONSTANTS.first_noise * square
            least = min(settings.lam, CONSTANTS.least_noise * square)
            kept = CONSTANTS.less if expert == DOUBTING else 1.0
            return learned.errors_of(expert).variance(self.evidence[kind].target_square(kept), first, least)

        return replace(self, noise=tuple(noise(LAGGED + i) for i in range(N_JUDGED)))

    @property
    def doubts(self) -> bool:
        """Whether what earlier runs have trained is doubted."""
        return self.evidence[OF_PHYSICS].earlier.n_rows > 0.0

    @property
    def n_rejected(self) -> int:
        """Measurements of this run that were missing or not plausible."""
        return self.run.n_rejected

    @property
    def last(self) -> float:
        """Last residual that was accepted or bridged, m."""
        return float(self.run.past[OF_PHYSICS][0])

    @property
    def regressions(self) -> tuple[RidgeRegression, ...]:
        """Of all learned samples: of the physics model's residual, and of the command's."""
        return tuple(one.all() for one in self.evidence)

    @property
    def lag_weights(self) -> Array:
        """Weights of the lags from all learned samples, ``(p,)``."""
        return self.regressions[OF_PHYSICS].weights[self.fixed.static.n :]

    @property
    def is_sound(self) -> bool:
        """Whether the numbers, which are in range, fit each other."""
        factors = all(part.is_sound for one in self.evidence for part in (one.this, one.earlier))
        return factors and self.learned.is_sound and self.leading in (LAGGED, COMMAND)


def init(settings: PredictorSettings, discrete: DiscreteModel, own: tuple[Disturbance, ...] = ()) -> TrustedModel:
    """Return the model at rest, with nothing learned.

    Parameters
    ----------
    settings : PredictorSettings
    discrete : DiscreteModel
        ``G_pb``.
    own : tuple of Disturbance
        Of the user's own.
    """
    static = StaticFeatures(discrete, settings.q, settings.period, own)
    fixed = Parameters(settings, static, CommandFeatures(discrete.dead_time))
    evidence = Evidence.init(static.n + settings.p), Evidence.init(2 * fixed.command.p + 2)
    return TrustedModel(fixed, Learned.init(fixed), evidence, (0.0,) * N_JUDGED, 0.0, LAGGED, RunState.init(fixed))


def restart(state: TrustedModel) -> TrustedModel:
    """Return the model at the beginning of another run, at rest; what was learned is kept, and doubted."""
    fixed, learned = state.fixed, state.learned
    most = CONSTANTS.carried * fixed.settings.Np
    of_physics, of_command = (one.begin_run(most) for one in state.evidence)
    leading, stack, errors = learned.stack.leader, learned.stack.forget(DOUBTING), ExpertErrors()
    if of_physics.earlier.n_rows > 0.0:
        stack, errors = stack.copy(leading, DOUBTING), learned.errors_of(leading)
    learned = replace(learned.with_errors({DOUBTING: errors}), stack=stack)
    evidence = of_physics, of_command
    begun = TrustedModel(fixed, learned, evidence, state.noise, 0.0, leading, RunState.init(fixed))
    return begun.with_noise(learned)


def plan_ahead(state: TrustedModel) -> TrustedModel:
    """Return the model where a compensator decides the commands."""
    return replace(state, fixed=replace(state.fixed, static=replace(state.fixed.static, damping_of_motion=True)))


def take_over(state: TrustedModel, learned: Learned, regressions: tuple[RidgeRegression, ...]) -> TrustedModel:
    """Return the model with what another one has learned."""
    both = zip(state.evidence, regressions, strict=True)
    of_physics, of_command = (replace(one.forget(), this=rows) for one, rows in both)
    return replace(state, learned=learned, evidence=(of_physics, of_command))
