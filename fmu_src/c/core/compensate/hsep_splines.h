/* Cubic B-spline basis of the change of the command, delta(k) = sum_j c_j b(k - j spacing), over a plan.
 *
 * Spline j begins at sample j spacing and ends 4 spacings later; the last one ends so that the last four samples of a
 * plan are without change. Splines -3, -2, -1 began before the plan and still act in it. The drive limits the
 * differences of delta of orders 0 to 3. Each of them, as a share of its limit, is a "row": order o at sample k is row
 * o preview + k.
 */
#ifndef HSEP_SPLINES_H
#define HSEP_SPLINES_H

#include "hsep_layout.h"
#include "hsep_plan_constants.h"

#define HSEP_ORDERS 4                          /* orders of difference: 0, the change itself, to 3, its jerk */
#define HSEP_SPLINES_TOGETHER (4 * HSEP_LANES) /* splines whose products with another one are summed side by side */

typedef struct {
    hsep_int preview, spacing;
    hsep_int n;                        /* splines that begin in a plan */
    hsep_real share[HSEP_ORDERS];      /* 1 / limit of an order, 1/m */
    hsep_int shape;                    /* (4 spacing,) b */
    hsep_int differences[HSEP_ORDERS]; /* (4 spacing + 3,) of each order, in shares */
} hsep_splines;
HSEP_ASSERT_WORDS(hsep_splines, 12);

/* Differences of orders 0 to 3 at a sample with this value, from those at the sample before, in place. */
static inline void hsep_differ(hsep_real differences[HSEP_ORDERS], hsep_real value)
{
    for (unsigned order = 0; order < HSEP_ORDERS; order++) {
        const hsep_real before = differences[order];
        differences[order] = value;
        value -= before;
    }
}

/* Differences at the last of three samples, from 0. */
static inline void hsep_differ_from(hsep_real differences[HSEP_ORDERS], const hsep_real before[3])
{
    hsep_zero(differences, HSEP_ORDERS);
    for (int i = 0; i < 3; i++) {
        hsep_differ(differences, before[i]);
    }
}

/* Splines that begin in a plan and end four samples before it does, or earlier. preview >= 4 spacing + 3. */
static inline hsep_int hsep_splines_count(hsep_int preview, hsep_int spacing)
{
    return (preview - 4 * spacing - HSEP_SPLINES_END) / spacing + 1;
}

HSEP_API hsep_real hsep_splines_lay_out(hsep_splines *self, hsep_int preview, hsep_int spacing);
/* Fill the block. limit: of the change, m, and of its differences of orders 1 to 3, m a sample to that power. */
HSEP_API void hsep_splines_init(
    hsep_splines *self, hsep_int preview, hsep_int spacing, const hsep_real limit[HSEP_ORDERS]);

/* Another limit of an order from now on, m a sample to that power. Cost: 10 spacing operations. */
HSEP_API void hsep_splines_limit(hsep_splines *self, unsigned order, hsep_real limit);

/* Sum of the first count splines at sample k, with coefficients c, (count,), from spline -3 on. 4 multiply-adds. */
HSEP_API hsep_real hsep_splines_sum(const hsep_splines *self, const hsep_real c[], hsep_int count, hsep_int k);

/* The rows of the splines first ... n - 1 with coefficients c, (n - first,). Cost: 14 operations a sample. */
HSEP_API void hsep_splines_rows(const hsep_splines *self, const hsep_real c[], hsep_int first, hsep_real rows[]);

/* Rows of orders 1 to 3 of x_d, (count,) m, where one within the length of a spline exceeds its limit, 0 elsewhere; 4
 * count rows. before: (3,) m, the commands before it. */
HSEP_API void hsep_splines_exceeded(
    const hsep_splines *self, const hsep_real x_d[], const hsep_real before[3], hsep_int count, hsep_real rows[]);

/* g, (n - first,), += A' rows, A being the matrix of hsep_splines_rows. The rows are used up. Cost: 9 operations a
 * sample, and 4 preview multiply-adds. */
