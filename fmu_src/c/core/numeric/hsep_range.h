/* Range of published predictions. Reentrant; allocates nothing. */
#ifndef HSEP_RANGE_H
#define HSEP_RANGE_H

#include "hsep_math.h"
#include "hsep_real.h"

#define HSEP_PREDICTION_MAX HSEP_HUGE(1e100) /* m: sums of squares of smaller values cannot overflow */

/* Whether all entries of a, (n,), are numbers within +- limit. */
static inline int hsep_within(const hsep_real a[], hsep_int n, hsep_real limit)
{
    int within = 1;
    for (hsep_int i = 0; i < n; i++) {
        within &= hsep_fabs(a[i]) <= limit; /* NaN is not */
    }
    return within;
}

/* A value within +- bound; bound if it is not a number. */
static inline hsep_real hsep_clip(hsep_real value, hsep_real bound)
{
    const hsep_real below = value < bound ? value : bound;
    return below > -bound ? below : -bound;
}

#endif
