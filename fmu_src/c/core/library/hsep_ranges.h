/* Ranges of the library's parameters, generated from hybridsep/base/settings.py.
 *
 * RANGE(type, name, usual, least, most, nonzero, automatic, learned): the default; closed bounds; the least magnitude
 * of what is not 0, 0 if there is none; a value beside the range that stands for an automatic choice, or least again;
 * whether weights that were learned with another value mean something else. */
#ifndef HSEP_RANGES_H
#define HSEP_RANGES_H

/* clang-format off */
#define HSEP_PREDICTOR_RANGES(RANGE) \
    RANGE(uint64_t, Np, 100.0, 1.0, 100000.0, 0.0, 1.0, 0) \
    RANGE(uint64_t, p, 50.0, 1.0, 5000.0, 0.0, 1.0, 1) \
    RANGE(uint64_t, q, 3.0, 0.0, 5000.0, 0.0, 0.0, 1) \
    RANGE(double, lambda, 1e-12, 1e-40, 1000000000000.0, 0.0, 1e-40, 1) \
    RANGE(double, T_s, 0.001, 1e-05, 1.0, 0.0, 1e-05, 1) \
    RANGE(double, t_init, -1.0, 0.0, 1000000.0, 0.0, -1.0, 0) \
    RANGE(uint64_t, input_hold, 0.0, 0.0, 1.0, 0.0, 0.0, 1) \
    RANGE(uint64_t, measurement_delay, 0.0, 0.0, 10000.0, 0.0, 0.0, 0) \
    RANGE(uint64_t, dead_time, 0.0, 0.0, 100000.0, 0.0, 0.0, 1)

#define HSEP_TRUST_RANGES(RANGE) \
    RANGE(uint64_t, trust, 1.0, 0.0, 1.0, 0.0, 0.0, 1) \
    RANGE(double, effect, 0.0, 0.0, 10.0, 1e-15, 0.0, 0) \
    RANGE(double, noise_std, 0.0, 0.0, 1.0, 1e-15, 0.0, 0) \
    RANGE(double, forgetting, 0.0, 0.0, 1000000000.0, 0.001, 0.0, 0) \
    RANGE(double, period, 0.0, 0.0, 100.0, 1e-09, 0.0, 1)

#define HSEP_COMPENSATOR_RANGES(RANGE) \
    RANGE(uint64_t, preview, 200.0, 8.0, 2000.0, 0.0, 8.0, 0) \
    RANGE(uint64_t, spacing, 2.0, 1.0, 1000.0, 0.0, 1.0, 0) \
    RANGE(double, jerk_weight, 1.0, 0.0, 1000000000000.0, 0.0, 0.0, 0) \
    RANGE(double, v_max, 0.1, 1e-09, 10000.0, 0.0, 1e-09, 0) \
    RANGE(double, a_max, 16.0, 1e-06, 1000000.0, 0.0, 1e-06, 0) \
    RANGE(double, j_max, 5000.0, 1e-06, 1000000000000.0, 0.0, 1e-06, 0) \
    RANGE(double, change_max, 0.001, 1e-12, 10.0, 0.0, 1e-12, 0) \
    RANGE(uint64_t, no_reversal, 1.0, 0.0, 1.0, 0.0, 0.0, 0) \
    RANGE(uint64_t, compensate, 2.0, 0.0, 2.0, 0.0, 0.0, 0)

#define HSEP_MODE_RANGES(RANGE) \
    RANGE(double, f_n, 0.0, 0.001, 100000.0, 0.0, 0.001, 1) \
    RANGE(double, zeta, 0.0, 1e-06, 10000.0, 0.0, 1e-06, 1) \
    RANGE(double, alpha, 0.0, -1000000000000000.0, 1000000000000000.0, 0.0, -1000000000000000.0, 1) \
    RANGE(double, beta, 0.0, -10000000000.0, 10000000000.0, 0.0, -10000000000.0, 1)

/* clang-format on */

#endif
