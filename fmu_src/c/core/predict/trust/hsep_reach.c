#include "hsep_reach.h"

#include "hsep_trust_constants.h"

#include <math.h>

HSEP_API hsep_reach_window
hsep_reach_begin(hsep_reach *self, const double x_pb[], double before, uint64_t n, double largest)
{
    for (uint64_t j = n; j-- > 0; before = x_pb[j]) {
        const double change = fabs(x_pb[j] - before);
        self->fastest = change > self->fastest ? change : self->fastest;
    }
    return (hsep_reach_window){.largest = largest, .known = largest > 0.0 && self->fastest > 0.0};
}

HSEP_API int hsep_reach_judge(hsep_reach *self, hsep_reach_window *window, double e, double T_s)
{
    const double size = fabs(e);
    self->n_missing++;
    if (!isfinite(e)) {
        return 0;
    }
    if (window->known && size > HSEP_TRUST_REACH_RESIDUALS * window->largest + HSEP_TRUST_REACH_STEPS * self->fastest) {
        self->n_beyond++;
    } else if (self->n_beyond > 0) {
        self->n_beyond--;
    }
    if (self->n_beyond > 0 && (double)self->n_missing <= ceil(HSEP_TRUST_PATIENCE / T_s)) {
        return 0;
    }
    self->n_missing = self->n_beyond = 0;
    window->largest = size > window->largest ? size : window->largest;
    return 1;
}
