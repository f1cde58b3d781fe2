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

/* Most lags of the command's expert, and of its increments: with 50 instead of 20 errors are 2 % less on drives of
 * modes, 8 % more on those of two masses, and a third less where the physics model is bad; more than 36 cost more
 * than four million instructions in the dearest sample. */
#define HSEP_TRUST_LAGS_OF_COMMAND 36

/* Prior variance of the weight of the last lag, relative to that of the first: the residual's memory fades. */
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
 * larger was never seen. Where the command's expert leads, its bound grows with its steps, by up to growth: without,
 * CNC axes that creep before a motion have 3 and 4 times the error. */
#define HSEP_TRUST_BOUND 1.2
#define HSEP_TRUST_BOUND_OF_COMMAND 2.0

/* Growth of the commanded velocity that makes the static features begin anew, as they were learned at a creep: the
 * first until rows of learned windows are learned, then the second. */
#define HSEP_TRUST_GROWTH 30.0
#define HSEP_TRUST_GROWTH_LEARNED 1000.0
#define HSEP_TRUST_LEARNED 15.0

/* Largest weight of earlier runs when another begins, in windows: a machine may have changed meanwhile. */
#define HSEP_TRUST_CARRIED 30.0

/* Weight of earlier runs, relative to the one they have, in the expert that doubts them: a prior from a tenth of a
 * window. Without any, changed plants are worse by an eighth. */
#define HSEP_TRUST_LESS 0.003

/* Weight of that expert in the stack from which on earlier runs are forgotten: with 0.5 plants that have not changed
 * are worse by 2 %. */
#define HSEP_TRUST_DOUBT 0.7

/* Rows of this run relative to all from which on there is nothing left to doubt. */
#define HSEP_TRUST_DOUBT_OVER 0.8

/* Least velocity of the friction's change of sign relative to the velocity scale, and the ratio from one of the six
 * to the next: half a decade, which neighbours interpolate within. */
#define HSEP_TRUST_FRICTION_LEAST 0.01
#define HSEP_TRUST_FRICTION_RATIO 3.1622776601683795

/* Effect of a disturbance's first difference relative to its own: it only corrects the timing. */
#define HSEP_TRUST_DIFFERENCE_SHARE 0.03

/* Plausible deviation of a measurement: in mean deviations, in steps of the sensor's resolution, and relative to the
 * largest residual and to the predicted motion of a sample. */
#define HSEP_TRUST_SPREADS 12.0
#define HSEP_TRUST_RESOLUTION 3.0
#define HSEP_TRUST_SMALL 0.01
#define HSEP_TRUST_RIPPLE 0.1

/* Plausible change of the residual from sample to sample, relative to the predicted motion or the vibration. */
#define HSEP_TRUST_PACE 2.0

/* Median change of the residual from sample to sample that noise makes, in mean deviations: white noise 1.4. */
#define HSEP_TRUST_VIBRATION_NOISE 2.0

/* Motion under which an axis is believed to stand, relative to the largest under which it has stood by itself: with
 * 2 two servos with stiction have 1.4 and 2 times the error. */
#define HSEP_TRUST_STOOD_MORE 5.0

/* Bound on that motion, relative to the largest residual so far: without, the stuck sensor of a drive that had stood
 * at a reversal was believed, with 2.9 times the physics model's error after it. */
#define HSEP_TRUST_STOOD_RESIDUAL 4.0

/* Time, s, after which another level is believed, two windows at least, and the first time, after which an axis that
 * stands is: an encoder may be held for half a second. */
#define HSEP_TRUST_PATIENCE 0.05
#define HSEP_TRUST_PATIENCE_STANDING 0.6

/* Rates at which the mean deviation follows that of a window; the vibration rises at once, and falls as it does. */
#define HSEP_TRUST_RISE 0.5
#define HSEP_TRUST_FALL 0.02

#endif
