/* Settings as they are declared in hybridsep/base/settings.py, from which this file is generated.
 * Whole numbers, truth values and choices are uint64_t. */
#ifndef HSEP_SETTINGS_H
#define HSEP_SETTINGS_H

#include <stdint.h>

/* clang-format off */
#define HSEP_PREDICTOR_SETTINGS(SETTING) \
    /* samples in a look-ahead window */ \
    SETTING(uint64_t, Np) \
    /* number of past residuals e_pb (measured minus physics-based position) among the features */ \
    SETTING(uint64_t, p) \
    /* number of past physics-based predictions x_pb among the features */ \
    SETTING(uint64_t, q) \
    /* ridge penalty on the weights of the residual model, m2 */ \
    SETTING(double, lambda) \
    /* sampling interval of command and measurement, s */ \
    SETTING(double, T_s) \
    /* warm-up: until then the prediction x_h is the physics-based x_pb, while learning goes on, s */ \
    SETTING(double, t_init) \
    /* how the command x_d runs between samples, zero-order or first-order hold: 0 zoh, 1 foh */ \
    SETTING(uint64_t, input_hold) \
    /* whole samples by which the measured position is late */ \
    SETTING(uint64_t, measurement_delay) \
    /* whole samples of dead time in the physics model */ \
    SETTING(uint64_t, dead_time)

#define HSEP_TRUST_SETTINGS(SETTING) \
    /* whether the residual model is trusted only as far as its variance allows; false: the paper's */ \
    SETTING(uint64_t, trust) \
    /* prior standard deviation of a feature's effect, with trust; 0: from the residuals, m */ \
    SETTING(double, effect) \
    /* standard deviation of the measurement noise, with trust; 0: estimated, m */ \
    SETTING(double, noise_std) \
    /* time after which samples have lost 63 % of their weight, with trust; 0: never, s */ \
    SETTING(double, forgetting) \
    /* period of a disturbance that repeats with the position (cogging, screw pitch), with trust; 0: none, m */ \
    SETTING(double, period)

#define HSEP_COMPENSATOR_SETTINGS(SETTING) \
    /* samples of the command that are planned ahead, at least Np + 4 spacing + 3 */ \
    SETTING(uint64_t, preview) \
    /* samples between the knots of the spline that changes the command, a divisor of Np */ \
    SETTING(uint64_t, spacing) \
    /* weight of the jerk of the command's change against the tracking error */ \
    SETTING(double, jerk_weight) \
    /* largest velocity of the modified command, m/s */ \
    SETTING(double, v_max) \
    /* largest acceleration of the modified command, m/s2 */ \
    SETTING(double, a_max) \
    /* largest jerk of the modified command, m/s3 */ \
    SETTING(double, j_max) \
    /* largest change of the command, m */ \
    SETTING(double, change_max) \
    /* whether the modified command never turns while the commanded position moves */ \
    SETTING(uint64_t, no_reversal) \
    /* best model to compensate with: 0 off, 1 physics, 2 hybrid */ \
    SETTING(uint64_t, compensate)

/* clang-format on */

#define HSEP_SETTING(type, name) type name;

typedef struct {
    HSEP_PREDICTOR_SETTINGS(HSEP_SETTING)
} hsep_predictor_settings;

typedef struct {
    HSEP_TRUST_SETTINGS(HSEP_SETTING)
} hsep_trust_settings;

typedef struct {
    HSEP_COMPENSATOR_SETTINGS(HSEP_SETTING)
} hsep_compensator_settings;

#endif
