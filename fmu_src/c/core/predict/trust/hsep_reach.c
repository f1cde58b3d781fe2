#include "hsep_reach.h"

#include "hsep_trust_constants.h"

#include <math.h>

HSEP_API void hsep_reach_judge(
    hsep_reach *self, const double x[], const double x_pb[], double before, uint64_t n, double largest, double T_s,
    double believed[])
{
    const double patience = ceil(HSEP_TRUST_PATIENCE / T_s);
    for (uint64_t j = n; j-- > 0; before = x_pb[j]) {
        self->fastest = fmax(self->fastest, fabs(x_pb[j] - before));
    }
    const int known = largest > 0.0 && self->fastest > 0.0;
    for (uint64_t j = n; j-- > 0;) {
        const double e = fabs(x[j] - x_pb[j]);
        self->n_missing++;
        believed[j] = 0.0;
        if (!isfinite(x[j])) {
            continue;
        }
        const int beyond = e > HSEP_TRUST_REACH_RESIDUALS * largest + HSEP_TRUST_REACH_STEPS * self->fastest;
        if (known && beyond) {
            self->n_beyond++;
        } else if (self->n_beyond > 0) {
            self->n_beyond--;
        }
        if (self->n_beyond == 0 || (double)self->n_missing > patience) {
            believed[j] = 1.0;
            self->n_missing = self->n_beyond = 0;
            largest = fmax(largest, e);
        }
    }
}
