/* Ranges of published predictions and of what is learned. Reentrant; allocates nothing. */
#ifndef HSEP_RANGE_H
#define HSEP_RANGE_H

#include "hsep_math.h"
#include "hsep_real.h"

#include <string.h>

#define HSEP_PREDICTION_MAX HSEP_HUGE(1e100) /* m: sums of squares of smaller values cannot overflow */

/* Whether all entries of a, (n,) numbers in any alignment, are numbers within +- limit. */
static inline int hsep_within(const void *a, hsep_int n, hsep_real limit)
{
    int within = 1;
    for (hsep_int i = 0; i < n; i++) {
        hsep_real entry;
        memcpy(&entry, (const char *)a + i * sizeof entry, sizeof entry);
        within &= hsep_fabs(entry) <= limit; /* NaN is not */
    }
    return within;
}

/* Range of so many numbers of a record. */
typedef struct {
    hsep_real least, most;
    hsep_int n;
} hsep_range;

/* Whether numbers, (n,), are in their ranges: each range holds for its n numbers, in order, and all ranges together for
 * n. */
static inline int hsep_in_ranges(const hsep_real numbers[], hsep_int n, const hsep_range *range)
{
    int within = 1;
    for (hsep_int i = 0, end = range->n; i < n; i++) {
        if (i == end) {
            end += (++range)->n;
        }
        within &= numbers[i] >= range->least && numbers[i] <= range->most; /* NaN is not */
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
