"""Constants of online model averaging: all of them, each with its reason and the experiment that chose it.

The C core's header is generated from here. ``benchmarks/ablation`` switches each rule off; its tables are in
``docs/experiments``. Constants were chosen on the recordings ``cnc_a_*`` and ``xl330_sin_sin_*``, the simulated cases
and drives of one seed; other recordings and seeds judge.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class AveragingConstants:
    """Constants of the residual model with averaging."""

    # weight of the prior ``π₀`` of the stack, in windows: 0.3 or 3 change errors by 1 to 3 %
    kappa: float = 1.0
    # the same of the stack of plans, whose prior are the weights of the other one: without it random drives have 1.03
    # to 1.07 times the error, with 30 windows axes that swing gain less
    kappa_of_plans: float = 10.0
    # factor by which the stack's evidence fades from window to window: 0.9 or 0.98 change errors by 1 to 3 %
    gamma: float = 0.95
    # share of a window that each one takes from those before it where that is more: their weight grows as the square of
    # their number, as experts learn. Without, recordings in windows of 100 have 1.04 times the error, to 1.4
    renewal: float = 0.67
    # lags of the command's expert, and of its increments, which may reach beyond the window before: with 50 instead of
    # 20 errors are 2 % less on drives of modes, 8 % more on drives of two masses, and a third less where the physics
    # model is bad; more than 36 cost more than four million instructions in the dearest sample
    lags_of_command: int = 36
    # prior variance at the largest lag relative to lag 1, of the command's increments too; without it for these a CNC
    # axis that outgrows them has three times the error
    last_lag: float = 0.005
    # samples by which the command may act before the physics model's dead time is over, or half of the dead time, if
    # that is more: where it is two samples too long, which no weight can mend, a warm drive leaves 1.7 times the error
    # of no compensation instead of 0.25
    dead_time_margin: int = 2
    # bound on the least variance of the noise relative to the largest mean square of a window: a larger ``lambda``
    # would prevent any learning
    least_noise: float = 1e-6
    # variance of the noise before it is known, relative to the same: a servo error is repeatable to 10 %
    first_noise: float = 0.01
    # bound on the rows that count as one, and how fast their number follows: without, recordings are 1 to 4 % worse
    correlation_max: float = 100.0
    correlation_rate: float = 0.1
    # largest prediction relative to the largest residual so far, of the physics model and of the command: what is
    # larger was never seen; 2 is up to 2 % worse, a line 1.8 times. The bound on the command's expert grows with its
    # steps, as it is linear in the command: without, CNC axes that creep before a motion have 3 and 4 times the error
    bound: float = 1.2
    # growth of the commanded velocity, for each window that earlier runs weigh, that makes the static features begin
    # anew, as they were learned at a creep: without, the rounding of a command at rest sets their scale, and drives
    # have to 1.4 times the error; where earlier runs do not count, a milling machine forgets them in mid-part. The
    # bound on the command's expert grows by no more
    velocity_jump: float = 1000.0
    # largest weight of earlier runs when another begins, in windows: a machine may have changed meanwhile
    warm_windows_max: float = 30.0
    # weight of earlier runs, relative to the one they have, in the expert that doubts them: a prior from a tenth of a
    # window. Without any, changed plants are worse by an eighth
    warm_prior_weight: float = 0.003
    # Earlier runs are forgotten above all three. Weight of that expert in the stack: with 0.5 unchanged plants err
    # 2 % more. Mean square error of the one that led, relative to the largest of a window: with 0 a changed drive has
    # up to 5 times the error. Sum of squares that the leader errs by more in this run, times that of all its residuals,
    # each relative to a window of the largest: with 0 a creep before the first motion decides, and a rack, warm, has
    # 1.3 times the error; with 0.5 a changed drive has 2.7 times
    discard_above: float = 0.7
    discard_error: float = 0.003
    discard_harm: float = 0.1
    # least velocity of the friction's change of sign relative to the velocity scale, and the ratio from one of the six
    # to the next: half a decade, which neighbours interpolate within; with 5/6 of one the stage's spiral has four times
    # the error, warm
    friction_least: float = 0.01
    friction_ratio: float = 3.1622776601683795
    # least distance of a stop operator, as the time, s, that it takes at the velocity scale, and the ratio from one of
    # the three to the next, up to 0.3 s: up to a third of that servos lose what they gain; from 1 or 3 ms on what a
    # user's own disturbance describes is learned ten times as slowly
    stop_least: float = 0.01
    stop_ratio: float = 5.623413251903491
    # root of the distance of commands from those ahead, relative to their own changes, at which what was measured then
    # counts by half: with 0.2 or 0.3 recordings are the same, warm drives 1 % worse
    recall_tolerance: float = 0.1
    # time in which a recalled residual loses that it was moved to the last one, in windows: without an end, drives that
    # are repeated have to 7 times the error
    recall_fade: float = 0.5
    # repeats, under a compensator, from which on one more changes the memory of a part by a share: without, what the
    # physics model has wrong grows from pass to pass, and the tenth of a belt axis has 1.3 times the error
    recall_repeats: float = 3.5
    recall_share: float = 0.7
    # effect of a disturbance's first difference relative to its own: it only corrects the timing
    difference_share: float = 0.03
    # largest residual that is believed, relative to the largest so far and the physics model's fastest step so far
    # together
    gate: float = 2.0
    # time, s, after which a value beyond it is believed: a sensor may read zero for half a second
    patience: float = 1.0


CONSTANTS = AveragingConstants()  # the product's
