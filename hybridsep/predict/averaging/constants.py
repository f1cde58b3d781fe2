"""Constants of online model averaging: all of them, each with its reason and the experiment that chose it.

The C core's header is generated from here. ``benchmarks/ablation`` switches each rule off; its tables are in
``docs/experiments``. Constants were chosen on the recordings ``cnc_a_*`` and ``xl330_sin_sin_*``, the simulated cases
and drives of one seed; other recordings and seeds judge.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CONSTANTS", "AveragingConstants"]


@dataclass(frozen=True)
class AveragingConstants:
    """Constants of the residual model with averaging.

    Attributes
    ----------
    kappa : float
        Evidence that the first weights of the stack count for, in windows of the best expert's mean square: 0.3 or 3
        change errors by 1 to 3 %.
    gamma : float
        Factor by which the stack's evidence fades from window to window: 0.9 or 0.98 change errors by 1 to 3 %.
    lags_of_command : int
        Lags of the command's expert, and of its increments, which may reach beyond the window before: with 50 instead
        of 20 errors are 2 % less on drives of modes, 8 % more on drives of two masses, and a third less where the
        physics model is bad; more than 36 cost more than four million instructions in the dearest sample.
    last_lag : float
        Prior variance of the weight of the last lag, and of the command's last increment, relative to the first
        one's: memory fades. Without it for the increments a CNC axis that outgrows them has three times the error.
    early : int
        Samples by which the command may act before the physics model's dead time is over: one that is two samples too
        long, which no weight can mend, leaves 1.7 times the error of no compensation on a warm drive, instead of 0.25.
    least_noise : float
        Bound on the least variance of the noise relative to the largest mean square of a window: a larger ``lambda``
        would prevent any learning.
    first_noise : float
        Variance of the noise before it is known, relative to the same: a servo error is repeatable to 10 %.
    correlation_max, correlation_rate : float
        Bound on the rows that count as one, and how fast their number follows: without, recordings are 1 to 4 % worse.
    bound, bound_of_command : float
        Largest prediction relative to the largest residual so far, of the physics model and of the command: what is
        larger was never seen. Bounds on the command's expert grow with its steps, as it is linear in the command:
        without, CNC axes that creep before a motion have 3 and 4 times the error.
    growth : float
        Largest growth of these bounds.
    velocity_jump : float
        Growth of the commanded velocity, for each window that earlier runs weigh, that makes the static features begin
        anew, as they were learned at a creep: without, the rounding of a command at rest sets their scale, and drives
        have to 1.4 times the error; where earlier runs do not count, a milling machine forgets them in mid-part.
    warm_windows_max : float
        Largest weight of earlier runs when another begins, in windows: a machine may have changed meanwhile.
    warm_prior_weight : float
        Weight of earlier runs, relative to the one they have, in the expert that doubts them: a prior from a tenth of a
        window. Without any, changed plants are worse by an eighth.
    discard_above, discard_error : float
        Weight of that expert in the stack, and mean square error of the one that led, relative to the largest of a
        window, from which on earlier runs are forgotten: with a weight of 0.5 plants that have not changed are worse by
        2 %; without an error noise at rest decides; with 0.01 a changed drive has 5 times the error.
    friction_least, friction_ratio : float
        Least velocity of the friction's change of sign relative to the velocity scale, and the ratio from one of the
        six to the next: half a decade, which neighbours interpolate within; with 5/6 of one the stage's spiral has four
        times the error, warm.
    stop_least, stop_ratio : float
        Least distance of a stop operator, as the time, s, that it takes at the velocity scale, and the ratio from one
        of the three to the next, up to 0.3 s: up to a third of that servos lose what they gain; from 1 or 3 ms on what
        a user's own disturbance describes is learned ten times as slowly.
    recall_tolerance : float
        Root of the distance of commands from those ahead, relative to their own changes, at which what was measured
        then counts by half: with 0.2 or 0.3 recordings are the same, warm drives 1 % worse.
    recall_fade : float
        Time in which a recalled residual loses that it was moved to the last one, in windows: without an end, drives
        that are repeated have to 7 times the error.
    difference_share : float
        Effect of a disturbance's first difference relative to its own: it only corrects the timing.
    gate : float
        Largest residual that is believed, relative to the largest so far and the physics model's fastest step so far
        together.
    patience : float
        Time, s, after which a value beyond it is believed: a sensor may read zero for half a second.
    """

    kappa: float = 1.0
    gamma: float = 0.95
    lags_of_command: int = 36
    last_lag: float = 0.005
    early: int = 2
    least_noise: float = 1e-6
    first_noise: float = 0.01
    correlation_max: float = 100.0
    correlation_rate: float = 0.1
    bound: float = 1.2
    bound_of_command: float = 2.0
    growth: float = 30.0
    velocity_jump: float = 1000.0
    warm_windows_max: float = 30.0
    warm_prior_weight: float = 0.003
    discard_above: float = 0.7
    discard_error: float = 0.003
    friction_least: float = 0.01
    friction_ratio: float = 3.1622776601683795
    stop_least: float = 0.01
    stop_ratio: float = 5.623413251903491
    recall_tolerance: float = 0.1
    recall_fade: float = 0.5
    difference_share: float = 0.03
    gate: float = 2.0
    patience: float = 1.0


CONSTANTS = AveragingConstants()
"""The product's."""
