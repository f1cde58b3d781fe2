/* Reach: a measurement is believed, unless the axis cannot have got there; as predict/averaging/gate.py,
 * which says when.
 * Plain data; reentrant; allocates nothing. */
#ifndef HSEP_GATE_H
#define HSEP_GATE_H

#include "hsep_api.h"
#include "hsep_layout.h"

typedef struct {
    hsep_int n_missing; /* samples since the last one that was believed, */
    hsep_int n_beyond;  /* of these, values out of reach, less values within reach that followed */
    hsep_real farthest; /* m, largest residual out of reach among them */
    hsep_real largest;  /* m, largest residual believed */
    hsep_real fastest;  /* m, largest change of x_pb from sample to sample so far, of the window, too */
    hsep_int known;     /* whether there was a motion, and a residual, before the window */
} hsep_gate;

HSEP_ASSERT_WORDS(hsep_gate, 6);

/* Begin a window. largest: m, the largest residual believed before it; fastest: m. */
HSEP_API void hsep_gate_begin(hsep_gate *self, hsep_real largest, hsep_real fastest);

/* Judge its next sample by its residual e, m, NaN where it is missing; return whether it is believed. Before the first
 * motion, and over the first window that has a residual, all are. T_s: s. Constant cost. */
HSEP_API int hsep_gate_judge(hsep_gate *self, hsep_real e, hsep_real T_s);

#endif
