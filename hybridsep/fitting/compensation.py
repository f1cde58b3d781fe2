"""Compensation in ``hybridsep fit``: the tracking error to be expected without and with it, and what limits it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from ..base.errors import FmuError, SignalError
from ..base.metrics import ErrorSize
from ..base.settings import CompensatorSettings
from ..compensate.planning import FASTER
from ..cosim.fir_inverse import FirInverse
from ..identify.output_error import in_time
from ..logs.units import DisplayUnits
from ..machines.machine import Machine
from ..predict.averaging.model import AveragedModel
from ..predict.predictor import HybridPredictor
from .expected import Expected, Trial, limits_that_bind
from .limits import FOLLOWING_ERROR, STEPS, held_for, largest_motion, rounding_of
from .replay import Recording, beginnings, replay
from .stretch import LimitCosts, LookAheads, Stretch, in_words

_SCALE = 0.05
"""Velocity scale of what a compensator begins with, relative to the largest velocity of a log: with that of a log's
first motion no stop operator is as short as friction before sliding. Mere predictions are 2 % worse with it."""

_TRIED_MAX = 10_000  # leading samples on which a compensator is tried
_EXPLAINED = 0.7  # share of the error that the physics model's compensation leaves, from which on it knows little


def taught(machine: Machine, recordings: Sequence[Recording]) -> HybridPredictor:
    """Return a predictor that has learned recordings for a compensator, whose plans turn where no log has turned."""
    (fastest, *_), _ = largest_motion(recordings, machine.T_s)
    predictor = HybridPredictor(machine.model, machine.predictor_settings)
    residual = cast(AveragedModel, predictor.residual)
    learned = replace(residual.learned, velocity_scale=_SCALE * fastest)
    predictor.state = replace(predictor.state, residual=replace(residual, learned=learned))
    replay(predictor, recordings)
    return predictor


@dataclass(frozen=True)
class Tracking:
    """Tracking errors to be expected over the test samples."""

    # as measured, and estimates with each model; NaN without a test sample, or where a plan diverges
    none: ErrorSize
    physics: ErrorSize
    hybrid: ErrorSize
    inverse: ErrorSize  # estimate with the rival, fitted to the training samples; NaN without motion there
    # model → shares of :func:`~hybridsep.fitting.expected.limits_that_bind`
    limits: Mapping[str, Mapping[str, float]]
    costs: LimitCosts | None  # on the stretch of ``look_aheads``; None where no limit binds the hybrid
    # largest change of the command, and following error above which the compensator trips, m
    change_max: float | None
    following_error_max: float
    duration: float  # of the samples that are tried, of a long log from its beginning, s
    largest: float  # servo error of the whole logs, m
    motion: Mapping[str, Sequence[float]]  # name of a limit → largest of the logs' commands, and the drive's, SI
    held: int  # samples for which each command is the same
    rounding: float  # step of the commands, m
    T_s: float  # s
    look_aheads: LookAheads | None  # None where the model has no error to compensate

    def lines(self, shown: DisplayUnits) -> list[str]:
        """Return the errors in words, what binds them and, last, how they came about."""
        change_max = "none" if self.change_max is None else shown.words(self.change_max, ".4g")
        monitored = shown.words(self.following_error_max, ".4g") if self.following_error_max > 0.0 else ""
        figures = (("RMS", "rms"), ("largest error", "largest"))
        better = " and ".join(what for what, one in figures if getattr(self.inverse, one) < getattr(self.hybrid, one))
        lines = [
            f"Tracking error (commanded minus measured, RMS) over {self.duration:.3g} s of the log: "
            f"{in_words(self.none, shown)} as recorded; with the compensator about {in_words(self.hybrid, shown)} by "
            f"the hybrid, with which the FMU starts, and about {in_words(self.physics, shown)} by the physics model "
            "(compensate = physics).",
            f"A finite impulse response with friction's sign, fitted to the first half and inverted, would leave about "
            f"{in_words(self.inverse, shown)}, without limits and without learning on."
            + (f" That is better than the hybrid in {better}: such a filter of the command may do." if better else ""),
            f"change_max is {change_max}. {binding_words(self.limits.get('hybrid', {}))}",
        ]
        if self.change_max is not None:
            lines[-1] += (
                " For a program whose largest servo error is above the log's, set change_max to twice that error"
                + (f" and following_error_max to {FOLLOWING_ERROR:g} times that error" if monitored else "")
                + f"; motion more than {FASTER:g} times as fast as all that was learned may use half of change_max at "
                "first."
            )
        if self.change_max is not None and self.change_max < self.largest:
            left = shown.words(self.largest - self.change_max, ".4g")
            lines.append(
                f"The largest servo error of the log, {shown.words(self.largest, '.4g')}, is above change_max: "
                f"{left} of it cannot be compensated."
            )
        if self.held > 1:
            lines.append(
                f"The log's commands are held, or rounded to the same, for {self.held} samples each; where their steps "
                "exceed a limit, that bounds what the compensator adds."
            )
        _, most = self.motion.get("j_max", (0.0, math.inf))
        if self.held == 1 and 4.0 * self.rounding > most * self.T_s**3:
            lines.append(
                f"The log's commands are rounded to {shown.words(self.rounding)}, by which alone their jerk is above "
                "j_max: that bounds what the compensator adds; finer set points leave less."
            )
        factor, unit = shown.position
        for power, (name, sizes) in zip(("", "²", "³"), self.motion.items(), strict=False):
            reached, most = (float(f"{factor * size:.4g}") for size in sizes)  # as they are shown
            if most < reached:
                lines.append(
                    f"The log's commands reach {reached:.4g} {unit}/s{power}, above {name} = {most:.4g} "
                    f"{unit}/s{power}: where they do, it bounds what the compensator adds; is it the drive's?"
                )
        trips = (
            "Where the measured following error, or its geometric mean with that from the modified command, is above "
            f"following_error_max = {monitored} for three samples in a row, the compensator trips: the change fades."
            if monitored
            else "following_error_max is 0: nothing trips."
        )
        if monitored and self.following_error_max < self.none.largest:
            trips += (
                " The log's own error is above it, so the compensator may trip at once: take what the zeros are apart "
                "from the measurement or, where the axis sags, give both limits."
            )
        how = (
            "An estimate: the compensator plans in closed loop on the identified model, to which the residual of the "
            "log is added as it was recorded; that the residual changes with the command is left out."
        )
        if self.physics.rms > _EXPLAINED * self.none.rms:
            how += " The physics model explains little of the error, so this leaves out most of it, and may be far off."
        return [
            *lines,
            *(self.costs.lines(shown) if self.costs is not None else ()),
            *(self.look_aheads.lines() if self.look_aheads is not None else ()),
            trips,
            how,
        ]


def expected_tracking(
    machine: Machine, recordings: Sequence[Recording], progress: Callable[[float], object]
) -> Tracking:
    """Return the tracking errors to be expected with and without a machine's compensator, and what its limits cost."""
    allowed, first = machine.compensator_settings, beginnings(recordings, _TRIED_MAX)
    settings = {model: replace(allowed, compensate=model) for model in ("physics", "hybrid")}
    with Trial.of(machine) as trial:
        judged = {model: _expected(trial, one, first) for model, one in settings.items()}
        progress(0.8)
        bound = {
            model: limits_that_bind(one.x_d, one.x_dm, machine.compensator_predictor.T_s, allowed)
            for model, one in judged.items()
            if len(one.x_d)
        }
        stretch = Stretch.of(trial, recordings)
        costs = stretch.limit_costs() if stretch and bound.get("hybrid") else None
        ahead = stretch.look_aheads() if stretch else None
    progress(1.0)
    without = max((one.without for one in judged.values()), key=len)
    none, physics, hybrid = map(ErrorSize.of, (without, *(one.compensated for one in judged.values())))
    inverse, limits = _inverted(machine, first), (allowed.change_max, allowed.following_error_max)
    motion, error = largest_motion(recordings, machine.T_s)
    commands = [one.x_d for one in recordings if np.count_nonzero(np.diff(one.x_d)) > STEPS]  # fewer are steps
    drive = {} if allowed.limits is None else allowed.limits.to_fmi()
    reached = {name: (size, most) for size, (name, most) in zip(motion.tolist(), drive.items(), strict=False)}
    return Tracking(
        *(none, physics, hybrid, inverse, bound, costs, *limits, len(without) * machine.T_s),
        *(error, reached, max(map(held_for, commands), default=1), max(map(rounding_of, commands), default=0.0)),
        *(machine.T_s, ahead),
    )