HSEP_API void hsep_splines_transpose(const hsep_splines *self, hsep_real rows[], hsep_int first, hsep_real g[]);

/* The products A' diag(weights) A (hsep_knots_add). work: (4 preview + 4 HSEP_LANES_MOST,), of which the last ones are
 * read beside others. Cost: 40 spacing multiply-adds for each of these splines. */
HSEP_API void hsep_splines_gram(
    const hsep_splines *self, const hsep_real weights[], hsep_int first, hsep_real products[], hsep_real work[]);

/* The sum of squares of a uniform spline's rows: the largest entry on the diagonal of A' A. */
HSEP_API hsep_real hsep_splines_energy(const hsep_splines *self);

/* The triangle of n rows := W' W of the splines behind a filter, W's columns being the filtered spline, (preview,),
 * each shifted by one spacing more. Each diagonal is a running sum: n preview / 2 multiply-adds. */
HSEP_API void hsep_splines_filtered_gram(const hsep_splines *self, const hsep_real filtered[], hsep_real triangle[]);

/* The products weight D' D, and g, (n - first,), := -weight D' third, with the third differences D of the splines
 * first ... n - 1, m; third: (preview,) m. */
HSEP_API void hsep_splines_jerk(
    const hsep_splines *self, hsep_real weight, const hsep_real third[], hsep_int first, hsep_real products[],
    hsep_real g[]);

/* The spline itself, b, (4 spacing,). */
static inline const hsep_real *hsep_splines_shape(const hsep_splines *self) { return hsep_at_const(self, self->shape); }

/* Knots of the splines that a plan is solved for: sums of the uniform ones, which it changes the last plan by. In the
 * first two windows, in which a plan acts or is pinned next, these are uniform splines themselves; behind them knots
 * are twice, and behind four windows four times as far apart. What is planned there is planned again, with closer
 * knots, before it acts, and goes on as it is until then. A spline is a sum of those with half its knot interval. */
#define HSEP_KNOTS_LEVELS 3 /* of the distance between knots: 1, 2, 4 spacings */
#define HSEP_KNOTS_NEAR 5   /* uniform splines on each side whose rows overlap those of one, at most */
#define HSEP_KNOTS_WIDTH (2 * HSEP_KNOTS_NEAR + 1)

typedef struct {
    hsep_int n;                        /* uniform splines that may change, */
    hsep_int end;                      /* those before the last one that does, */
    hsep_int m;                        /* and splines that are solved for, */
    hsep_int count[HSEP_KNOTS_LEVELS]; /* of each level, */
    hsep_int begin[HSEP_KNOTS_LEVELS]; /* which begins with that uniform spline */
} hsep_knots;
HSEP_ASSERT_WORDS(hsep_knots, 9);

/* A spline that is solved for: share[i], i < length, of the uniform splines begin + i. */
typedef struct {
    hsep_int level, first, last; /* distance of knots, and the first and the last spline that have it */
    hsep_int begin, length;
    const hsep_real *share;
} hsep_knot;

/* n uniform splines, of which so many begin in a window; 0: each is solved for. */
HSEP_API hsep_knots hsep_knots_of(hsep_int n, hsep_int window);

HSEP_API hsep_knot hsep_knots_at(const hsep_knots *self, hsep_int i);

/* c, (n,), of the uniform splines := x, (m,). */
HSEP_API void hsep_knots_widen(const hsep_knots *self, const hsep_real x[], hsep_real c[]);

/* h, (m,), += the transpose of hsep_knots_widen of g, (n,). */
HSEP_API void hsep_knots_narrow(const hsep_knots *self, const hsep_real g[], hsep_real h[]);

/* The triangle of m rows += a symmetric product of the uniform splines, products[HSEP_KNOTS_WIDTH i + HSEP_KNOTS_NEAR +
 * d] of spline i with i + d. work: (n + 2 HSEP_KNOTS_NEAR,). Cost: about 300 multiply-adds for each spline. */
HSEP_API void hsep_knots_add(
    const hsep_knots *self, const hsep_real products[], hsep_real triangle[], hsep_real work[]);

#endif
