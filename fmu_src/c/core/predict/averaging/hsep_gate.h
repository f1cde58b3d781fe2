/* Innovation gate: a measurement is believed, unless the axis cannot have got there; as predict/averaging/gate.py,
 * which says when. Plain data; reentrant; allocates nothing. */
#ifndef HSEP_GATE_H
#define HSEP_GATE_H

#include "hsep_layout.h"
#include "hsep_predict_constants.h"

typedef struct {
    hsep_int n_missing; /* samples since the last one that was believed, */
    hsep_int n_beyond;  /* of these, values out of reach, less values within reach that followed */
    hsep_real farthest; /* m, largest residual out of reach among them */
    hsep_real largest;  /* m, largest residual believed */
    hsep_real fastest;  /* m, largest change from sample to sample, of x_pb so far or of commands that are known */
    hsep_int known;     /* whether there was a motion, and a residual, before the window */
} hsep_gate;
HSEP_ASSERT_WORDS(hsep_gate, 6);

/* Begin a window. largest: m, the largest residual believed before it; fastest: m. */
static inline void hsep_gate_begin(hsep_gate *self, hsep_real largest, hsep_real fastest)
{
    self->largest = largest;
    self->fastest = fastest;
    self->known = largest > 0.0 && fastest > 0.0;
}

/* Judge its next sample by its residual e, m, NaN where it is missing; return whether it is believed. Before the first
 * motion, and over the first window that has a residual, all are. T_s: s. Constant cost. */
static inline int hsep_gate_judge(hsep_gate *self, hsep_real e, hsep_real T_s)
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

#endif
