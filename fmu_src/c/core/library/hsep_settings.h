/* Settings as they are declared in hybridsep/base/settings.py, from which this file is generated.
 * Whole numbers, truth values and choices are hsep_int, those that may be negative hsep_signed.
 *
 * SETTING(of, type, name, usual, least, most, nonzero, automatic, learned): the default; closed bounds; the least
 * magnitude of what is not 0, 0 if there is none; a value beside the range that stands for an automatic choice, or
 * least again; whether weights that were learned with another value mean something else. */
#ifndef HSEP_SETTINGS_H
#define HSEP_SETTINGS_H

#include "hsep_real.h"

/* clang-format off */
#define HSEP_PREDICTOR_SETTINGS(SETTING) \
    /* samples in a look-ahead window */ \
    SETTING(predictor, hsep_int, Np, 100.0, 1.0, 100000.0, 0.0, 1.0, 0) \
    /* number of past residuals e_pb (measured minus physics-based position) among the features */ \
    SETTING(predictor, hsep_int, p, 50.0, 1.0, 5000.0, 0.0, 1.0, 1) \
    /* number of past physics-based predictions x_pb among the features */ \
    SETTING(predictor, hsep_int, q, 3.0, 0.0, 5000.0, 0.0, 0.0, 1) \
    /* ridge penalty on the weights of the residual model, m2 */ \
    SETTING(predictor, hsep_real, lambda, 1e-12, 1e-40, 1000000000000.0, 0.0, 1e-40, 1) \
    /* sampling interval of command and measurement, s */ \
    SETTING(predictor, hsep_real, T_s, 0.001, 1e-05, 1.0, 0.0, 1e-05, 1) \
    /* warm-up: until then the prediction x_h is the physics-based x_pb, while learning goes on, s */ \
    SETTING(predictor, hsep_real, t_init, -1.0, 0.0, 1000000.0, 0.0, -1.0, 0) \
    /* how the command x_d runs between samples, zero-order or first-order hold: 0 zoh, 1 foh */ \
    SETTING(predictor, hsep_int, input_hold, 0.0, 0.0, 1.0, 0.0, 0.0, 1) \
    /* whole samples by which the measured position is late; −1: early, under a sequential master */ \
    SETTING(predictor, hsep_signed, measurement_delay, 0.0, -1.0, 10000.0, 0.0, -1.0, 0) \
    /* whole samples of dead time in the physics model */ \
    SETTING(predictor, hsep_int, dead_time, 0.0, 0.0, 100000.0, 0.0, 0.0, 1)

#define HSEP_AVERAGING_SETTINGS(SETTING) \
    /* whether the residual is predicted by online model averaging; false: by the paper's model */ \
    SETTING(averaging, hsep_int, averaging, 1.0, 0.0, 1.0, 0.0, 0.0, 1) \
    /* prior standard deviation of a feature's effect, with averaging; 0: from the residuals, m */ \
    SETTING(averaging, hsep_real, effect, 0.0, 0.0, 10.0, 1e-15, 0.0, 0) \
    /* standard deviation of the measurement noise, with averaging; 0: estimated, m */ \
    SETTING(averaging, hsep_real, noise_std, 0.0, 0.0, 1.0, 1e-15, 0.0, 0) \
    /* time after which samples have lost 63 % of their weight, with averaging; 0: never, s */ \
    SETTING(averaging, hsep_real, forgetting, 0.0, 0.0, 1000000000.0, 0.001, 0.0, 0) \
    /* period of a disturbance that repeats with the position (cogging, screw pitch), with averaging; 0: none, m */ \
    SETTING(averaging, hsep_real, period, 0.0, 0.0, 100.0, 1e-09, 0.0, 1) \
    /* samples that are remembered, to predict a repeated motion by what was measured then, with averaging; 0: none */ \
    SETTING(averaging, hsep_int, recall, 8192.0, 0.0, 1000000.0, 0.0, 0.0, 0)

