/* Features that follow from the reference alone: which way friction will push. psi = tanh(v / v_friction) of the commanded
 * velocity v, and of it some samples before and after, enter phi as further features.
 *
 * The signs psi of a plan are kept from HSEP_SCHEDULE_REACH samples before it to as many after it, (n + 2 reach,): that
 * of sample k is at place reach + k. Reentrant; allocates nothing.
 */
#ifndef HSEP_SCHEDULE_H
#define HSEP_SCHEDULE_H

#include "hsep_api.h"

#include <stdint.h>

#define HSEP_SCHEDULED 13      /* features */
#define HSEP_SCHEDULE_REACH 40 /* samples by which the farthest of them are shifted */

/* Fill the signs of n samples of the reference, m, and what follows them, which is at rest. last: the reference one
 * sample before, m; step: v_friction T_s, m. Cost: n tanh. */
HSEP_API void hsep_schedule_signs(double signs[], const double reference[], uint64_t n, double last, double step);

/* The features of sample k, m. */
HSEP_API void hsep_schedule_features(const double signs[], uint64_t k, double features[HSEP_SCHEDULED]);

/* Move on by n samples. */
HSEP_API void hsep_schedule_next(double signs[], uint64_t n);

#endif
