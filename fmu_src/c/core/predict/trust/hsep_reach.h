/* Reach: a measurement is believed, unless the axis cannot have got there.
 *
 * The residual of an axis grows from sample to sample by no more than the axis and its model move. A value whose
 * residual is beyond twice the largest so far, by more than a few of the fastest steps of the model, is missing. So are
 * the values after it, until as many within reach have followed as there were beyond it: an axis passes by the zero
 * that its sensor reads. After a second the axis has been moved, or its sensor set, and the value is believed.
 *
 * Plain data; reentrant; allocates nothing.
 */
#ifndef HSEP_REACH_H
#define HSEP_REACH_H

#include "hsep_api.h"
#include "hsep_layout.h"
#include "hsep_real.h"

typedef struct {
    hsep_real fastest;   /* m, largest change of x_pb from sample to sample so far */
    hsep_word n_missing; /* samples since the last one that was believed, */
    hsep_word n_beyond;  /* of these, values out of reach, less those within it that followed */
} hsep_reach;

HSEP_ASSERT_WORDS(hsep_reach, 3);

/* What is known of a window that is judged. */
typedef struct {
    hsep_real largest; /* m, largest residual believed */
    hsep_word known;   /* whether there was a motion, and a residual, before it */
} hsep_reach_window;

HSEP_ASSERT_WORDS(hsep_reach_window, 2);

/* Begin a window. x_pb: (n,) m, newest first; before: m, the last prediction before it; largest: m, the largest
 * residual believed before it. */
HSEP_API hsep_reach_window
hsep_reach_begin(hsep_reach *self, const hsep_real x_pb[], hsep_real before, hsep_word n, hsep_real largest);

/* Judge its next sample by its residual e, m, NaN where it is missing; return whether it is believed. Before the first
 * motion, and over the first window that has a residual, all are. T_s: s. Constant cost. */
HSEP_API int hsep_reach_judge(hsep_reach *self, hsep_reach_window *window, hsep_real e, hsep_real T_s);

#endif
