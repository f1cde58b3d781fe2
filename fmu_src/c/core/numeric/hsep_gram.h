/* Regression with a penalty of its own on each weight, from the Gram matrix of all rows [phi | target].
 *
 * w = argmin_w sum_k [target(k) - w' phi(k)]^2 + sum_i penalties_i w_i^2
 *
 * What rows come to is the same at every sample, and a solution is one Cholesky factor, a third of the work of a
 * triangular factor that is carried. It squares the condition of the rows, which the penalties bound: no pivot is less
 * than its penalty. What rounding takes from an entry is carried along and given back with the next rows, so that the
 * digits do not wear off.
 *
 * Memory is one block: the struct, then its arrays as doubles; no pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_GRAM_H
#define HSEP_GRAM_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_GRAM_TOGETHER 4 /* rows that are added in one go */
#define HSEP_GRAM_ABREAST 4  /* rows whose leverages are computed side by side */

typedef struct {
    uint64_t n;       /* features */
    uint64_t waiting; /* rows that are not added yet, fewer than HSEP_GRAM_TOGETHER */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t rows;    /* (HSEP_GRAM_TOGETHER, n + 1) these, and the one that comes next */
    uint64_t sums;    /* triangle of n + 1 rows: sums of products of entries, from the diagonal to the right, */
    uint64_t carries; /* and what rounding took from them */
} hsep_gram;

HSEP_ASSERT_WORDS(hsep_gram, 5);

/* Bytes of the block, counted in double so that no size can overflow: about 8 n^2. */
HSEP_API double hsep_gram_size(uint64_t n);

/* Fill the block for n >= 1 features, without rows. */
HSEP_API void hsep_gram_init(hsep_gram *self, uint64_t n);

/* Whether a block, in any alignment, is one that hsep_gram_init with n features began. */
HSEP_API int hsep_gram_valid(const void *block, uint64_t n);

/* Where the next row goes, (n + 1,): phi, then its target; what is there before does not matter. */
HSEP_API double *hsep_gram_row(hsep_gram *self);

/* Take in that row, all entries of which must be finite. Cost: n^2 / 2 times 4 multiply-adds and 6 additions at every
 * fourth row. */
HSEP_API void hsep_gram_fold(hsep_gram *self);

/* Take in row i of a factor [R z; 0 rho], its entries i ... n, which the caller has put into hsep_gram_row: all n + 1
 * rows of a factor are worth those it comes from. Fails, and returns 0, if an entry is not finite or a diagonal entry
 * of R is 0. Cost: that of hsep_gram_fold. */
HSEP_API int hsep_gram_load(hsep_gram *self, uint64_t i);

/* Add the rows of other, of the same features, each weighed by weight; weigh all rows so far by a weight. */
HSEP_API void hsep_gram_add(hsep_gram *self, hsep_gram *other, double weight);
HSEP_API void hsep_gram_discount(hsep_gram *self, double weight);

/* Add the rows that wait to the sums now, so that a solution need not: before the last row of a window comes. */
HSEP_API void hsep_gram_settle(hsep_gram *self);

/* Sum of the squares of the targets, m2. */
HSEP_API double hsep_gram_square(const hsep_gram *self);

/* Solve for the weights w, (m,), of the first m features; with the rows of other, settled and of the same features,
 * weighed by weight, or NULL. penalties: (m,) > 0; factor: triangle of m + 1 rows, [R z; 0 rho] with R' R = gram +
 * penalties afterwards, by rows from the diagonal on; least: (m + 1,), work. Return the first sum, of which rounding
 * leaves 1e-14 of the square of the targets. Cost: m^3 / 6 + m^2 multiply-adds, and m^2 / 2 for each row that waits. */
HSEP_API double hsep_gram_solve(
    const hsep_gram *self, const hsep_gram *other, double weight, const double penalties[], uint64_t m, double factor[],
    double least[], double w[]);

/* phi' (R' R)^-1 phi of HSEP_GRAM_ABREAST rows phi, entry after entry side by side in rows, which is used up: the
 * variances of w' phi relative to that of the noise. factor: that of hsep_gram_solve. Cost: m^2 / 2 multiply-adds for
 * each. */
HSEP_API void hsep_gram_leverages(
    const double factor[], uint64_t m, double rows[], double leverages[HSEP_GRAM_ABREAST]);

#endif