def _expected(trial: Trial, compensator: CompensatorSettings, recordings: Sequence[Recording]) -> Expected:
    """Return the errors to be expected over the test samples, one log after the other; empty where a plan diverges."""
    settings = trial.machine.compensator_predictor
    firsts = [one.first_judged(settings.Np) for one in recordings if len(one.x) > settings.n_late]
    try:
        found = trial.expected(settings, compensator, [(one.x_d, one.x) for one in recordings])
    except (SignalError, FmuError):
        return Expected(*[np.empty(0)] * 4)
    parts = [Expected(*(signal[first:] for signal in one)) for one, first in zip(found, firsts, strict=True)]
    return Expected(*map(np.concatenate, zip(*parts, strict=True)))


def _inverted(machine: Machine, recordings: Sequence[Recording]) -> ErrorSize:
    """Return the errors to be expected of the rival over the test samples, on the same drive."""
    settings = machine.compensator_predictor
    late, Np = settings.n_late, settings.Np
    rival = FirInverse.fitted([in_time(*one.training, late) for one in recordings], Np)
    discrete, errors = machine.model.discretise(settings.T_s, settings.input_hold), []
    for one in recordings if rival else ():
        x_d, x = in_time(one.x_d, one.x, late)
        if len(x) > 0 and rival is not None:
            change = rival.command(x_d) - x_d
            errors.append((x_d - x - discrete.forced_response(discrete.rest(), change)[0])[one.first_judged(Np) :])
    return ErrorSize.of(np.concatenate(errors) if errors else np.empty(0))


def binding_words(shares: Mapping[str, float]) -> str:
    """Return which limits bind a compensated command, and in which share of its samples, in words."""
    each = ", ".join(f"{name} in {100 * share:.2g} %" for name, share in shares.items())
    some = f"Limits bind the compensated command: {each} of the samples."
    return some if each else "No limit binds the compensated command."