#define HSEP_COMPENSATOR_SETTINGS(SETTING) \
    /* samples of the command that are planned ahead, at least Np + 4 spacing + 3 */ \
    SETTING(compensator, hsep_int, preview, 200.0, 8.0, 2000.0, 0.0, 8.0, 0) \
    /* samples between the knots of the spline that changes the command, a divisor of Np */ \
    SETTING(compensator, hsep_int, spacing, 2.0, 1.0, 1000.0, 0.0, 1.0, 0) \
    /* weight of the jerk of the command's change against the tracking error */ \
    SETTING(compensator, hsep_real, jerk_weight, 1.0, 0.0, 1000000000000.0, 0.0, 0.0, 0) \
    /* largest velocity of the modified command, m/s */ \
    SETTING(compensator, hsep_real, v_max, 0.1, 1e-09, 10000.0, 0.0, 1e-09, 0) \
    /* largest acceleration of the modified command, m/s2 */ \
    SETTING(compensator, hsep_real, a_max, 16.0, 1e-06, 1000000.0, 0.0, 1e-06, 0) \
    /* largest jerk of the modified command, m/s3 */ \
    SETTING(compensator, hsep_real, j_max, 5000.0, 1e-06, 1000000000000.0, 0.0, 1e-06, 0) \
    /* largest change of the command, m */ \
    SETTING(compensator, hsep_real, change_max, 0.001, 1e-12, 10.0, 0.0, 1e-12, 0) \
    /* following error, or its geometric mean with that from x_dm, at which compensation ends; 0: none, m */ \
    SETTING(compensator, hsep_real, following_error_max, 0.0, 0.0, 10.0, 1e-12, 0.0, 0) \
    /* whether plans of a linear model keep x_dm from turning while x_d moves */ \
    SETTING(compensator, hsep_int, no_reversal, 1.0, 0.0, 1.0, 0.0, 0.0, 0) \
    /* best model to compensate with: 0 off, 1 physics, 2 hybrid */ \
    SETTING(compensator, hsep_int, compensate, 2.0, 0.0, 2.0, 0.0, 0.0, 0) \
    /* time without a measurement after which the command's change fades; 0: never, s */ \
    SETTING(compensator, hsep_real, measurement_timeout, 1.0, 0.0, 10000.0, 1e-05, 0.0, 0) \
    /* samples of a plan: after the preview the command is taken to go on at its last velocity */ \
    SETTING(compensator, hsep_int, horizon, 0.0, 0.0, 2000.0, 0.0, 0.0, 0)

#define HSEP_MODE_SETTINGS(SETTING) \
    /* natural frequency of the mode, Hz */ \
    SETTING(mode, hsep_real, f_n, 0.0, 0.001, 100000.0, 0.0, 0.001, 1) \
    /* damping ratio of the mode */ \
    SETTING(mode, hsep_real, zeta, 0.0, 1e-06, 10000.0, 0.0, 1e-06, 1) \
    /* numerator of the mode's transfer function, constant term, 1/s2 */ \
    SETTING(mode, hsep_real, alpha, 0.0, -1000000000000000.0, 1000000000000000.0, 0.0, -1000000000000000.0, 1) \
    /* numerator of the mode's transfer function, factor of s, 1/s */ \
    SETTING(mode, hsep_real, beta, 0.0, -10000000000.0, 10000000000.0, 0.0, -10000000000.0, 1)

/* clang-format on */

#define HSEP_SETTING(of, type, name, ...) type name;

typedef struct {
    HSEP_PREDICTOR_SETTINGS(HSEP_SETTING)
} hsep_predictor_settings;

typedef struct {
    HSEP_AVERAGING_SETTINGS(HSEP_SETTING)
} hsep_averaging_settings;

typedef struct {
    HSEP_COMPENSATOR_SETTINGS(HSEP_SETTING)
} hsep_compensator_settings;

/* Samples by which the measurement is late; 0 where it comes a sample early. */
static inline hsep_int hsep_late(const hsep_predictor_settings *settings)
{
    return settings->measurement_delay > 0 ? (hsep_int)settings->measurement_delay : 0;
}

#endif
