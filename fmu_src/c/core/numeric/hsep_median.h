/* Median of a few numbers, in a time that does not depend on their order. Reentrant; allocates nothing. */
#ifndef HSEP_MEDIAN_H
#define HSEP_MEDIAN_H

#include "hsep_api.h"

#include <stdint.h>

/* The median of n >= 1 finite numbers, the mean of the two in the middle where n is even. Their order changes.
 * Cost: at most 2 n log2(n) comparisons (heapsort, Williams 1964). */
HSEP_API double hsep_median(double values[], uint64_t n);

#endif
