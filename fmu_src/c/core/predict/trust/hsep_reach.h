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

#include <stdint.h>

typedef struct {
    double fastest;     /* m, largest change of x_pb from sample to sample so far */
    uint64_t n_missing; /* samples since the last one that was believed, */
    uint64_t n_beyond;  /* of these, values out of reach, less those within it that followed */
} hsep_reach;

HSEP_ASSERT_WORDS(hsep_reach, 3);

/* Judge the samples of a window: believed, (n,), becomes 1 where one is believed and 0 elsewhere. Before the first
 * motion, and over the first window that has a residual, all are. x: (n,) m, measured, NaN where missing; x_pb: (n,)
 * m; before: m, the last prediction before them; largest: m, the largest residual believed before them; T_s: s.
 * Signals are newest first: sample k is at place n - 1 - k. Cost: 10 operations a sample. */
HSEP_API void hsep_reach_judge(
    hsep_reach *self, const double x[], const double x_pb[], double before, uint64_t n, double largest, double T_s,
    double believed[]);

#endif
