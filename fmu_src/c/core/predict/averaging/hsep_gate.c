#include "hsep_gate.h"

#include "hsep_math.h"
#include "hsep_predict_constants.h"

HSEP_API void hsep_gate_begin(hsep_gate *self, hsep_real largest, hsep_real fastest)
{
    self->largest = largest;
    self->fastest = fastest;
    self->known = largest > 0.0 && fastest > 0.0;
}

HSEP_API int hsep_gate_judge(hsep_gate *self, hsep_real e, hsep_real T_s)
{
    const hsep_real size = hsep_fabs(e), most = HSEP_AVERAGING_GATE * (self->largest + self->fastest);
    self->n_missing++;
    if (!isfinite(e)) {
        return 0;
    }
    if (self->known && size > most) {
        self->n_beyond++;
    } else if (self->n_beyond > 0) {
        self->n_beyond--;
    }
    if (self->n_beyond > 0 && (hsep_real)self->n_missing <= hsep_ceil(HSEP_AVERAGING_PATIENCE / T_s)) {
        self->farthest = hsep_fmax(self->farthest, hsep_fmin(size, HSEP_PREDICTION_MAX));
        return 0;
    }
    self->n_missing = self->n_beyond = 0;
    self->farthest = 0.0;
    self->largest = hsep_fmax(self->largest, size);
    return 1;
}
