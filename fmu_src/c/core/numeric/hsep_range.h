/* Range of published predictions. Reentrant; allocates nothing. */
#ifndef HSEP_RANGE_H
#define HSEP_RANGE_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define HSEP_PREDICTION_MAX 1e100 /* m: sums of squares of smaller values cannot overflow */

/* Whether all entries of a, (n,) doubles in any alignment, are numbers within +- limit. */
static inline int hsep_within(const void *a, uint64_t n, double limit)
{
    int within = 1;
    for (uint64_t i = 0; i < n; i++) {
        double entry;
        memcpy(&entry, (const char *)a + i * sizeof entry, sizeof entry);
        within &= fabs(entry) <= limit; /* NaN is not */
    }
    return within;
}

/* A value within +- bound; bound if it is not a number. */
static inline double hsep_clip(double value, double bound)
{
    const double below = value < bound ? value : bound;
    return below > -bound ? below : -bound;
}

#endif
