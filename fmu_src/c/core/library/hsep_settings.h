/* Settings as they are declared in hybridsep/base/settings.py, from which this file is generated.
 * Whole numbers, truth values and choices are hsep_int, those that may be negative hsep_signed. */
#ifndef HSEP_SETTINGS_H
#define HSEP_SETTINGS_H

#include "hsep_real.h"

/* clang-format off */
#define HSEP_PREDICTOR_SETTINGS(SETTING) \
    /* samples in a look-ahead window */ \
    SETTING(hsep_int, Np) \
    /* number of past residuals e_pb (measured minus physics-based position) among the features */ \
    SETTING(hsep_int, p) \
    /* number of past physics-based predictions x_pb among the features */ \
    SETTING(hsep_int, q) \
    /* ridge penalty on the weights of the residual model, m2 */ \
    SETTING(hsep_real, lambda) \
    /* sampling interval of command and measurement, s */ \
    SETTING(hsep_real, T_s) \
    /* warm-up: until then the prediction x_h is the physics-based x_pb, while learning goes on, s */ \
    SETTING(hsep_real, t_init) \
    /* how the command x_d runs between samples, zero-order or first-order hold: 0 zoh, 1 foh */ \
    SETTING(hsep_int, input_hold) \
    /* whole samples by which the measured position is late; −1: early, under a sequential master */ \
    SETTING(hsep_signed, measurement_delay) \
    /* whole samples of dead time in the physics model */ \
    SETTING(hsep_int, dead_time)

#define HSEP_AVERAGING_SETTINGS(SETTING) \
    /* whether the residual is predicted by online model averaging; false: by the paper's model */ \
    SETTING(hsep_int, averaging) \
    /* prior standard deviation of a feature's effect, with averaging; 0: from the residuals, m */ \
    SETTING(hsep_real, effect) \
    /* standard deviation of the measurement noise, with averaging; 0: estimated, m */ \
    SETTING(hsep_real, noise_std) \
    /* time after which samples have lost 63 % of their weight, with averaging; 0: never, s */ \
    SETTING(hsep_real, forgetting) \
    /* period of a disturbance that repeats with the position (cogging, screw pitch), with averaging; 0: none, m */ \
    SETTING(hsep_real, period) \
    /* samples that are remembered, to predict a repeated motion by what was measured then, with averaging; 0: none */ \
    SETTING(hsep_int, recall)

#define HSEP_COMPENSATOR_SETTINGS(SETTING) \
    /* samples of the command that are planned ahead, at least Np + 4 spacing + 3 */ \
    SETTING(hsep_int, preview) \
    /* samples between the knots of the spline that changes the command, a divisor of Np */ \
    SETTING(hsep_int, spacing) \
    /* weight of the jerk of the command's change against the tracking error */ \
    SETTING(hsep_real, jerk_weight) \
    /* largest velocity of the modified command, m/s */ \
    SETTING(hsep_real, v_max) \
    /* largest acceleration of the modified command, m/s2 */ \
    SETTING(hsep_real, a_max) \
    /* largest jerk of the modified command, m/s3 */ \
    SETTING(hsep_real, j_max) \
    /* largest change of the command, m */ \
    SETTING(hsep_real, change_max) \
    /* following error above which, for three samples in a row, the command's change fades until reset; 0: none, m */ \
    SETTING(hsep_real, following_error_max) \
    /* whether the modified command never turns while the commanded position moves */ \
    SETTING(hsep_int, no_reversal) \
    /* best model to compensate with: 0 off, 1 physics, 2 hybrid */ \
    SETTING(hsep_int, compensate) \
    /* time without a measurement after which the command's change fades; 0: never, s */ \
    SETTING(hsep_real, measurement_timeout)

/* clang-format on */

#define HSEP_SETTING(type, name) type name;

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
