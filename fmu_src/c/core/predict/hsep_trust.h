/* When the hybrid model may move the machine: while the mean square of its errors, with exponential forgetting, exceeds
 * that of the physics model by no more than half the noise variance. Plain data; reentrant. */
#ifndef HSEP_TRUST_H
#define HSEP_TRUST_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

typedef struct {
    double excess; /* m2; trusted while <= 0 */
} hsep_trust;

HSEP_ASSERT_WORDS(hsep_trust, 1);

/* Take in a measured window. e_pb: measured residuals of the physics model, e_h: what the hybrid model predicted of
 * them, both (n,), m; noise_variance: of what no model explains, m2. */
HSEP_API void hsep_trust_observe(
    hsep_trust *self, const double e_pb[], const double e_h[], uint64_t n, double noise_variance);

#endif
