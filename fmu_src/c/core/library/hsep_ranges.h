/* Ranges of the library's parameters, generated from hybridsep/base/settings.py.
 *
 * RANGE(type, name, usual, least, most, nonzero, automatic, learned): the default; closed bounds; the least magnitude
 * of what is not 0, 0 if there is none; a value beside the range that stands for an automatic choice, or least again;
 * whether weights that were learned with another value mean something else. */
#ifndef HSEP_RANGES_H
#define HSEP_RANGES_H

/* clang-format off */
#define HSEP_PREDICTOR_RANGES(RANGE) \
    RANGE(hsep_int, Np, 100.0, 1.0, 100000.0, 0.0, 1.0, 0) \
    RANGE(hsep_int, p, 50.0, 1.0, 5000.0, 0.0, 1.0, 1) \
    RANGE(hsep_int, q, 3.0, 0.0, 5000.0, 0.0, 0.0, 1) \
    RANGE(hsep_real, lambda, 1e-12, 1e-40, 1000000000000.0, 0.0, 1e-40, 1) \
    RANGE(hsep_real, T_s, 0.001, 1e-05, 1.0, 0.0, 1e-05, 1) \
    RANGE(hsep_real, t_init, -1.0, 0.0, 1000000.0, 0.0, -1.0, 0) \
    RANGE(hsep_int, input_hold, 0.0, 0.0, 1.0, 0.0, 0.0, 1) \
    RANGE(hsep_signed, measurement_delay, 0.0, -1.0, 10000.0, 0.0, -1.0, 0) \
    RANGE(hsep_int, dead_time, 0.0, 0.0, 100000.0, 0.0, 0.0, 1)

#define HSEP_AVERAGING_RANGES(RANGE) \
    RANGE(hsep_int, averaging, 1.0, 0.0, 1.0, 0.0, 0.0, 1) \
    RANGE(hsep_real, effect, 0.0, 0.0, 10.0, 1e-15, 0.0, 0) \
    RANGE(hsep_real, noise_std, 0.0, 0.0, 1.0, 1e-15, 0.0, 0) \
    RANGE(hsep_real, forgetting, 0.0, 0.0, 1000000000.0, 0.001, 0.0, 0) \
    RANGE(hsep_real, period, 0.0, 0.0, 100.0, 1e-09, 0.0, 1) \
    RANGE(hsep_int, recall, 8192.0, 0.0, 1000000.0, 0.0, 0.0, 0)

#define HSEP_COMPENSATOR_RANGES(RANGE) \
    RANGE(hsep_int, preview, 200.0, 8.0, 2000.0, 0.0, 8.0, 0) \
    RANGE(hsep_int, spacing, 2.0, 1.0, 1000.0, 0.0, 1.0, 0) \
    RANGE(hsep_real, jerk_weight, 1.0, 0.0, 1000000000000.0, 0.0, 0.0, 0) \
    RANGE(hsep_real, v_max, 0.1, 1e-09, 10000.0, 0.0, 1e-09, 0) \
    RANGE(hsep_real, a_max, 16.0, 1e-06, 1000000.0, 0.0, 1e-06, 0) \
    RANGE(hsep_real, j_max, 5000.0, 1e-06, 1000000000000.0, 0.0, 1e-06, 0) \
    RANGE(hsep_real, change_max, 0.001, 1e-12, 10.0, 0.0, 1e-12, 0) \
    RANGE(hsep_real, following_error_max, 0.0, 0.0, 10.0, 1e-12, 0.0, 0) \
    RANGE(hsep_int, no_reversal, 1.0, 0.0, 1.0, 0.0, 0.0, 0) \
    RANGE(hsep_int, compensate, 2.0, 0.0, 2.0, 0.0, 0.0, 0) \
    RANGE(hsep_real, measurement_timeout, 1.0, 0.0, 10000.0, 1e-05, 0.0, 0)

#define HSEP_MODE_RANGES(RANGE) \
    RANGE(hsep_real, f_n, 0.0, 0.001, 100000.0, 0.0, 0.001, 1) \
    RANGE(hsep_real, zeta, 0.0, 1e-06, 10000.0, 0.0, 1e-06, 1) \
    RANGE(hsep_real, alpha, 0.0, -1000000000000000.0, 1000000000000000.0, 0.0, -1000000000000000.0, 1) \
    RANGE(hsep_real, beta, 0.0, -10000000000.0, 10000000000.0, 0.0, -10000000000.0, 1)

/* clang-format on */

#endif
