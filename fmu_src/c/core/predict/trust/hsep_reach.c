#include "hsep_reach.h"

#include "hsep_math.h"
#include "hsep_trust_constants.h"

HSEP_API hsep_reach_window
hsep_reach_begin(hsep_reach *self, const hsep_real x_pb[], hsep_real before, hsep_word n, hsep_real largest)
{
    for (hsep_word j = n; j-- > 0; before = x_pb[j]) {
        const hsep_real change = hsep_fabs(x_pb[j] - before);
        self->fastest = change > self->fastest ? change : self->fastest;
    }
    return (hsep_reach_window){.largest = largest, .known = largest > 0.0 && self->fastest > 0.0};
}

HSEP_API int hsep_reach_judge(hsep_reach *self, hsep_reach_window *window, hsep_real e, hsep_real T_s)
{
    const hsep_real size = hsep_fabs(e);
    self->n_missing++;
    if (!isfinite(e)) {
        return 0;
    }
    if (window->known && size > HSEP_TRUST_REACH_RESIDUALS * window->largest + HSEP_TRUST_REACH_STEPS * self->fastest) {
        self->n_beyond++;
    } else if (self->n_beyond > 0) {
        self->n_beyond--;
    }
    if (self->n_beyond > 0 && (hsep_real)self->n_missing <= hsep_ceil(HSEP_TRUST_PATIENCE / T_s)) {
        return 0;
    }
    self->n_missing = self->n_beyond = 0;
    window->largest = size > window->largest ? size : window->largest;
    return 1;
}
