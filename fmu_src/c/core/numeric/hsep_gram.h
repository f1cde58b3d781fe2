/* Gram matrix of all rows [phi | target] of a regression, which hsep_solution.h solves.
 *
 * A row costs the same at every sample, a third of the work of updating a triangular factor. The rounding error of an
 * entry is kept and added back with the next rows (compensated summation), so that errors do not pile up.
 */
#ifndef HSEP_GRAM_H
#define HSEP_GRAM_H

#include "hsep_layout.h"

#define HSEP_GRAM_TOGETHER 4 /* rows that are added in one go */

typedef struct {
    hsep_int n;       /* features */
    hsep_int waiting; /* rows that are not added yet */
    hsep_real n_rows; /* rows so far, weighted */
    hsep_int rows;    /* (HSEP_GRAM_TOGETHER, n + 1) these, and the one that comes next */
    hsep_int sums;    /* triangle of n + 1 rows: sums of products of entries, from the diagonal to the right, */
    hsep_int carries; /* and what rounding took from them */
} hsep_gram;
HSEP_ASSERT_WORDS(hsep_gram, 6);

/* A block of about 8 n^2 bytes for n >= 1 features, without rows. */
HSEP_API hsep_real hsep_gram_size(hsep_int n);
HSEP_API void hsep_gram_init(hsep_gram *self, hsep_int n);

/* Where the next row goes, (n + 1,): phi, then its target; what is there before does not matter. */
HSEP_API hsep_real *hsep_gram_row(hsep_gram *self);

/* Take in that row, all entries finite. Cost: n^2 / 2 times 4 multiply-adds and 6 additions at every fourth row. */
HSEP_API void hsep_gram_fold(hsep_gram *self);

/* Add the rows of other, of the same features, each weighed by weight; weigh all rows so far by a weight. */
HSEP_API void hsep_gram_add(hsep_gram *self, hsep_gram *other, hsep_real weight);
HSEP_API void hsep_gram_discount(hsep_gram *self, hsep_real weight);

/* Add the rows that wait to the sums now, before they are read or saved. */
HSEP_API void hsep_gram_settle(hsep_gram *self);

/* Place of feature i, or of the target, i = n, where the last n_head features come backwards before all others. */
static inline hsep_int hsep_gram_place(const hsep_gram *self, hsep_int n_head, hsep_int i)
{
    const hsep_int n = self->n;
    return i < n - n_head ? n_head + i : i < n ? n - 1 - i : n;
}

/* Add all rows of such features to a triangle of n + 1 rows in their order, and change nothing. */
HSEP_API void hsep_gram_add_to(const hsep_gram *self, hsep_int n_head, hsep_real triangle[]);

/* Sum of the squares of the targets, m2. */
HSEP_API hsep_real hsep_gram_square(const hsep_gram *self);

#endif
