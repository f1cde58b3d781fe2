/* Knots of the splines that a plan is solved for: sums of the uniform ones, which it changes the last plan by.
 *
 * In the first two windows, in which a plan acts or is pinned next, these are uniform splines themselves; behind them
 * knots are twice, and behind four windows four times as far apart. What is planned there is planned again, with closer
 * knots, before it acts, and goes on as it is until then. A spline is a sum of those with half its knot interval.
 */
#ifndef HSEP_KNOTS_H
#define HSEP_KNOTS_H

#include "hsep_layout.h"

#define HSEP_KNOTS_LEVELS 3 /* of the distance between knots: 1, 2, 4 spacings */
#define HSEP_KNOTS_NEAR 5   /* uniform splines on each side whose rows (hsep_splines.h) overlap those of one, at most */
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
