/* Constants of the residual model with trust, generated from hybridsep/predict/trust/constants.py. */
#ifndef HSEP_TRUST_CONSTANTS_H
#define HSEP_TRUST_CONSTANTS_H

/* Evidence that the first weights of the stack count for, in windows of the best expert's mean square: 0.3 or 3
 * change errors by 1 to 3 %. */
#define HSEP_TRUST_KAPPA 1.0

/* Factor by which the stack's evidence fades from window to window: 0.9 or 0.98 change errors by 1 to 3 %. */
#define HSEP_TRUST_GAMMA 0.95

/* First weights of the experts with and without lags; hold and command begin with none: with 0.2 for the command's
 * the worst drives are worse. */
#define HSEP_TRUST_FIRST_LAGGED 0.5
#define HSEP_TRUST_FIRST_STATIC 0.5

/* Lags of the command's expert, and of its increments, which may reach beyond the window before: with 50 instead of
 * 20 errors are 2 % less on drives of modes, 8 % more on those of two masses, and a third less where the physics
 * model is bad; more than 36 cost more than four million instructions in the dearest sample. */
#define HSEP_TRUST_LAGS_OF_COMMAND 36

/* Prior variance of the weight of the last lag, and of the command's last increment, relative to that of the first:
 * memory fades. Without it for the increments a CNC axis that outgrows them has three times the error. */
#define HSEP_TRUST_LAST_LAG 0.005

/* Bound on the least variance of the noise relative to the largest mean square of a window: a larger lambda would
 * prevent any learning. */
#define HSEP_TRUST_LEAST_NOISE 1e-06

/* Variance of the noise before it is known, relative to the same: a servo error is repeatable to 10 %. */
#define HSEP_TRUST_FIRST_NOISE 0.01

/* Bound on the rows that count as one, and how fast their number follows: without, recordings are 1 to 4 % worse. */
#define HSEP_TRUST_CORRELATION_MAX 100.0
#define HSEP_TRUST_CORRELATION_RATE 0.1

/* Largest prediction relative to the largest residual so far, of the physics model and of the command: what is
 * larger was never seen. Where the command's expert leads, its bound grows with its steps: without, CNC axes that
 * creep before a motion have 3 and 4 times the error. */
#define HSEP_TRUST_BOUND 1.2
#define HSEP_TRUST_BOUND_OF_COMMAND 2.0

/* Largest growth of that bound. */
#define HSEP_TRUST_GROWTH 30.0

/* Growth of the commanded velocity that makes the static features begin anew, as they were learned at a creep:
 * without, the rounding of a command at rest sets their scale, and drives have to 1.4 times the error. */
#define HSEP_TRUST_OUTGROWN 1000.0

/* Largest weight of earlier runs when another begins, in windows: a machine may have changed meanwhile. */
#define HSEP_TRUST_CARRIED 30.0

/* Weight of earlier runs, relative to the one they have, in the expert that doubts them: a prior from a tenth of a
 * window. Without any, changed plants are worse by an eighth. */
#define HSEP_TRUST_LESS 0.003

/* Weight of that expert in the stack from which on earlier runs are forgotten: with 0.5 plants that have not changed
 * are worse by 2 %. */
#define HSEP_TRUST_DOUBT 0.7

/* Least velocity of the friction's change of sign relative to the velocity scale, and the ratio from one of the six
 * to the next: half a decade, which neighbours interpolate within. */
#define HSEP_TRUST_FRICTION_LEAST 0.01
#define HSEP_TRUST_FRICTION_RATIO 3.1622776601683795

/* Effect of a disturbance's first difference relative to its own: it only corrects the timing. */
#define HSEP_TRUST_DIFFERENCE_SHARE 0.03

/* Largest residual that is believed: relative to the largest so far, and in steps of the fastest motion of the
 * physics model so far on top of it. */
#define HSEP_TRUST_REACH_RESIDUALS 2.0
#define HSEP_TRUST_REACH_STEPS 2.0

/* Time, s, after which a value beyond it is believed: a sensor may read zero for half a second. */
#define HSEP_TRUST_PATIENCE 1.0

#endif
