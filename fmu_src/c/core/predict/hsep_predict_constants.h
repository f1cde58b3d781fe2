/* Constants of predictions and their errors, generated from modules of hybridsep/predict. */
#ifndef HSEP_PREDICT_CONSTANTS_H
#define HSEP_PREDICT_CONSTANTS_H

/* First variance of the error relative to that of its causes: timing, variance of the experts. */
#define HSEP_UNCERTAINTY_SHARES 4.0, 2.0

/* First variance of a noise that is not known, relative to lambda. */
#define HSEP_UNCERTAINTY_UNKNOWN_NOISE 25.0

/* Time constant of the averaging of timing and variance of the experts, in windows. */
#define HSEP_UNCERTAINTY_FELT_FOR 0.2

/* Bounds on the variance relative to its cause, relative to the first one. */
#define HSEP_UNCERTAINTY_LEAST_SHARE 1e-09
#define HSEP_UNCERTAINTY_MOST_SHARE 10000.0

/* Least variance relative to the recent mean square of the residual. */
#define HSEP_UNCERTAINTY_FLOOR 1e-06

/* Variance, m2, that no divisor is below. */
#define HSEP_UNCERTAINTY_LEAST_VARIANCE HSEP_TINY(1e-100)

/* Largest square of an error, relative to its variance, that counts; least change of a component in one window. */
#define HSEP_UNCERTAINTY_OUTLYING 16.0
#define HSEP_UNCERTAINTY_VANISHING 0.01

/* Factor by which the mean square of the residual fades from window to window. */
#define HSEP_UNCERTAINTY_RECENT 0.9

/* Factor by which evidence fades from window to window; evidence that the first values count for, in windows; and
 * the step of expectation maximisation, which alone would be slow where components are alike. */
#define HSEP_UNCERTAINTY_MEMORY 0.97
#define HSEP_UNCERTAINTY_FIRST_EVIDENCE 0.2
#define HSEP_UNCERTAINTY_STEP 6.0

/* Standard deviations, and the probability that a normal error exceeds them. */
#define HSEP_UNCERTAINTY_LEVELS {0.6745, 0.5}, {1.645, 0.1}, {1.96, 0.05}

/* Change of ln c in the middle of a window from one window to the next per share of errors; bound on it. */
#define HSEP_UNCERTAINTY_FACTOR_RATE 0.03
#define HSEP_UNCERTAINTY_FACTOR_MAX 4.0

/* c at the end of a window relative to its beginning: the first one, the change of its logarithm per share of
 * errors, weighted by their distance from the middle, and bound. */
#define HSEP_UNCERTAINTY_RATIO 1.2
#define HSEP_UNCERTAINTY_RATIO_RATE 0.8
#define HSEP_UNCERTAINTY_RATIO_MAX 16.0

/* Commanded velocity of the first sample relative to the largest of the window, from which on an axis may have been
 * in motion: from rest a jerk-limited command needs time. */
#define HSEP_START_MOVING 0.05

/* Samples for each number of the state that are needed to estimate it. */
#define HSEP_START_SAMPLES 4

/* Ridge penalty on the change of the state, relative to a response of unit gain: modes that decay at once are not
 * determined. */
#define HSEP_START_DAMPING 0.001

/* Bound on the impulse response of a recursion, on the variance relative to the square of the bound on a prediction,
 * and on the correlation that a window shows. */
#define HSEP_EXPERT_DIVERGED 1000000.0

/* Largest lag within a window, relative to the bound on a prediction: what is beyond has diverged. */
#define HSEP_EXPERT_LAG_BOUND 10.0

/* Least variance of the noise, and least sum of the squares of the rows about the weights, relative to the sum of
 * the squares of the targets: the C core has it from a Gram matrix, which does not resolve less, and no less matters
 * before 10⁷ rows without noise. */
#define HSEP_EXPERT_RESOLUTION 1e-13

/* Magnitude of a feature that counts as 0. */
#define HSEP_EXPERT_LEAST HSEP_TINY(1e-150)

/* Mean square, m2, that counts as 0. */
#define HSEP_STACK_LEAST_SQUARE HSEP_TINY(1e-300)

/* Lags of a row that may stand for samples without a measurement. */
#define HSEP_TRUSTED_BRIDGED 3

/* Velocity, m/s, below which a command is at rest: ratios of smaller ones may underflow. */
#define HSEP_DISTURBANCES_LEAST_VELOCITY HSEP_TINY(1e-200)

/* Largest order of a difference of x_pb: velocity, acceleration and jerk. */
#define HSEP_DISTURBANCES_DIFFERENCES 3

#endif
