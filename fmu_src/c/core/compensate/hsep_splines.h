/* Cubic B-spline basis of the change of the command, delta(k) = sum_j c_j b(k - j spacing), over a plan.
 *
 * Spline j begins at sample j spacing and ends 4 spacings later; the last one ends so that the last four samples of a
 * plan are without change. Splines -3, -2, -1 began before the plan and still act in it. What a drive limits are the
 * differences of delta, order 0 to 3, in shares of a limit: the "rows", of order o at sample k at place o preview + k.
 *
 * Memory is one block: the struct, then its tables as doubles; no pointers. Reentrant; allocates nothing.
 */
#ifndef HSEP_SPLINES_H
#define HSEP_SPLINES_H

#include "hsep_api.h"
#include "hsep_layout.h"

#include <stdint.h>

#define HSEP_ORDERS 4  /* orders of difference: 0, the change itself, to 3, its jerk */
#define HSEP_DECIDED 3 /* splines that began before a plan and still act in it */

typedef struct {
    uint64_t preview, spacing;
    uint64_t n;                /* splines that begin in a plan */
    double share[HSEP_ORDERS]; /* what one metre of difference is of its limit, 1/m */
    /* Offsets in doubles from the beginning of the struct */
    uint64_t shape;                    /* (4 spacing,) b */
    uint64_t differences[HSEP_ORDERS]; /* (4 spacing + 3,) of each order, in shares */
} hsep_splines;

HSEP_ASSERT_WORDS(hsep_splines, 12);

/* Splines that begin in a plan: those that end four samples before it does. preview >= 4 spacing + 3. */
HSEP_API uint64_t hsep_splines_count(uint64_t preview, uint64_t spacing);

/* Bytes of the block, counted in double. */
HSEP_API double hsep_splines_size(uint64_t preview, uint64_t spacing);

/* Fill the block. limit: of the change, m, and of its differences of orders 1 to 3, m a sample to that power. */
HSEP_API void hsep_splines_init(
    hsep_splines *self, uint64_t preview, uint64_t spacing, const double limit[HSEP_ORDERS]);

/* Another limit of an order from now on, m a sample to that power. Cost: 10 spacing operations. */
HSEP_API void hsep_splines_limit(hsep_splines *self, unsigned order, double limit);

/* Whether a block, in any alignment, is one that hsep_splines_init with these parameters began. */
HSEP_API int hsep_splines_valid(const void *block, uint64_t preview, uint64_t spacing);

/* What the first count splines give at sample k, with coefficients c, (count,), those of the splines -3, -2, -1 first.
 * 4 multiply-adds. */
HSEP_API double hsep_splines_sum(const hsep_splines *self, const double c[], uint64_t count, uint64_t k);

/* The rows of the splines first ... n - 1 with coefficients c, (n - first,). Cost: 14 operations a sample. */
HSEP_API void hsep_splines_rows(const hsep_splines *self, const double c[], uint64_t first, double rows[]);

/* Row samples that the splines first ... n - 1 touch, of an order: *begin ... *end - 1. */
HSEP_API void hsep_splines_touched(
    const hsep_splines *self, uint64_t first, unsigned order, uint64_t *begin, uint64_t *end);

/* g, (n - first,), += what rows, weighted, say of each coefficient: the transpose of hsep_splines_rows. The rows are
 * used up. Cost: 9 operations a sample, and 4 preview multiply-adds. */
HSEP_API void hsep_splines_transpose(const hsep_splines *self, double rows[], uint64_t first, double g[]);

/* The triangle of n - first rows += A' diag(weights) A, A being the matrix of hsep_splines_rows. work: (4 preview,).
 * Cost: 40 spacing multiply-adds for each of these splines. */
HSEP_API void hsep_splines_gram(
    const hsep_splines *self, const double weights[], uint64_t first, double triangle[], double work[]);

/* The sum of squares of a spline's rows: the largest entry on the diagonal of A' A. */
HSEP_API double hsep_splines_energy(const hsep_splines *self);

/* The triangle of n rows := W' W of the splines behind a filter, W's columns being shifts of the filtered spline,
 * (preview,), by one spacing. Each diagonal is a running sum: cost n preview / 2 multiply-adds. */
HSEP_API void hsep_splines_filtered_gram(const hsep_splines *self, const double filtered[], double triangle[]);

/* The triangle of n rows += weight D' D with the differences D of an order of the splines, m. */
HSEP_API void hsep_splines_difference_gram(const hsep_splines *self, unsigned order, double weight, double triangle[]);

/* What weight D' D, of hsep_splines_difference_gram, makes of coefficients: y, (n,), += weight D' D c. */
HSEP_API void hsep_splines_difference_product(
    const hsep_splines *self, unsigned order, double weight, const double c[], double y[]);

/* v, (n,), := W' target - weight D' third with the third differences D, target and third (preview,). */
HSEP_API void hsep_splines_project(
    const hsep_splines *self, const double filtered[], const double target[], double weight, const double third[],
    double v[]);

/* v, (n,), -= weight D' third. */
HSEP_API void hsep_splines_project_jerk(const hsep_splines *self, double weight, const double third[], double v[]);

/* The spline itself, b, (4 spacing,). */
HSEP_API const double *hsep_splines_shape(const hsep_splines *self);

#endif
