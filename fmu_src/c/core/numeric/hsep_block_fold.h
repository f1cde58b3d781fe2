/* Many rows folded into the factor of a regression at once, by blocked Householder reflections.
 *
 * [R; X] is made a triangle again 4 columns at a time: their reflectors V with the triangle T, I - V T' V', reach all
 * other columns in one go (Schreiber and Van Loan 1989). A row costs less than half of what it costs alone, and as
 * little where rows outweigh all before them; what rounding takes from an entry is not carried along. Reentrant;
 * allocates nothing.
 */
#ifndef HSEP_BLOCK_FOLD_H
#define HSEP_BLOCK_FOLD_H

#include "hsep_api.h"
#include "hsep_regression.h"

#include <stdint.h>

/* Doubles of work for count rows of n features and a target. */
HSEP_API double hsep_block_fold_size(uint64_t n, uint64_t count);

/* Where row b goes in that work, (n + 1,): phi, then its target; 0 so far. Each row is asked for once. */
HSEP_API double *hsep_block_fold_row(double work[], uint64_t n, uint64_t b);

/* Fold these rows into the factor; they are used up. is_triangle: whether row b is 0 before entry b, which saves the
 * work on zeros; wide: hsep_is_wide, the result is the same. Cost: count n^2 / 2 times 2 multiply-adds; n^3 / 6 times
 * as many for a triangle. */
HSEP_API void hsep_block_fold(hsep_regression *self, double work[], uint64_t count, int is_triangle, int wide);

#endif
