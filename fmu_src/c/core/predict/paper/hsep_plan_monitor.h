/* Excess prediction error of the hybrid model over the physics model, with exponential forgetting. The hybrid model is
 * trusted while it is at most half the noise variance. Plain data; reentrant. */
#ifndef HSEP_PLAN_MONITOR_H
#define HSEP_PLAN_MONITOR_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

typedef struct {
    double excess; /* m2; trusted while <= 0 */
} hsep_plan_monitor;

HSEP_ASSERT_WORDS(hsep_plan_monitor, 1);

/* Update the excess with a measured window. e_pb: measured residuals of the physics model, e_h: their predictions by
 * the hybrid model, both (n,), m; noise_variance: of the measurement, m2. */
HSEP_API void hsep_plan_monitor_observe(
    hsep_plan_monitor *self, const double e_pb[], const double e_h[], uint64_t n, double noise_variance);

#endif
