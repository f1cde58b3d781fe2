/* Features of the reference, for friction that changes its sign with the commanded velocity v: psi = tanh(v /
 * v_friction), shifted by some samples to either side.
 *
 * The signs psi of a plan are kept from HSEP_REFERENCE_REACH samples before it to as many after it, (n + 2 reach,):
 * that of sample k is at place reach + k. Reentrant; allocates nothing.
 */
#ifndef HSEP_REFERENCE_FEATURES_H
#define HSEP_REFERENCE_FEATURES_H

#include "hsep_api.h"

#include <stdint.h>

#define HSEP_N_REFERENCE 13     /* features */
#define HSEP_REFERENCE_REACH 40 /* largest shift, samples */

/* Fill psi over n samples of the reference, m, and zeros after them. last: the reference one sample before,
 * m; step: v_friction T_s, m. Cost: n tanh. */
HSEP_API void hsep_reference_features_signs(
    double signs[], const double reference[], uint64_t n, double last, double step);

/* The features of sample k, m. */
HSEP_API void hsep_reference_features_at(const double signs[], uint64_t k, double features[HSEP_N_REFERENCE]);

/* Advance by n samples. */
HSEP_API void hsep_reference_features_advance(double signs[], uint64_t n);

#endif
